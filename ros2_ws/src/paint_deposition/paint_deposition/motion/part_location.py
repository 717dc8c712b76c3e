"""Where a part stands, from named points on it that the robot touched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.motion.part_frame import Rigid

FEWEST_POINTS = 3
# Points nearer to a line than this share of their spread leave the turn about it open.
LEAST_WIDTH = 0.03
# A misfit above this is looked into: is it one point, the unit, a mirrored axis, a stranger [m]?
NOTABLE_M = 0.002
# So much less of the misfit must be left for a cause to be named.
EXPLAINED = 0.25


@dataclass(frozen=True)
class PartPlace:
    """The pose of a part, and how well it is known.

    Attributes:
        pose: of the part in the frame of the robot.
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
    rms = _rms(apart)
    warnings: tuple[str, ...] = ()
    if rms > NOTABLE_M:
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
