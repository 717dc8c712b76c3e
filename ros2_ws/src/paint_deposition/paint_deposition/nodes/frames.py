"""Poses by way of frames: into that of the part, and of the tip of a robot."""

import contextlib
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped
from rclpy.publisher import Publisher

from paint_deposition.errors import PaintError, did_you_mean
from paint_deposition.files.recordings.messages import pose_of, stamp_ns, transforms_of
from paint_deposition.motion.transforms import (
    LONGEST_GAP_NS,
    PART_POSE_TOPIC,
    FrameTree,
    NoTransform,
    Rigid,
    is_frame,
)
from paint_deposition.nodes import topics
from paint_deposition.nodes.node import ERROR, OK, WARN, PaintNode, Status
from paint_deposition.nodes.topics import AdaptiveSubscription, part_pose_message

# Transforms, static ones at the start included, may arrive later than the poses. One that is still
# missing after so long is not waited for any longer.
TF_TIMEOUT_S = 1e-9 * LONGEST_GAP_NS
# Position (3,) [m] and quaternion (4,).
Place = tuple[np.ndarray, np.ndarray]
# Poses that wait, in order, for their transform, and since when [monotonic s].
TfQueue = deque[tuple[float, PoseStamped]]
# (stamp [ns], pose of the tip, when it was sent [ns] or 0)
TakePose = Callable[[int, Rigid, int], None]
# Without poses or transforms for so long, that is reported.
SILENT_S = 2.0
# Deep queues that are emptied before poses are judged: a busy node has its transforms.
QUEUE_DEPTH = 5000


def subscribe_to_tf(
    node: PaintNode, tree: FrameTree, take: Callable[[Any, Any], None], polled: bool = True
) -> list[AdaptiveSubscription]:
    """Have static transforms fixed in a tree, and moving ones taken; ImportError: no tf2_msgs."""
    from tf2_msgs.msg import TFMessage

    def take_static(message: Any, _info: Any) -> None:
        for child, parent, _, pose in transforms_of(message.transforms):
            tree.fix(child, parent, pose)

    subscribe = partial(AdaptiveSubscription, node, TFMessage, depth=QUEUE_DEPTH, polled=polled)
    return [subscribe('/tf_static', take_static, latched=True), subscribe('/tf', take)]


class PartFrame:
    """The frame of the part, and the transforms into it.

    They come from the parameter `part_pose`, and from tf where its messages are installed. A pose
    without a frame is taken to be in that of the part.

    Attributes:
        frame_id: of the part; tree: the transforms that are known.
        tf_topics: the subscriptions to tf, which are polled; none where its messages are not
            installed.
    """

    def __init__(self, node: PaintNode, frame_id: str) -> None:
        self.frame_id = frame_id.lstrip('/')
        self._node = node
        self._publisher: Publisher | None = None
        self.tree = FrameTree(live=True)
        self.tf_topics: list[AdaptiveSubscription] = []
        with contextlib.suppress(ImportError):
            self.tf_topics = subscribe_to_tf(node, self.tree, self._take)

    def _take(self, message: Any, _info: Any) -> None:
        for transform in transforms_of(message.transforms):
            self.tree.add(*transform)

    def set_part_pose(self, parent_frame: str, part_pose: Sequence[float]) -> None:
        """Set the part's pose [x y z qx qy qz qw] in another frame, [] for none.

        It is published on `part_pose`, so that recordings contain it.
        """
        # As it is published, and so recorded: to the last bit.
        place = Rigid.of(part_pose).values if len(part_pose) else ()
        self.tree.place(self.frame_id, parent_frame, place)
        # A recorder hears of it before there is a pose, which is then in the run of its part.
        if parent_frame and self._publisher is None:
            self._publisher = self._node.create_publisher(
                TransformStamped, PART_POSE_TOPIC, topics.LATCHED
            )
        if not (place and self._publisher):
            return
        now_ns = self._node.get_clock().now().nanoseconds
        self._publisher.publish(part_pose_message(parent_frame, self.frame_id, now_ns, place))

    def on_part(self, message: PoseStamped) -> Place:
        """A pose in the frame of the part.

        Raises:
            NoTransform: there is none from its frame, or none yet.
        """
        pose, frame_id = pose_of(message.pose), message.header.frame_id
        if is_frame(frame_id, self.frame_id):
            return pose
        try:
            into_part = self.tree.lookup(frame_id, self.frame_id, stamp_ns(message.header))
        except NoTransform as missing:
            is_connected = self.tree.moving_between(frame_id, self.frame_id) is not None
            remedy = 'set part_pose and part_parent_frame, or frame_id'
            if is_connected:
                remedy = 'publish tf without gaps and by the clock of the poses'
            may_come = missing.may_come and bool(self.tf_topics)
            raise NoTransform(f'{missing}; {remedy}', may_come) from None
        return into_part.applied(*pose)

    def placed_in_order(
        self, waiting: TfQueue
    ) -> Iterator[tuple[PoseStamped, Place | NoTransform]]:
        """Take poses from a queue, the oldest first, until one has to wait for its transform.

        As in tf2's MessageFilter, it delays all behind it. It is given up if the transform cannot
        come any more, after `TF_TIMEOUT_S`, or if more than 5000 poses wait.

        Yields:
            Each pose, and its place or why it has none.
        """
        now_s = time.monotonic()
        while waiting:
            since_s, pose = waiting[0]
            placed: Place | NoTransform
            try:
                placed = self.on_part(pose)
            except NoTransform as missing:
                in_time = now_s - since_s < TF_TIMEOUT_S and len(waiting) <= 5000
                if missing.may_come and in_time:
                    return
                placed = missing
            waiting.popleft()
            yield pose, placed


class TfPoses:
    """Looks up the pose of frame `tip` in `base` at each stamp of a moving transform between them.

    A pose waits until all transforms between the frames are known at its time or later;
    those with other stamps are interpolated.

    Args:
        node: subscribes to tf.
        base, tip: names of the frames.
        take_pose: called with each pose, in the order of the stamps.

    Attributes:
        topics: the subscriptions, whose quality of service the node matches now and then.

    Raises:
        PaintError: tf2_msgs is not installed.
    """

    def __init__(self, node: PaintNode, base: str, tip: str, take_pose: TakePose) -> None:
        self.base, self.tip = base.lstrip('/'), tip.lstrip('/')
        self._take_pose = take_pose
        self._tree = FrameTree(live=True)
        # (stamp, child frame) of the moving transforms whose poses are not published yet.
        self._waiting: deque[tuple[int, str]] = deque(maxlen=QUEUE_DEPTH)
        self._published_ns = 0
        self._failed_lookups = 0
        self._received_s = time.monotonic()
        try:
            self.topics = subscribe_to_tf(node, self._tree, self._take, polled=False)
        except ImportError:
            raise PaintError(
                f'{node.get_name()}: poses from tf need tf2_msgs, which is not installed; install '
                'it from your ROS distribution, or give urdf_file'
            ) from None

    def _take(self, message: Any, info: Mapping[str, Any]) -> None:
        """Take moving transforms, and look up the poses that all transforms are now known for."""
        for child, parent, stamp, pose in transforms_of(message.transforms):
            stamps = [stamp]
            if self._tree.add(child, parent, stamp, pose):
                # The first of the restarted stream could have been a late one.
                stamps = self._tree.stamps_ns(child)
                self._waiting.clear()
                self._published_ns = 0
            self._waiting.extend((at_ns, child) for at_ns in stamps)
        moving = self._moving
        if not moving:
            return
        known_ns = min(map(self._tree.newest_ns, moving))
        relevant = [(at_ns, child) for at_ns, child in self._waiting if child in moving]
        later = [(at_ns, child) for at_ns, child in relevant if at_ns > known_ns]
        self._waiting = deque(later, maxlen=QUEUE_DEPTH)
        due = {at_ns for at_ns, _ in relevant if self._published_ns < at_ns <= known_ns}
        for stamp in sorted(due):
            self._published_ns = stamp
            try:
                found = self._tree.lookup(self.tip, self.base, stamp)
            except NoTransform:
                self._failed_lookups += 1
                continue
            self._received_s = time.monotonic()
            self._take_pose(stamp, found, info['source_timestamp'])

    @property
    def _moving(self) -> set[str]:
        """Frames between tip and base that move in their parents; none if not connected."""
        return self._tree.moving_between(self.tip, self.base, self._published_ns) or set()

    def status(self) -> Status:
        """Whether tf connects tip and base, and transforms arrive."""
        frames = self._tree.names
        values = {
            'frames': ' '.join(frames) or 'none',
            'moving frames between tip and base': ' '.join(sorted(self._moving)) or 'none',
            'failed lookups': self._failed_lookups,
        }
        if not frames:
            return WARN, 'no transforms on /tf', values
        for name in (self.tip, self.base):
            if name not in frames:
                known = did_you_mean(name, frames)
                return ERROR, f"tf has no frame '{name}'; {known}", values
        if not self._moving:
            reason = f"no moving transforms connect '{self.tip}' to '{self.base}'"
            return ERROR, reason, values
        if time.monotonic() - self._received_s > SILENT_S:
            return WARN, 'no new transforms of the robot on /tf', values
        return OK, 'following the robot', values
