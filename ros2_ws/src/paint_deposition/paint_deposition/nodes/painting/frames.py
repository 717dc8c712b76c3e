"""Poses in other frames than the part's are transformed where a transform is known."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.time import Time
from std_msgs.msg import Header

from paint_deposition.motion.part_frame import PART_POSE_TOPIC, Rigid, is_frame
from paint_deposition.nodes.runtime import topics

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
        self._buffer = _transform_buffer(node)

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
        x, y, z, *quaternion = Rigid.of(part_pose).values
        self._publisher.publish(
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
        except tf2_ros.TransformException as error:
            words = ' '.join(str(error).split())
            if isinstance(error, tf2_ros.ExtrapolationException):
                reason = (
                    f'tf does not cover the time of the poses ({words}); publish it by the same '
                    'clock as the poses'
                )
            else:
                reason = f'tf knows no transform between them ({words}); {GIVE_FRAMES}'
            raise NoTransform(reason, may_come=True) from None
        t, q = found.transform.translation, found.transform.rotation
        return Rigid.of([t.x, t.y, t.z, q.x, q.y, q.z, q.w])


def _transform_buffer(node: Node) -> Any:
    """A buffer that listens to tf, None where tf2 is not installed."""
    try:
        import tf2_ros
    except ImportError:
        return None
    buffer = tf2_ros.Buffer(node=node)
    buffer.listener = tf2_ros.TransformListener(buffer, node)
    return buffer


class TfQueue:
    """A queue of poses that leave it in the order in which they came, at most `TIMEOUT_S` late.

    A pose without a transform holds back all behind it. It is refused when its transform cannot
    come, has not come in time, or more than `LONGEST` poses wait.
    """

    def __init__(self) -> None:
        self._waiting: deque[tuple[float, PoseStamped]] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, pose: PoseStamped, now_s: float) -> None:
        """Queue a pose that came just now, in monotonic seconds."""
        self._waiting.append((now_s, pose))

    def release(
        self,
        now_s: float,
        place: Callable[[PoseStamped], None],
        refuse: Callable[[PoseStamped, NoTransform], None],
    ) -> None:
        """Place what can be placed; `place` raises NoTransform for what cannot be yet."""
        while self._waiting:
            since_s, pose = self._waiting[0]
            try:
                place(pose)
            except NoTransform as missing:
                in_time = now_s - since_s < TIMEOUT_S and len(self._waiting) <= LONGEST
                if missing.may_come and in_time:
                    return
                refuse(pose, missing)
            self._waiting.popleft()

    def clear(self) -> None:
        self._waiting.clear()
