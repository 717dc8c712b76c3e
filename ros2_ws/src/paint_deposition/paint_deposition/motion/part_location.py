"""Where a part stands, from named points on it that the robot touched, or from a scan of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.motion.part_frame import Rigid

if TYPE_CHECKING:
    from trimesh import Trimesh

FEWEST_POINTS = 3
# Points nearer to a line than this share of their spread leave the turn about it open.
LEAST_WIDTH = 0.03
# A misfit above this is looked into: is it one point, the unit, a mirrored axis, a stranger [m]?
NOTABLE_POINT_M, NOTABLE_SCAN_M = 0.002, 0.005
# So much less of the misfit must be left for a cause to be named.
EXPLAINED = 0.25

SAMPLES, PART_SAMPLES = 1500, 40_000
ROUGH_STEPS, FINE_STEPS = 40, 60
# Rough steps end where the mean squared distance changes by less [m2].
ROUGH_M2 = 1e-10
# Points so many times farther off than half of them are not of the part.
STRANGER = 5.0
# Another pose that fits within this factor, turned by so much [rad], may be the right one.
AS_GOOD, OTHER_RAD = 1.3, 0.2
# Every so many of the samples show how dense they are.
FEW = 20


@dataclass(frozen=True)
class PartPlace:
    """The pose of a part, and how well it is known.

    Attributes:
        pose: of the part in the frame of the robot, or of the scan.
        rms_m: root mean square of the residuals [m].
        residuals_m: by point, how far it is from where the pose puts it [m].
        warnings: what is odd, a line each.
    """

    pose: Rigid
    rms_m: float
    residuals_m: Mapping[str, float]
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Pose, residuals and warnings."""
        return {
            'part_pose': list(self.pose.values),
            'rms_m': self.rms_m,
            'residuals_m': dict(self.residuals_m),
            'warnings': list(self.warnings),
        }


def locate(touched_m: Mapping[str, np.ndarray], points_m: Mapping[str, np.ndarray]) -> PartPlace:
    """The pose that brings points of the part to where they were touched, by least squares.

    Args:
        touched_m: (3,) by name, in the robot's frame [m].
        points_m: (3,) by name, the same points in the part's frame; others are left out.

    Raises:
        RecordingError: fewer than three points in common, points on a line, another unit, or a
            mirrored frame.
    """
    names = [name for name in touched_m if name in points_m]
    if len(names) < FEWEST_POINTS:
        raise RecordingError(
            f'{len(names)} points in common ({" ".join(names) or "none"}); touched are '
            f'{" ".join(touched_m)}, listed are {" ".join(points_m)}; give three or more that '
            'have the same names'
        )
    touched = np.array([touched_m[name] for name in names])
    points = np.array([points_m[name] for name in names])
    for what, positions in (('touched', touched), ('listed', points)):
        spread = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
        if not spread[1] > LEAST_WIDTH * spread[0]:
            raise RecordingError(
                f'the {what} points {" ".join(names)} lie on a line, so that the part may be '
                'turned about it; add a point beside it'
            )
    pose, apart = _fitted(touched, points)
    rms, warnings = _rms(apart), ()
    if rms > NOTABLE_POINT_M:
        _refuse_other_unit(touched, points)
        mirrored = _rms(_fitted(touched, points * [-1.0, 1.0, 1.0])[1])
        if mirrored < EXPLAINED * rms:
            raise RecordingError(
                f'the points are {rms * 1e3:.1f} mm off, mirrored ones {mirrored * 1e3:.1f} mm: '
                'one of the frames is left-handed; turn the sign of one axis'
            )
        warnings = _wrong_point(names, touched, points, rms)
    return PartPlace(pose, rms, dict(zip(names, apart.tolist(), strict=True)), warnings)


def _fitted(touched: np.ndarray, points: np.ndarray) -> tuple[Rigid, np.ndarray]:
    """Pose, and distance (N,) of each point from where it was touched."""
    middle, about = touched.mean(axis=0), points.mean(axis=0)
    turn, _ = Rotation.align_vectors(touched - middle, points - about)
    pose = Rigid.of([*(middle - turn.apply(about)), *turn.as_quat()])
    apart = np.linalg.norm(turn.apply(points - about) + middle - touched, axis=1)
    return pose, apart


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _refuse_other_unit(touched: np.ndarray, points: np.ndarray) -> None:
    ratio = _spread_m(touched) / _spread_m(points)
    for factor, what in ((1000.0, 'touched'), (0.001, 'listed')):
        if abs(ratio / factor - 1.0) < 0.1:
            raise RecordingError(
                f'the {what} points are a thousand times farther apart than the others: they '
                'look like millimetres; write the unit in their heading, as in x [mm]'
            )


def _spread_m(positions: np.ndarray) -> float:
    return _rms(np.linalg.norm(positions - positions.mean(axis=0), axis=1))


def _wrong_point(
    names: list[str], touched: np.ndarray, points: np.ndarray, rms: float
) -> tuple[str, ...]:
    """The one point without which the others fit, if there is one."""
    if len(names) <= FEWEST_POINTS:
        return ()
    without = [
        _rms(_fitted(np.delete(touched, k, axis=0), np.delete(points, k, axis=0))[1])
        for k in range(len(names))
    ]
    k = int(np.argmin(without))
    if without[k] > EXPLAINED * rms:
        return ()
    return (
        f'without {names[k]} the others fit within {without[k] * 1e3:.1f} mm RMS instead of '
        f'{rms * 1e3:.1f} mm; touch it again, or check its name',
    )


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
    cloud = np.asarray(cloud)
    found = []
    for begin in _principal_starts(points, cloud) if start is None else [_matrix(start.inverse())]:
        near, *_ = icp(
            points[::3], cloud[::FEW], begin, ROUGH_M2, ROUGH_STEPS, reflection=False, scale=False
        )
        laid, left = _across(points, near, cloud, part.face_normals[face])
        found.append((_rms(left), laid, left))
    found.sort(key=lambda one: one[0])
    rms, matrix, apart = found[0]
    turned = [_turned_rad(laid, matrix) for other, laid, _ in found[1:] if other < AS_GOOD * rms]
    others = [angle for angle in turned if angle > OTHER_RAD]
    warnings = []
    if others and rms <= NOTABLE_SCAN_M:
        warnings.append(
            f'{len(others) + 1} poses fit alike, the part looks the same after a turn of '
            f'{np.degrees(others[0]):.0f} degrees; give --start near the right one'
        )
    if rms > NOTABLE_SCAN_M:
        warnings.append(
            f'the scan is {rms * 1e3:.1f} mm off the part; cut away what is not the part, check '
            'both units, or give --start'
        )
    residuals = {
        '95 % of the points within': float(np.quantile(apart, 0.95)),
        'largest': float(apart.max()),
    }
    place = np.linalg.inv(matrix)
    turn = Rotation.from_matrix(place[:3, :3]).as_quat()
    return PartPlace(Rigid.of([*place[:3, 3], *turn]), rms, residuals, tuple(warnings))


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
        at = points @ matrix[:3, :3].T + matrix[:3, 3]
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
