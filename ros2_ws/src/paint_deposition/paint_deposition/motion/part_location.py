"""Where a part stands, from named points on it that the robot touched."""

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
# A misfit above this is warned of [m].
NOTABLE_M = 0.002


@dataclass(frozen=True)
class PartPlace:
    """The pose of a part in the frame of the robot, and how well it is known.

    ``residuals_m`` are, by point, how far it is from where the pose puts it; with their RMS [m].
    """

    pose: Rigid
    rms_m: float
    residuals_m: Mapping[str, float]
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Pose, residuals and warnings."""
        figures = {'part_pose': list(self.pose.values), 'rms_m': self.rms_m}
        said = {'residuals_m': dict(self.residuals_m), 'warnings': list(self.warnings)}
        return figures | said


def locate(touched_m: Mapping[str, np.ndarray], points_m: Mapping[str, np.ndarray]) -> PartPlace:
    """The pose that brings points of the part to where they were touched, by least squares.

    Both are (3,) [m] by name, in the robot's and in the part's frame; points without a partner are
    left out. Raises RecordingError for fewer than three in common, or points on a line.
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
    middle, about = touched.mean(axis=0), points.mean(axis=0)
    turn, _ = Rotation.align_vectors(touched - middle, points - about)
    pose = Rigid.of([*(middle - turn.apply(about)), *turn.as_quat()])
    apart = np.linalg.norm(turn.apply(points - about) + middle - touched, axis=1)
    rms = float(np.sqrt(np.mean(apart**2)))
    warnings: tuple[str, ...] = ()
    if rms > NOTABLE_M:
        worst = names[int(np.argmax(apart))]
        warnings = (
            f'the points do not fit, {worst} is off by {apart.max() * 1e3:.1f} mm: touch it '
            'again, and check its name, the units of both tables and that both frames are '
            'right-handed',
        )
    return PartPlace(pose, rms, dict(zip(names, apart.tolist(), strict=True)), warnings)
