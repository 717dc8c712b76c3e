"""Poses in other frames than the part's are transformed where a transform is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.time import Time
from std_msgs.msg import Header

from paint_deposition.motion.part_frame import PART_POSE_TOPIC, Rigid, is_frame
from paint_deposition.nodes.painting.tf_queue import NoTransform
from paint_deposition.nodes.runtime import qos

GIVE_FRAMES = 'set part_pose and part_parent_frame, or frame_id'


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
        self._node = node
        self._told: Publisher | None = None
        self._buffer = _transform_buffer(node)

    def place(self, parent_frame: str, part_pose: Sequence[float]) -> None:
        """Say where the part is: its pose [x y z qx qy qz qw] in another frame, or [] for none.

        A pose is published on `part_pose`, so that a recording of the run can be used without the
        node.
        """
        self._parent = parent_frame.lstrip('/')
        self._from_parent = Rigid.of(part_pose).inverse() if len(part_pose) else None
        if self._from_parent is None:
            return
        if self._told is None:
            self._told = self._node.create_publisher(
                TransformStamped, PART_POSE_TOPIC, qos.LATCHED
            )
        x, y, z, *quaternion = Rigid.of(part_pose).values
        self._told.publish(
            TransformStamped(
                header=Header(frame_id=self._parent, stamp=self._node.get_clock().now().to_msg()),
                child_frame_id=self.frame_id,
                transform=Transform(
                    translation=Vector3(x=x, y=y, z=z),
                    rotation=Quaternion(**dict(zip('xyzw', quaternion, strict=True))),
                ),
            )
        )

    def is_own(self, frame_id: str) -> bool:
        """Whether a pose in this frame can be taken as it is."""
        return is_frame(frame_id, self.frame_id)

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
