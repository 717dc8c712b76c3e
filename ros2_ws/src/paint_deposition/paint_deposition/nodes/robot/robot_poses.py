"""The pose of a robot's tip, from its joint states or from tf."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from sensor_msgs.msg import JointState

from paint_deposition.errors import PaintError, RecordingError, did_you_mean
from paint_deposition.files.recordings.joint_states import Robot
from paint_deposition.files.recordings.messages import stamp_ns, transforms_of
from paint_deposition.motion.transforms import FrameTree, NoTransform, Rigid
from paint_deposition.nodes.runtime.node import ERROR, OK, WARN, PaintNode, Status
from paint_deposition.nodes.runtime.topics import AdaptiveSubscription

# (stamp [ns], pose of the tip, when it was sent [ns] or 0)
TakePose = Callable[[int, Rigid, int], None]
SILENT_S = 2.0
QUEUE_DEPTH = 5000


class JointPoses:
    """Computes the pose of link `tip` in `base` from each joint state, which needs all joints.

    `topic` is that of the joint states, for messages; `take_pose` is called with each pose.
    """

    def __init__(self, robot: Robot, topic: str, take_pose: TakePose) -> None:
        self.base, self.tip = robot.base, robot.tip
        self._robot, self._topic, self._take_pose = robot, topic, take_pose
        self._poses = self._incomplete = 0
        self._refusal = ''
        self._received_s = time.monotonic()

    def take(self, _topic: str, message: JointState, info: Mapping[str, Any]) -> None:
        """Compute the pose for a joint state; the callback of its subscription."""
        positions_by_name = dict(zip(message.name, message.position, strict=False))
        try:
            found = self._robot.recorded_joints(positions_by_name, self._topic)
            values = np.array([[found[name] for name in self._robot.moving_joints]])
            if not np.isfinite(values).all():
                raise RecordingError(f'{self._topic} has joints that are not finite')
            positions, quaternions = self._robot.poses(self._robot.in_si(values, self._topic))
        except RecordingError as error:
            self._incomplete, self._refusal = self._incomplete + 1, str(error)
            return
        self._received_s, self._refusal = time.monotonic(), ''
        tip = Rigid.of([*positions[0], *quaternions[0]])
        self._poses += 1
        self._take_pose(stamp_ns(message.header), tip, info['source_timestamp'])

    def status(self) -> Status:
        """Whether joint states arrive, and have all joints."""
        values = {'robot': self._robot.path, 'joint states refused': self._incomplete}
        if self._incomplete and not self._poses:
            return Status(ERROR, f'no joint state has all joints: {self._refusal}', values)
        if time.monotonic() - self._received_s > SILENT_S:
            if self._refusal:
                return Status(ERROR, f'joint states are refused: {self._refusal}', values)
            return Status(WARN, f'no joint states on {self._topic}', values)
        return Status(OK, 'following the robot', values)


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
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            raise PaintError(
                f'{node.get_name()}: poses from tf need tf2_msgs, which is not installed; install '
                'it from your ROS distribution, or give urdf_file'
            ) from None
        self.base, self.tip = base.lstrip('/'), tip.lstrip('/')
        self._take_pose = take_pose
        self._tree = FrameTree(live=True)
        # (stamp, child frame) of the moving transforms whose poses are not published yet.
        self._waiting: deque[tuple[int, str]] = deque(maxlen=QUEUE_DEPTH)
        self._published_ns = 0
        self._failed_lookups = 0
        self._received_s = time.monotonic()
        subscribe = partial(AdaptiveSubscription, node, TFMessage, depth=QUEUE_DEPTH, polled=False)
        self.topics = [
            subscribe('/tf_static', self._take_static, latched=True),
            subscribe('/tf', self._take),
        ]

    def _take_static(self, message: Any, _info: Mapping[str, Any]) -> None:
        for child, parent, _, pose in transforms_of(message):
            self._tree.fix(child, parent, pose)

    def _take(self, message: Any, info: Mapping[str, Any]) -> None:
        """Take moving transforms, and look up the poses that all transforms are now known for."""
        for child, parent, stamp, pose in transforms_of(message):
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
            return Status(WARN, 'no transforms on /tf', values)
        for name in (self.tip, self.base):
            if name not in frames:
                known = did_you_mean(name, frames)
                return Status(ERROR, f"tf has no frame '{name}'; {known}", values)
        if not self._moving:
            reason = f"no moving transforms connect '{self.tip}' to '{self.base}'"
            return Status(ERROR, reason, values)
        if time.monotonic() - self._received_s > SILENT_S:
            return Status(WARN, 'no new transforms of the robot on /tf', values)
        return Status(OK, 'following the robot', values)
