"""What a node takes from the cell: poses and states of the atomizer, in batches."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState, PoseProgress
from rclpy.qos import ReliabilityPolicy

from paint_deposition.errors import PaintError, RecordingError
from paint_deposition.files.recordings.headers import set_points_of, stamp_ns
from paint_deposition.motion.pose_stream import PoseBatch, TriggerChange
from paint_deposition.motion.stream_figures import Intervals, Jumps, SpeedNow
from paint_deposition.motion.trigger import SPRAYS_NOTHING, relative_flow
from paint_deposition.nodes.painting.atomizer_topic import AtomizerTopic
from paint_deposition.nodes.painting.tf_queue import NoTransform, TfQueue
from paint_deposition.nodes.runtime import qos
from paint_deposition.nodes.runtime.messages import PROGRESS_TOPIC, of_gun
from paint_deposition.nodes.runtime.qos_watch import endpoint_name

if TYPE_CHECKING:
    from paint_deposition.nodes.painting.painting_node import PaintingNode

POSE_TOPIC = 'atomizer/pose'
STATE_TOPIC = 'atomizer/state'
RELIABILITIES = {
    'as_offered': None,
    'best_effort': ReliabilityPolicy.BEST_EFFORT,
    'reliable': ReliabilityPolicy.RELIABLE,
}
FOLLOW_PERIOD_S = 0.1
# Messages are taken together: to wake for each pose would cost more than to paint it.
TAKE_PERIOD_S = 0.02
BATCH_PERIOD_S = 0.05
POSES_A_BATCH = 50
PROGRESS_PERIOD_S = 0.2


def several_guns(publishers: list[str]) -> str:
    """What it means that more than one publishes the poses."""
    return (
        f'{len(publishers)} publishers, {" and ".join(publishers)}: their poses are painted as '
        'the motion of one gun; give each gun a topic or a namespace of its own'
    )


class AtomizerInput:
    """Takes a gun's `atomizer/pose` and `atomizer/state`, and reports on `atomizer/progress`.

    The gun's name, if it has one, stands before the three topics: `robot_1/atomizer/pose`.

    Poses are handed on in batches of fifty or more, and what there is of them every twentieth of a
    second. States that have come are handed on first, so that they are there before the poses that
    they may cut.

    Args:
        node: paints the poses.
        number: of the gun among those of the node.
        name: of the gun, '' for the only one of a cell.

    Attributes:
        number, name: the same.
        poses_received: since the node started.
        refused_frames: poses refused for their frame, by frame, since the last reset.
        unpainted: poses that came while the node was not active, since the last reset.
        without_frame: poses that name no frame, since the last reset.
        refusal: why the last refused pose was refused, '' if none was since the last reset.
        states_received: since the node started.
        refused_s, pose_s: monotonic times of the last pose refused and of the last one taken.
        sprays: whether the newest state says that the gun sprays; False before any.
        refused_states: states that say no time, no possible flow or a brush that the model does
            not have, since the last reset.
        refusals_of_states: why, in words, each once.
        states_without_flow: states that spray with flow 0, since the last reset.
        intervals: rhythm of the stamps since the last reset.
        speed: of the TCP now.
        programmed_m_per_s: of the newest state, 0 or NaN where it is not known [m/s].
        jumps: steps between poses that no robot makes, since the last reset.
        pose_publishers: who publishes the poses now.
        tf_queue: poses that wait for their transform.
    """

    def __init__(self, node: PaintingNode, number: int, name: str) -> None:
        self._node = node
        self.number = number
        self.name = name
        self._pose_topic = of_gun(name, POSE_TOPIC)
        self._state_topic = of_gun(name, STATE_TOPIC)
        self.poses_received = self.states_received = 0
        self.refused_s = self.pose_s = -math.inf
        self.sprays = False
        self.speed = SpeedNow()
        self.programmed_m_per_s = 0.0
        self.pose_publishers: list[str] = []
        self._newest: PoseStamped | None = None
        self._handed_on_s = -math.inf
        self._stamps: list[int] = []
        self._poses: list[tuple[np.ndarray, np.ndarray]] = []
        self.tf_queue = TfQueue()
        self.reset()
        self._topics = [
            AtomizerTopic(
                node.watch,
                message,
                topic,
                take,
                depth=node.values['pose_queue_depth'],
                reliability=RELIABILITIES[node.values['pose_reliability']],
                # The last state holds until the next one, whenever it was published.
                latched=message is AtomizerState,
            )
            for message, topic, take in (
                (PoseStamped, self._pose_topic, self._take_pose),
                (AtomizerState, self._state_topic, self._take_state),
            )
        ]
        node.create_steady_timer(FOLLOW_PERIOD_S, self._follow_publishers)
        topic = of_gun(name, PROGRESS_TOPIC)
        self._progress = node.create_publisher(PoseProgress, topic, qos.PROGRESS)
        node.create_steady_timer(TAKE_PERIOD_S, self._take)
        node.create_steady_timer(PROGRESS_PERIOD_S, self._report_progress)

    @property
    def poses_refused(self) -> int:
        """Poses refused for their frame since the last reset."""
        return sum(self.refused_frames.values())

    def reset(self) -> None:
        """Count from zero; poses that were not handed on yet are dropped."""
        self.count_from_zero()
        self.tf_queue.clear()
        self._stamps.clear()
        self._poses.clear()

    def count_from_zero(self) -> None:
        """Forget what was wrong so far."""
        self.refused_frames: dict[str, int] = {}
        self.refusal = ''
        self.refused_states = 0
        self.refusals_of_states: set[str] = set()
        self.states_without_flow = 0
        self.without_frame = 0
        self.unpainted = 0
        self.intervals = Intervals()
        self.jumps = Jumps()

    def not_painted(self, poses: int) -> None:
        """Count poses that came while the node is not active."""
        if not self.unpainted:
            self._node.get_logger().warning(
                f'{self._pose_topic}: poses come and are not painted, because the node is inactive'
            )
        self.unpainted += poses

    def take_waiting(self) -> None:
        """Take all that has come so far and hand it on."""
        for topic in self._topics:
            topic.take_waiting()
        self.hand_on()

    def _take(self) -> None:
        for topic in self._topics:
            topic.take_waiting()
        waited = time.monotonic() - self._handed_on_s >= BATCH_PERIOD_S
        if waited or len(self._stamps) >= POSES_A_BATCH:
            self.hand_on()

    def hand_on(self) -> None:
        """Give the receiver what was taken, except poses that wait for their transform.

        What comes in the moment in which the node activates itself waits until it has.
        """
        self._handed_on_s = time.monotonic()
        self.tf_queue.release(time.monotonic(), self._place, self._refuse)
        if not self._stamps or self._node.starts_itself:
            return
        stamps = np.array(self._stamps, dtype=np.int64)
        positions, quaternions = map(np.array, zip(*self._poses, strict=True))
        self._stamps.clear()
        self._poses.clear()
        self.intervals.add(stamps)
        self.speed.add(stamps, positions)
        self._look_for_jumps(stamps, positions)
        self._node.add_poses(self.number, PoseBatch(stamps, positions, quaternions))

    def _look_for_jumps(self, stamps_ns: np.ndarray, positions_m: np.ndarray) -> None:
        known = self.jumps.count
        self.jumps.add(stamps_ns, positions_m)
        if self.jumps.count and not known:
            self._node.get_logger().error(
                f'{self._pose_topic}: the TCP would move at {self.jumps.fastest_m_per_s:.0f} m/s '
                'between two poses: do two guns publish here, or two clocks stamp the poses?'
            )

    def _follow_publishers(self) -> None:
        for topic in self._topics:
            topic.follow_publishers()
        publishers = sorted(
            endpoint_name(info) for info in self._node.watch.publishers_of(self._pose_topic)
        )
        if len(publishers) > max(1, len(self.pose_publishers)):
            self._node.get_logger().warning(f'{self._pose_topic}: {several_guns(publishers)}')
        self.pose_publishers = publishers

    def _take_pose(self, message: PoseStamped) -> None:
        self.poses_received += 1
        self._newest = message
        now_s = self.pose_s = time.monotonic()
        self.tf_queue.add(message, now_s)
        self.tf_queue.release(now_s, self._place, self._refuse)
        if self.poses_received % POSES_A_BATCH == 0:
            self._report_progress()

    def _place(self, message: PoseStamped) -> None:
        frame_id = message.header.frame_id
        stamp = stamp_ns(message.header)
        p, q = message.pose.position, message.pose.orientation
        pose = np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
        if self._node.frame.is_own(frame_id):
            self.without_frame += not frame_id
        else:
            pose = self._node.frame.transform_from(frame_id, stamp).applied(*pose)
        self._stamps.append(stamp)
        self._poses.append(pose)

    def _refuse(self, message: PoseStamped, missing: NoTransform) -> None:
        frame_id = message.header.frame_id
        self.refusal = str(missing)
        self.refused_s = time.monotonic()
        if frame_id not in self.refused_frames:
            self._node.get_logger().error(
                f"{self._pose_topic}: poses in frame '{frame_id}' are refused: the mesh is in "
                f"frame '{self._node.frame.frame_id}' and {missing}"
            )
        self.refused_frames[frame_id] = self.refused_frames.get(frame_id, 0) + 1

    def _take_state(self, message: AtomizerState) -> None:
        self.states_received += 1
        stamp = stamp_ns(message.header)
        try:
            if stamp == 0:
                raise RecordingError('atomizer state without a stamp: stamp each state')
            flow = relative_flow(message.spraying, message.flow)
            change = TriggerChange(stamp, flow, message.brush, set_points_of(message))
            self._node.add_trigger(self.number, change)
        except PaintError as error:
            if str(error) not in self.refusals_of_states:
                self._node.get_logger().error(f'{self._state_topic} refused: {error}')
            self.refusals_of_states.add(str(error))
            self.refused_states += 1
            return
        if message.spraying and flow == 0.0:
            if not self.states_without_flow:
                self._node.get_logger().warning(f'{self._state_topic} {SPRAYS_NOTHING}')
            self.states_without_flow += 1
        self.sprays = flow > 0.0
        self.programmed_m_per_s = message.programmed_speed_m_per_s

    def _report_progress(self) -> None:
        message = PoseProgress(
            reporter=self._node.get_fully_qualified_name(), poses_received=self.poses_received
        )
        if self._newest is not None:
            message.header = self._newest.header
        self._progress.publish(message)
