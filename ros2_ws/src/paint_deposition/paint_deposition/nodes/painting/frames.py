"""Transforming poses into the frame of the part."""

import contextlib
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped, TransformStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.time import Time

from paint_deposition.motion.part_frame import PART_POSE_TOPIC, Rigid, is_frame
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.messages import header

FRAME_REMEDY = 'set part_pose and part_parent_frame, or frame_id'
# Transforms, static ones at the start included, may arrive later than the poses. One that is still
# missing after so long is not waited for any longer.
TF_TIMEOUT_S = 0.5
MAX_WAITING = 5000


class NoTransform(Exception):
    """There is no transform for a pose, though with `may_come` there may be one later."""

    def __init__(self, reason: str, may_come: bool = False) -> None:
        super().__init__(reason)
        self.may_come = may_come


class PartFrame:
    """The frame of the part, and the transforms into it.

    They come from the parameter `part_pose` or from tf2, where it is installed. A pose without a
    frame is taken to be in that of the part.
    """

    def __init__(self, node: Node, frame_id: str) -> None:
        self.frame_id = frame_id.lstrip('/')
        self._parent = ''
        self._from_parent: Rigid | None = None
        self._node = node
        self._publisher: Publisher | None = None
        # None where tf2 is not installed.
        self._buffer: Any = None
        with contextlib.suppress(ImportError):
            import tf2_ros

            self._buffer = tf2_ros.Buffer(node=node)
            self._buffer.listener = tf2_ros.TransformListener(self._buffer, node)

    def set_part_pose(self, parent_frame: str, part_pose: Sequence[float]) -> None:
        """Set the part's pose [x y z qx qy qz qw] in another frame, [] for none.

        It is published on `part_pose`, so that recordings contain it.
        """
        self.take_part_pose(parent_frame, part_pose)
        if self._from_parent is None:
            return
        if self._publisher is None:
            self._publisher = self._node.create_publisher(
                TransformStamped, PART_POSE_TOPIC, topics.LATCHED
            )
        placed = TransformStamped(child_frame_id=self.frame_id)
        placed.header = header(self._parent, self._node.get_clock().now().nanoseconds)
        t, q = placed.transform.translation, placed.transform.rotation
        t.x, t.y, t.z, q.x, q.y, q.z, q.w = Rigid.of(part_pose).values
        self._publisher.publish(placed)

    def take_part_pose(self, parent_frame: str, part_pose: Sequence[float]) -> None:
        """The same as another node has published it."""
        self._parent = parent_frame.lstrip('/')
        self._from_parent = Rigid.of(part_pose).inverse() if len(part_pose) else None

    def is_own(self, frame_id: str) -> bool:
        """Whether poses in this frame need no transform."""
        return is_frame(frame_id, self.frame_id)

    def lookup_transform(self, frame_id: str, stamp_ns: int) -> Rigid:
        """The transform from another frame into the part's at that time.

        Raises:
            NoTransform: there is none, or none yet.
        """
        if self._from_parent is not None and frame_id.lstrip('/') == self._parent:
            return self._from_parent
        if self._buffer is None:
            raise NoTransform(f'no transform between them is known; {FRAME_REMEDY}')
        import tf2_ros

        try:
            found = self._buffer.lookup_transform(
                self.frame_id, frame_id.lstrip('/'), Time(nanoseconds=stamp_ns)
            )
        except tf2_ros.TransformException as error:
            words = ' '.join(str(error).split())
            reason = f'tf knows no transform between them ({words}); {FRAME_REMEDY}'
            if isinstance(error, tf2_ros.ExtrapolationException):
                reason = (
                    f'tf does not cover the time of the poses ({words}); publish it by the same '
                    'clock as the poses'
                )
            raise NoTransform(reason, may_come=True) from None
        t, q = found.transform.translation, found.transform.rotation
        return Rigid.of([t.x, t.y, t.z, q.x, q.y, q.z, q.w])


class TfQueue:
    """Poses that wait, in order, for their transform; as tf2's MessageFilter does.

    A pose without a transform delays all behind it. It is rejected if the transform cannot come
    any more, after `TF_TIMEOUT_S`, or if more than `MAX_WAITING` poses wait. Times are
    monotonic seconds.

    Args:
        transform: transforms a pose and passes it on, or raises NoTransform.
        reject: called with the poses that are rejected, and why.
    """

    def __init__(
        self,
        transform: Callable[[PoseStamped], None],
        reject: Callable[[PoseStamped, NoTransform], None],
    ) -> None:
        self._transform, self._reject = transform, reject
        self._waiting: deque[tuple[float, PoseStamped]] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, pose: PoseStamped, now_s: float) -> None:
        """Queue a pose received now, and process the queue."""
        self._waiting.append((now_s, pose))
        self.process(now_s)

    def process(self, now_s: float) -> None:
        """Transform poses, from the oldest on, until one has to wait."""
        while self._waiting:
            since_s, pose = self._waiting[0]
            try:
                self._transform(pose)
            except NoTransform as missing:
                in_time = now_s - since_s < TF_TIMEOUT_S and len(self._waiting) <= MAX_WAITING
                if missing.may_come and in_time:
                    return
                self._reject(pose, missing)
            self._waiting.popleft()

    def clear(self) -> None:
        self._waiting.clear()
