"""Where a part stands, from a scan of it in the robot's frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from paint_deposition.motion.part_frame import Rigid
from paint_deposition.motion.touched_points import PartPlace

if TYPE_CHECKING:
    from trimesh import Trimesh

SAMPLES = 1500
PART_SAMPLES = 40_000
ROUGH_STEPS, FINE_STEPS = 40, 60
# Rough steps end where the mean squared distance changes by less [m2].
ROUGH_M2 = 1e-10
# Points so many times farther off than half of them are not of the part.
STRANGER = 5.0
# Another pose that fits within this factor may be the right one.
AS_GOOD = 1.3
NOTABLE_M = 0.005
# Every so many of the samples tell how dense they are.
FEW = 20


def register(scan: Trimesh, part: Trimesh, start: Rigid | None = None) -> PartPlace:
    """The pose of the part that a scan fits.

    The iterative closest points of trimesh come near it; they creep along a smooth surface, so
    the last steps close the distances across it.

    Args:
        scan: surface in the robot's frame [m]; it may miss some of the part.
        part: surface in the part's frame [m].
        start: pose to begin with; default: the principal axes of both, each way round.

    Returns:
        The pose, and the residuals of the scan's points: 95 % and largest.
    """
    from trimesh.registration import icp
    from trimesh.sample import sample_surface

    points = np.asarray(scan.sample(SAMPLES, seed=1))
    cloud, face = sample_surface(part, PART_SAMPLES, seed=2)
    starts = [np.linalg.inv(_matrix(start))] if start else _principal_starts(points, cloud)
    found = []
    for begin in starts:
        near, *_ = icp(
            points[::3], cloud[::FEW], begin, ROUGH_M2, ROUGH_STEPS, reflection=False, scale=False
        )
        laid, left = _across(points, near, np.asarray(cloud), part.face_normals[face])
        found.append((float(np.sqrt(np.mean(left**2))), laid, left))
    found.sort(key=lambda one: one[0])
    rms, matrix, apart = found[0]
    warnings = []
    others = [
        laid for other_rms, laid, _ in found[1:]
        if other_rms < AS_GOOD * rms and _turned_rad(laid, matrix) > 0.2
    ]  # fmt: skip
    if others and rms <= NOTABLE_M:
        warnings.append(
            f'{len(others) + 1} poses fit alike, the part looks the same after a turn of '
            f'{np.degrees(_turned_rad(others[0], matrix)):.0f} degrees; give --start near the '
            'right one'
        )
    if rms > NOTABLE_M:
        warnings.append(
            f'the scan is {rms * 1e3:.1f} mm off the part; cut away what is not the part, check '
            'both units, or give --start'
        )
    residuals = {
        '95 % of the points within': float(np.quantile(apart, 0.95)),
        'largest': float(apart.max()),
    }
    return PartPlace(_rigid(np.linalg.inv(matrix)), rms, residuals, tuple(warnings))


def _across(
    points: np.ndarray, start: np.ndarray, cloud: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The transform (4, 4) refined by least squares, and the distances (N,) that are left.

    The distance of a point over the surface is that along the normal; beside its rim, that to
    the rim.
    Source: Chen and Medioni, Object modelling by registration of multiple range images (1992).
    """
    tree = cKDTree(cloud)
    # Over the surface a sample is at hand; farther along it than this is beside its rim.
    reach = 2.0 * np.max(tree.query(cloud[::FEW], k=[2])[0])
    least: np.ndarray = np.full(len(points), np.inf)
    matrix = best = start
    for _ in range(FINE_STEPS):
        at = _moved(points, matrix)
        to_sample, nearest = tree.query(at)
        normal, gap = normals[nearest], at - cloud[nearest]
        off = np.sum(gap * normal, axis=1)
        beside = np.sqrt(np.maximum(to_sample**2 - off**2, 0.0)) > reach
        apart = np.where(beside, to_sample, np.abs(off))
        if np.median(apart) >= np.median(least):
            break
        best, least = matrix, apart
        own = to_sample <= STRANGER * np.median(to_sample)
        # Along the normals; beside the rim in every direction.
        every = [np.broadcast_to(axis, normal.shape) for axis in np.eye(3)]
        pulls = [(own, normal), *((own & beside, axis) for axis in every)]
        columns = np.concatenate([np.hstack([np.cross(at[w], n[w]), n[w]]) for w, n in pulls])
        left = np.concatenate([np.sum(gap[w] * n[w], axis=1) for w, n in pulls])
        step, *_ = np.linalg.lstsq(columns, -left, rcond=1e-6)
        change = np.eye(4)
        change[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix()
        change[:3, 3] = step[3:]
        matrix = change @ matrix
    return best, least


def _moved(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def _principal_starts(points: np.ndarray, cloud: np.ndarray) -> list[np.ndarray]:
    """Transforms (4, 4) that lay the principal axes of the points on those of the cloud."""
    (at, axes), (to, onto) = _principal_axes(points), _principal_axes(cloud)
    starts = []
    for signs in ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]):
        matrix = np.eye(4)
        matrix[:3, :3] = onto @ np.diag(signs) @ axes.T
        matrix[:3, 3] = to - matrix[:3, :3] @ at
        starts.append(matrix)
    return starts


def _principal_axes(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre (3,) and right-handed axes (3, 3), as columns, the longest first."""
    centre = positions.mean(axis=0)
    axes = np.linalg.svd(positions - centre, full_matrices=False)[2].T
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return centre, axes


def _turned_rad(a: np.ndarray, b: np.ndarray) -> float:
    return float(Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).magnitude())


def _matrix(pose: Rigid) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.translation_m
    return matrix


def _rigid(matrix: np.ndarray) -> Rigid:
    return Rigid.of([*matrix[:3, 3], *Rotation.from_matrix(matrix[:3, :3]).as_quat()])
