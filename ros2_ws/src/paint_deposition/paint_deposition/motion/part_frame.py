"""The part in the frame of the poses, and rigid transforms."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.motion.trajectory import Trajectory

# RAPID writes quaternions with four digits; further off is damage, not rounding.
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
