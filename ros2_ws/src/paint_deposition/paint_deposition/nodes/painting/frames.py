"""Transforming poses into the frame of the part."""

import contextlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped
from rclpy.publisher import Publisher

from paint_deposition.files.recordings.messages import pose_of, stamp_ns, transforms_of
from paint_deposition.motion.transforms import (
    LONGEST_GAP_NS,
    PART_POSE_TOPIC,
    FrameTree,
    NoTransform,
    Rigid,
    is_frame,
)
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.node import PaintNode
from paint_deposition.nodes.runtime.topics import AdaptiveSubscription, header

# Transforms, static ones at the start included, may arrive later than the poses. One that is still
# missing after so long is not waited for any longer.
TF_TIMEOUT_S = 1e-9 * LONGEST_GAP_NS
# Position (3,) [m] and quaternion (4,).
Place = tuple[np.ndarray, np.ndarray]


class PartFrame:
    """The frame of the part, and the transforms into it.

    They come from the parameter `part_pose`, and from tf where its messages are installed. A pose
    without a frame is taken to be in that of the part.
    """

    def __init__(self, node: PaintNode, frame_id: str) -> None:
        self.frame_id = frame_id.lstrip('/')
        self._node = node
        self._publisher: Publisher | None = None
        self._tree = FrameTree(live=True)
        # None where the messages of tf are not installed.
        self.tf_topics: list[AdaptiveSubscription] = []
        with contextlib.suppress(ImportError):
            from tf2_msgs.msg import TFMessage

            # Deep queues that are emptied before poses are judged: a busy node has its transforms.
            subscribe = partial(AdaptiveSubscription, node, TFMessage, depth=5000)
            self.tf_topics = [
                subscribe('/tf_static', self._take_static, latched=True),
                subscribe('/tf', self._take),
            ]

    def take_pending(self) -> None:
        """Take the transforms in the queues."""
        for topic in self.tf_topics:
            topic.take_pending()

    def _take_static(self, message: Any, _info: Any) -> None:
        for child, parent, _, pose in transforms_of(message):
            self._tree.fix(child, parent, pose)

    def _take(self, message: Any, _info: Any) -> None:
        for transform in transforms_of(message):
            self._tree.add(*transform)

    def set_part_pose(self, parent_frame: str, part_pose: Sequence[float]) -> None:
        """Set the part's pose [x y z qx qy qz qw] in another frame, [] for none.

        It is published on `part_pose`, so that recordings contain it.
        """
        # As it is published, and so recorded: to the last bit.
        place = Rigid.of(part_pose).values if len(part_pose) else ()
        self.take_part_pose(parent_frame, place)
        # A recorder hears of it before there is a pose, which is then in the run of its part.
        if parent_frame and self._publisher is None:
            self._publisher = self._node.create_publisher(
                TransformStamped, PART_POSE_TOPIC, topics.LATCHED
            )
        if not (place and self._publisher):
            return
        placed = TransformStamped(child_frame_id=self.frame_id)
        placed.header = header(parent_frame.lstrip('/'), self._node.get_clock().now().nanoseconds)
        t, q = placed.transform.translation, placed.transform.rotation
        t.x, t.y, t.z, q.x, q.y, q.z, q.w = place
        self._publisher.publish(placed)

    def take_part_pose(self, parent_frame: str, part_pose: Sequence[float]) -> None:
        """The same as another node has published it."""
        self._tree.place(self.frame_id, parent_frame, part_pose)

    def on_part(self, message: PoseStamped) -> Place:
        """A pose in the frame of the part.

        Raises:
            NoTransform: there is none from its frame, or none yet.
        """
        pose, frame_id = pose_of(message.pose), message.header.frame_id
        if is_frame(frame_id, self.frame_id):
            return pose
        try:
            into_part = self._tree.lookup(frame_id, self.frame_id, stamp_ns(message.header))
        except NoTransform as missing:
            is_connected = self._tree.moving_between(frame_id, self.frame_id) is not None
            remedy = 'set part_pose and part_parent_frame, or frame_id'
            if is_connected:
                remedy = 'publish tf without gaps and by the clock of the poses'
            may_come = missing.may_come and bool(self.tf_topics)
            raise NoTransform(f'{missing}; {remedy}', may_come) from None
        return into_part.applied(*pose)


# Poses that wait, in order, for their transform, and since when [monotonic s].
TfQueue = deque[tuple[float, PoseStamped]]


def placed_in_order(
    waiting: TfQueue, place: Callable[[PoseStamped], Place], now_s: float
) -> Iterator[tuple[PoseStamped, Place | NoTransform]]:
    """Take poses from a queue, the oldest first, until one has to wait for its transform.

    As in tf2's MessageFilter, it delays all behind it. It is given up if the transform cannot come
    any more, after `TF_TIMEOUT_S`, or if more than 5000 poses wait.

    Yields:
        Each pose, and its place or why it has none.
    """
    while waiting:
        since_s, pose = waiting[0]
        placed: Place | NoTransform
        try:
            placed = place(pose)
        except NoTransform as missing:
            in_time = now_s - since_s < TF_TIMEOUT_S and len(waiting) <= 5000
            if missing.may_come and in_time:
                return
            placed = missing
        waiting.popleft()
        yield pose, placed
