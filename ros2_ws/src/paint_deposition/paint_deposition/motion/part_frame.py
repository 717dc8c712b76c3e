"""The part in the frame of the poses: where it stands, also by points that were touched."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.motion.trajectory import Trajectory

# As for poses of a recording: further off is damage, not rounding.
QUATERNION_TOLERANCE = 0.01
# On which painting nodes say where the part stands.
PART_POSE_TOPIC = 'part_pose'
POSE_FORMAT = 'seven numbers, x y z [m] and a unit quaternion qx qy qz qw'


def is_pose(values: Sequence[float]) -> bool:
    """Whether these are seven finite numbers whose last four are nearly a unit quaternion."""
    if len(values) != 7 or not all(map(math.isfinite, values)):
        return False
    return abs(math.hypot(*values[3:]) - 1.0) <= QUATERNION_TOLERANCE


def is_frame(frame_id: str, own: str) -> bool:
    """Whether poses in a frame are in one's own: it is the same, or none is named."""
    return frame_id.lstrip('/') in ('', own.lstrip('/'))


@dataclass(frozen=True)
class Rigid:
    """A rotation (3, 3) with its quaternion (x, y, z, w), and then a translation (3,) [m]."""

    rotation: np.ndarray
    quaternion_xyzw: tuple[float, float, float, float]
    translation_m: np.ndarray

    @staticmethod
    def of(values: Sequence[float] | np.ndarray) -> 'Rigid':
        """From [x y z qx qy qz qw]; the quaternion is normalised."""
        quaternion = np.asarray(values[3:], dtype=float)
        x, y, z, w = (quaternion / np.linalg.norm(quaternion)).tolist()
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return Rigid(rotation, (x, y, z, w), np.asarray(values[:3], dtype=float))

    def inverse(self) -> 'Rigid':
        """The inverse transform."""
        x, y, z, w = self.quaternion_xyzw
        back = self.rotation.T
        return Rigid(back, (-x, -y, -z, w), -back @ self.translation_m)

    def __matmul__(self, first: 'Rigid') -> 'Rigid':
        """The transform that does the other one first, and then this one."""
        position, quaternion = self.applied(first.translation_m, np.array(first.quaternion_xyzw))
        return Rigid.of([*position, *quaternion])

    @property
    def values(self) -> tuple[float, ...]:
        """The transform as [x y z qx qy qz qw]."""
        return (*self.translation_m.tolist(), *self.quaternion_xyzw)

    def applied(self, positions_m: np.ndarray, quaternions_xyzw: np.ndarray) -> tuple:
        """Poses after the transform: positions (..., 3) and quaternions (..., 4) of unchanged
        norm.

        Each pose by itself, so that it comes out the same to the last bit alone or among others.
        """
        turned = np.sum(self.rotation * positions_m[..., np.newaxis, :], axis=-1)
        x, y, z, w = self.quaternion_xyzw
        qx, qy, qz, qw = np.moveaxis(quaternions_xyzw, -1, 0)
        quaternions = (
            w * qx + x * qw + y * qz - z * qy,
            w * qy - x * qz + y * qw + z * qx,
            w * qz + x * qy - y * qx + z * qw,
            w * qw - x * qx - y * qy - z * qz,
        )
        return turned + self.translation_m, np.stack(quaternions, axis=-1)


def at_part(trajectory: Trajectory, part_pose: Sequence[float], frame_id: str) -> Trajectory:
    """A motion in the frame of the part, which stands at ``part_pose`` in that of the poses."""
    return moved(trajectory, Rigid.of(part_pose).inverse(), frame_id)


def moved(trajectory: Trajectory, transform: Rigid, frame_id: str) -> Trajectory:
    """A motion after a transform that brings its poses into a frame of that name."""
    positions, quaternions = transform.applied(trajectory.positions_m, trajectory.quaternions_xyzw)
    return replace(
        trajectory, positions_m=positions, quaternions_xyzw=quaternions, frame_id=frame_id
    )


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
    if len(names) < 3:
        raise RecordingError(
            f'{len(names)} points in common ({" ".join(names) or "none"}); touched are '
            f'{" ".join(touched_m)}, listed are {" ".join(points_m)}; give three or more that '
            'have the same names'
        )
    touched = np.array([touched_m[name] for name in names])
    points = np.array([points_m[name] for name in names])
    for what, positions in (('touched', touched), ('listed', points)):
        spread = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
        # Points nearer to a line than this share of their spread leave the turn about it open.
        if not spread[1] > 0.03 * spread[0]:
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
    # A misfit above this is warned of [m].
    if rms > 0.002:
        worst = names[int(np.argmax(apart))]
        warnings = (
            f'the points do not fit, {worst} is off by {apart.max() * 1e3:.1f} mm: touch it '
            'again, and check its name, the units of both tables and that both frames are '
            'right-handed',
        )
    return PartPlace(pose, rms, dict(zip(names, apart.tolist(), strict=True)), warnings)
