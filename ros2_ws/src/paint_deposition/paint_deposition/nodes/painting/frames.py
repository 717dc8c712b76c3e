"""Poses in other frames than the part's are transformed where a transform is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import Pose
from rclpy.node import Node
from rclpy.time import Time

from paint_deposition.nodes.painting.tf_queue import NoTransform

GIVE_FRAMES = 'set part_pose and part_parent_frame, or frame_id'


@dataclass(frozen=True)
class Rigid:
    """A rotation (3, 3) with its quaternion (x, y, z, w), and then a translation (3,) [m]."""

    rotation: np.ndarray
    quaternion_xyzw: tuple[float, float, float, float]
    translation_m: np.ndarray

    @staticmethod
    def of(values: Sequence[float]) -> Rigid:
        """From [x y z qx qy qz qw]; the quaternion is normalised."""
        quaternion = np.asarray(values[3:], dtype=float)
        x, y, z, w = quaternion / np.linalg.norm(quaternion)
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return Rigid(rotation, (x, y, z, w), np.asarray(values[:3], dtype=float))

    def inverse(self) -> Rigid:
        """The inverse transform."""
        x, y, z, w = self.quaternion_xyzw
        back = self.rotation.T
        return Rigid(back, (-x, -y, -z, w), -back @ self.translation_m)

    def applied(self, pose: Pose) -> tuple[float, ...]:
        """The pose [x y z qx qy qz qw]; the norm of its quaternion stays as it is."""
        p, q = pose.position, pose.orientation
        position = self.rotation @ np.array([p.x, p.y, p.z]) + self.translation_m
        x, y, z, w = self.quaternion_xyzw
        return (
            *position.tolist(),
            w * q.x + x * q.w + y * q.z - z * q.y,
            w * q.y - x * q.z + y * q.w + z * q.x,
            w * q.z + x * q.y - y * q.x + z * q.w,
            w * q.w - x * q.x - y * q.y - z * q.z,
        )


class PartFrame:
    """Brings poses into the part's frame.

    Known are the part's own frame, the one in which its pose was given, and whatever tf2 knows,
    where tf2 is installed. A pose without any frame is taken to be in the part's.

    Args:
        node: for tf2.
        frame_id: the part's frame.
    """

    def __init__(self, node: Node, frame_id: str) -> None:
        self.frame_id = frame_id.lstrip('/')
        self._parent = ''
        self._from_parent: Rigid | None = None
        self._buffer = _transform_buffer(node)

    def place(self, parent_frame: str, part_pose: Sequence[float]) -> None:
        """Say where the part is: its pose [x y z qx qy qz qw] in another frame, or [] for none."""
        self._parent = parent_frame.lstrip('/')
        self._from_parent = Rigid.of(part_pose).inverse() if len(part_pose) else None

    def is_own(self, frame_id: str) -> bool:
        """Whether a pose in this frame can be taken as it is."""
        return frame_id in ('', self.frame_id) or frame_id.lstrip('/') == self.frame_id

    def transform_from(self, frame_id: str, stamp_ns: int) -> Rigid:
        """The transform from another frame at that time.

        Raises:
            NoTransform: there is none, or none yet.
        """
        if self._from_parent is not None and frame_id.lstrip('/') == self._parent:
            return self._from_parent
        if self._buffer is None:
            raise NoTransform(f'no transform between them is known; {GIVE_FRAMES}')
        import tf2_ros

        try:
            found = self._buffer.lookup_transform(
                self.frame_id, frame_id.lstrip('/'), Time(nanoseconds=stamp_ns)
            )
        except tf2_ros.ExtrapolationException as error:
            reason = f'tf does not cover the time of the poses ({_one_line(error)}); publish it '
            raise NoTransform(reason + 'by the same clock as the poses', may_come=True) from None
        except tf2_ros.TransformException as error:
            reason = f'tf knows no transform between them ({_one_line(error)}); {GIVE_FRAMES}'
            raise NoTransform(reason, may_come=True) from None
        t, q = found.transform.translation, found.transform.rotation
        return Rigid.of([t.x, t.y, t.z, q.x, q.y, q.z, q.w])


def _one_line(error: Exception) -> str:
    return ' '.join(str(error).split())


def _transform_buffer(node: Node) -> Any:
    """A buffer that listens to tf, None where tf2 is not installed."""
    try:
        import tf2_ros
    except ImportError:
        return None
    buffer = tf2_ros.Buffer(node=node)
    buffer.listener = tf2_ros.TransformListener(buffer, node)
    return buffer
