"""What a node takes from the cell: poses and states of the atomizer, in batches."""

from __future__ import annotations

import time
from typing import Protocol

import numpy as np
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState, PoseProgress
from rclpy.qos import ReliabilityPolicy

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.bags import stamp_ns
from paint_deposition.motion.intervals import Intervals
from paint_deposition.motion.motion_log import PoseBatch, TriggerChange
from paint_deposition.motion.trigger import relative_flow
from paint_deposition.nodes.painting.frames import PartFrame
from paint_deposition.nodes.painting.tf_queue import NoTransform, TfQueue
from paint_deposition.nodes.runtime import qos
from paint_deposition.nodes.runtime.messages import PROGRESS_TOPIC
from paint_deposition.nodes.runtime.paint_node import PaintNode
from paint_deposition.nodes.runtime.qos_watch import QosWatch

POSES_A_BATCH = 50
BATCH_PERIOD_S = 0.05
PROGRESS_PERIOD_S = 0.2


class MotionReceiver(Protocol):
    """Whatever the poses and trigger changes are handed to."""

    def add_poses(self, batch: PoseBatch) -> None: ...

    def add_trigger(self, change: TriggerChange) -> None: ...


class AtomizerInput:
    """Takes `atomizer/pose` and `atomizer/state`, and reports on `atomizer/progress`.

    Poses are handed on in batches of fifty, and what there is of them every twentieth of a
    second; a state is handed on at once, so that it is there before the poses that it may cut.

    Attributes:
        poses_received: since the node started.
        refused_frames: poses refused for their frame, by frame, since the last reset.
        without_frame: poses that name no frame, since the last reset.
        refusal: why the last refused pose was refused, '' if none was since the last reset.
        refused_states: states that say no time or no possible flow, since the last reset.
        intervals: rhythm of the stamps since the last reset.
    """

    def __init__(
        self,
        node: PaintNode,
        frame: PartFrame,
        receiver: MotionReceiver,
        watch: QosWatch,
    ) -> None:
        self._node, self._frame, self._receiver = node, frame, receiver
        self.poses_received = 0
        self._newest: PoseStamped | None = None
        self._stamps: list[int] = []
        self._poses: list[tuple[float, ...]] = []
        self._tf_queue = TfQueue()
        self.reset()
        profile = qos.poses(node.values['pose_queue_depth'])
        if node.values['pose_reliability'] == 'reliable':
            profile.reliability = ReliabilityPolicy.RELIABLE
        for message, topic, take in (
            (PoseStamped, 'atomizer/pose', self._take_pose),
            (AtomizerState, 'atomizer/state', self._take_state),
        ):
            watch.subscription(message, topic, take, profile)
        self._progress = node.create_publisher(PoseProgress, PROGRESS_TOPIC, qos.PROGRESS)
        node.create_steady_timer(BATCH_PERIOD_S, self.hand_on)
        node.create_steady_timer(PROGRESS_PERIOD_S, self._report_progress)

    @property
    def poses_refused(self) -> int:
        """Poses refused for their frame since the last reset."""
        return sum(self.refused_frames.values())

    def reset(self) -> None:
        """Count from zero; poses that were not handed on yet are dropped."""
        self.refused_frames: dict[str, int] = {}
        self.refusal = ''
        self.refused_states = 0
        self.without_frame = 0
        self.intervals = Intervals()
        self._tf_queue.clear()
        self._stamps.clear()
        self._poses.clear()

    @property
    def poses_in_tf_queue(self) -> int:
        """Poses that wait for their transform."""
        return len(self._tf_queue)

    def hand_on(self) -> None:
        """Give the receiver what has come, except poses that wait for their transform."""
        self._tf_queue.release(time.monotonic(), self._place, self._refuse)
        if not self._stamps:
            return
        stamps, poses = np.array(self._stamps, dtype=np.int64), np.array(self._poses)
        self._stamps.clear()
        self._poses.clear()
        self.intervals.add(stamps)
        self._receiver.add_poses(
            PoseBatch(
                stamps, np.ascontiguousarray(poses[:, :3]), np.ascontiguousarray(poses[:, 3:])
            )
        )

    def _take_pose(self, message: PoseStamped) -> None:
        self.poses_received += 1
        self._newest = message
        now_s = time.monotonic()
        self._tf_queue.add(message, now_s)
        self._tf_queue.release(now_s, self._place, self._refuse)
        if len(self._stamps) >= POSES_A_BATCH:
            self.hand_on()
        if self.poses_received % POSES_A_BATCH == 0:
            self._report_progress()

    def _place(self, message: PoseStamped) -> None:
        frame_id = message.header.frame_id
        stamp = stamp_ns(message.header)
        if self._frame.is_own(frame_id):
            p, q = message.pose.position, message.pose.orientation
            pose: tuple[float, ...] = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
            self.without_frame += not frame_id
        else:
            pose = self._frame.transform_from(frame_id, stamp).applied(message.pose)
        self._stamps.append(stamp)
        self._poses.append(pose)

    def _refuse(self, message: PoseStamped, missing: NoTransform) -> None:
        frame_id = message.header.frame_id
        self.refusal = str(missing)
        if frame_id not in self.refused_frames:
            self._node.get_logger().error(
                f"poses in frame '{frame_id}' are refused: the mesh is in frame "
                f"'{self._frame.frame_id}' and {missing}"
            )
        self.refused_frames[frame_id] = self.refused_frames.get(frame_id, 0) + 1

    def _take_state(self, message: AtomizerState) -> None:
        stamp = stamp_ns(message.header)
        try:
            if stamp == 0:
                raise RecordingError('atomizer state without a stamp: stamp each state')
            flow = relative_flow(message.spraying, message.flow)
        except RecordingError as error:
            if not self.refused_states:
                self._node.get_logger().error(f'atomizer/state refused: {error}')
            self.refused_states += 1
            return
        self._receiver.add_trigger(TriggerChange(stamp, flow))

    def _report_progress(self) -> None:
        message = PoseProgress(poses_received=self.poses_received)
        if self._newest is not None:
            message.header = self._newest.header
        self._progress.publish(message)
