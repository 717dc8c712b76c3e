"""Poses in other frames than the part's are transformed where a transform is known."""

from __future__ import annotations

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

GIVE_FRAMES = 'set part_pose and part_parent_frame, or frame_id'
# A transform comes on another topic than the poses and is often some milliseconds late, a static
# one a little after the start; one that is not there after so long will not come.
TIMEOUT_S = 0.5
LONGEST = 5000


class NoTransform(Exception):
    """There is no transform for a pose; `may_come` says whether waiting can help."""

    def __init__(self, reason: str, may_come: bool = False) -> None:
        super().__init__(reason)
        self.may_come = may_come


class PartFrame:
    """Brings poses into the part's frame.

    Known are the part's own frame, the one in which its pose was given, and whatever tf2 knows,
    where tf2 is installed. A pose without any frame is taken to be in the part's.
    """

    def __init__(self, node: Node, frame_id: str) -> None:
        self.frame_id = frame_id.lstrip('/')
        self._parent = ''
        self._from_parent: Rigid | None = None
        self._node = node
        self._publisher: Publisher | None = None
        # What listens to tf, where tf2 is installed.
        self._buffer: Any = None
        with contextlib.suppress(ImportError):
            import tf2_ros

            self._buffer = tf2_ros.Buffer(node=node)
            self._buffer.listener = tf2_ros.TransformListener(self._buffer, node)

    def place(self, parent_frame: str, part_pose: Sequence[float]) -> None:
        """Set the part's pose [x y z qx qy qz qw] in another frame, [] for none.

        It is published on `part_pose`, so that a recording can be used without the node.
        """
        self._parent = parent_frame.lstrip('/')
        self._from_parent = Rigid.of(part_pose).inverse() if len(part_pose) else None
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
        except tf2_ros.TransformException as error:
            words = ' '.join(str(error).split())
            reason = f'tf knows no transform between them ({words}); {GIVE_FRAMES}'
            if isinstance(error, tf2_ros.ExtrapolationException):
                reason = (
                    f'tf does not cover the time of the poses ({words}); publish it by the same '
                    'clock as the poses'
                )
            raise NoTransform(reason, may_come=True) from None
        t, q = found.transform.translation, found.transform.rotation
        return Rigid.of([t.x, t.y, t.z, q.x, q.y, q.z, q.w])


class TfQueue:
    """A queue of poses that leave it in the order in which they came, at most `TIMEOUT_S` late.

    A pose without a transform holds back all behind it. It is refused when its transform cannot
    come, has not come in time, or more than `LONGEST` poses wait. Times are monotonic seconds.

    Args:
        place: takes a pose, and raises NoTransform where that cannot be done yet.
        refuse: gets the others.
    """

    def __init__(
        self,
        place: Callable[[PoseStamped], None],
        refuse: Callable[[PoseStamped, NoTransform], None],
    ) -> None:
        self._place, self._refuse = place, refuse
        self._waiting: deque[tuple[float, PoseStamped]] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, pose: PoseStamped, now_s: float) -> None:
        """Queue a pose that came just now, and place what can be placed."""
        self._waiting.append((now_s, pose))
        self.release(now_s)

    def release(self, now_s: float) -> None:
        """Place what can be placed."""
        while self._waiting:
            since_s, pose = self._waiting[0]
            try:
                self._place(pose)
            except NoTransform as missing:
                in_time = now_s - since_s < TIMEOUT_S and len(self._waiting) <= LONGEST
                if missing.may_come and in_time:
                    return
                self._refuse(pose, missing)
            self._waiting.popleft()

    def clear(self) -> None:
        self._waiting.clear()
