"""The subscriptions to a gun's poses and states, which paint poses in batches."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from functools import partial
from heapq import merge
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState, PoseProgress

from paint_deposition.errors import PaintError
from paint_deposition.files.recordings.messages import stamp_ns, trigger_change
from paint_deposition.motion.pose_stream import NO_POSES, PoseBatch, newest_poses
from paint_deposition.motion.stream_quality import StreamSteps
from paint_deposition.motion.trajectory import SPRAYS_NOTHING
from paint_deposition.motion.transforms import NoTransform
from paint_deposition.nodes import topics
from paint_deposition.nodes.frames import TfQueue
from paint_deposition.nodes.topics import PROGRESS_TOPIC, AdaptiveSubscription, gun_topic

if TYPE_CHECKING:
    from paint_deposition.nodes.painting.painting_node import PaintingNode

POSES_PER_BATCH = 50
# No robot announces a state so long before the pose at which it holds.
AHEAD_NS = 1_000_000_000
# Of what a peer names: so many different ones are told apart, and so many characters of each.
MOST_NAMES, LONGEST_NAME = 20, 200
STATES_REFUSED = 'states refused'


class AtomizerInput:
    """Subscribes to a gun's `atomizer/pose` and `atomizer/state`; publishes `atomizer/progress`.

    The gun's name, if any, precedes the three topics: `robot_1/atomizer/pose`. States switch the
    gun at once, poses are painted in batches of fifty or every twentieth of a second.

    Args:
        node: has the films and the frame of the part.
        number: of the gun among those of the node.

    Attributes:
        name: of the gun, '' for the only one of a cell.
        poses_received: since the node was configured.
        newest_ns: stamp of the last pose that was painted or dropped, 0 before the first.
        sent_ns, state_sent_ns: when the last pose received and the last state taken were sent, 0
            before the first.
        recorded_sent_ns: what was sent until then is painted from a recording, and not taken.
        refused_s, pose_s: monotonic times of the last pose refused and of the last one received.
        spraying: whether the gun sprays, by the newest state; False before the first.
        last_poses: those that show the speed of the TCP now; programmed_m_per_s: that of the
            newest state, 0 or NaN: unknown.
        topics: the subscriptions, which count what the middleware has lost since the last reset.
        tf_queue: poses that wait for their transform.
        times_s: (computing time, duration of the motion) of the last batches.
        unheard_states: why states of another type are not heard, as said last, '' if none come.
        refused_frames: poses refused for their frame, by frame; refusal: reason of the last.
        unpainted: poses received while the node was not active.
        anomalies: other poses and states with something wrong, counted by its description.
        state_errors: why states were refused, each reason once.
        steps: from pose to pose. This and all from `refused_frames` on are since the last reset.
    """

    def __init__(self, node: PaintingNode, number: int) -> None:
        name = node.gun_names[number]
        self._node, self._number, self.name = node, number, name
        self._pose_topic = gun_topic(name, topics.POSE_TOPIC)
        self._state_topic = gun_topic(name, topics.STATE_TOPIC)
        self.poses_received = self.newest_ns = self.sent_ns = self.state_sent_ns = 0
        self.recorded_sent_ns = -1
        self.refused_s = self.pose_s = self._flushed_s = -math.inf
        self.spraying, self.programmed_m_per_s = False, 0.0
        self.unheard_states = ''
        self.last_poses = NO_POSES
        self._newest: PoseStamped | None = None
        # Stamp of a state that is ahead of the poses, and when it was sent [ns].
        self._state_ahead: tuple[int, int] | None = None
        # What was taken from the queues, and when it was sent.
        self._new_poses: list[tuple[PoseStamped, int]] = []
        self._new_states: list[tuple[AtomizerState, int]] = []
        # The next batch, and whether a stamp of it is before one of the part (the highest).
        self._poses: list[tuple[int, np.ndarray, np.ndarray]] = []
        self._goes_back, self._highest_ns = False, 0
        self._held: list[tuple[PoseStamped | AtomizerState, int]] | None = None
        self._hold_after_ns = 0
        self.tf_queue: TfQueue = deque()
        self.times_s: deque[tuple[float, float]] = deque(maxlen=100)
        subscribe = partial(AdaptiveSubscription, node, depth=node.values['pose_queue_depth'])
        self.topics = [
            subscribe(
                PoseStamped, self._pose_topic,
                lambda pose, info: self._new_poses.append((pose, info['source_timestamp'])),
            ),
            # A latched state from before the node started is still in effect.
            subscribe(
                AtomizerState, self._state_topic,
                lambda state, info: self._new_states.append((state, info['source_timestamp'])),
                latched=True,
            ),
        ]  # fmt: skip
        self.reset_counts()
        self._progress = node.create_publisher(
            PoseProgress, gun_topic(name, PROGRESS_TOPIC), topics.PROGRESS
        )
        # Polled: waking up for each pose would cost more than painting it.
        node.create_steady_timer(0.02, partial(self.take_pending, at_once=False))
        node.create_steady_timer(0.2, self._report_progress)

    def reset(self) -> None:
        """Reset the counts; poses that were not painted yet are dropped."""
        self.reset_counts()
        self.newest_ns = stamp_ns(self._newest.header) if self._newest is not None else 0
        self.tf_queue.clear()
        self._poses.clear()
        if self._held is not None:
            self._held[:] = [kept for kept in self._held if isinstance(kept[0], AtomizerState)]

    def reset_counts(self) -> None:
        """Set the counts to zero and forget what was wrong."""
        self.refused_frames: Counter[str] = Counter()
        self.refusal = ''
        self.anomalies: Counter[str] = Counter()
        self.state_errors: set[str] = set()
        self.unpainted = self._highest_ns = 0
        for topic in self.topics:
            topic.lost = 0
        self.steps = StreamSteps()

    # --- holding

    def hold(self, after_ns: int) -> None:
        """Keep messages sent later, untransformed, until `release`."""
        self._hold_after_ns = after_ns
        if self._held is None:
            self._held = []

    def release(self) -> None:
        """Process the messages that were kept, as if they were received now."""
        held, self._held = self._held or [], None
        for message, sent_ns in held:
            self._process(message, sent_ns)
        self.flush()

    def _process(self, message: PoseStamped | AtomizerState, sent_ns: int) -> None:
        if sent_ns <= self.recorded_sent_ns:
            return
        if self._held is not None and sent_ns > self._hold_after_ns:
            # Hours of poses.
            if len(self._held) < 2_000_000:
                self._held.append((message, sent_ns))
            else:
                self.anomalies['messages dropped, since too many waited for the part'] += 1
        elif isinstance(message, PoseStamped):
            self.tf_queue.append((time.monotonic(), message))
            self._place()
        else:
            self.state_sent_ns = max(self.state_sent_ns, sent_ns)
            if self._goes_back:  # it must not overtake the poses sent before it
                self.flush()
            try:
                change = trigger_change(message)
                self._node.film.guns[self._number].add_trigger(change)
            except PaintError as error:
                if str(error) not in self.state_errors and len(self.state_errors) < MOST_NAMES:
                    self._node.get_logger().error(f'{self._state_topic} refused: {error}')
                    self.state_errors.add(str(error))
                self.anomalies[STATES_REFUSED] += 1
                return
            if message.spraying and change.flow == 0.0:
                without_flow = 'states that spray with flow 0'
                if not self.anomalies[without_flow]:
                    self._node.get_logger().warning(f'{self._state_topic} {SPRAYS_NOTHING}')
                self.anomalies[without_flow] += 1
            self.spraying = change.flow > 0.0
            self.programmed_m_per_s = message.programmed_speed_m_per_s

    # --- batches

    def take_pending(self, at_once: bool = True) -> None:
        """Take all messages in the queues, each state before the first pose that was sent later.

        They are painted at once, or when they fill a batch or have waited for long enough.
        """
        for topic in (*self._node.frame.tf_topics, *self.topics):
            topic.take_pending()
        # Latched states may come behind others that were sent later.
        poses, states = [*self._new_poses], sorted(self._new_states, key=itemgetter(1))
        self._new_poses.clear()
        self._new_states.clear()
        # Poses stay in the order in which they came.
        for message, sent_ns in merge(poses, states, key=itemgetter(1)):
            if isinstance(message, PoseStamped):
                self.poses_received += 1
                if len(message.header.frame_id) > LONGEST_NAME:
                    message.header.frame_id = f'{message.header.frame_id[:LONGEST_NAME]}...'
                self._newest, self.sent_ns, self.pose_s = message, sent_ns, time.monotonic()
                if self._state_ahead and sent_ns > self._state_ahead[1]:
                    if self._state_ahead[0] - stamp_ns(message.header) > AHEAD_NS:
                        ahead = 'states stamped over 1 s ahead of the poses sent after them'
                        self.anomalies[f'{ahead}: set the clocks'] += 1
                    self._state_ahead = None
                if self.poses_received % POSES_PER_BATCH == 0:
                    self._report_progress()
            else:
                state_ns = stamp_ns(message.header)
                # Before its poses after a pause, too: the next pose tells.
                if self._newest is None or state_ns - stamp_ns(self._newest.header) > AHEAD_NS:
                    self._state_ahead = state_ns, sent_ns
            self._process(message, sent_ns)

        has_waited = time.monotonic() - self._flushed_s >= 0.05
        if at_once or has_waited or len(self._poses) >= POSES_PER_BATCH:
            self.flush()

    def flush(self) -> None:
        """Paint the next batch if the node is active; poses without a transform wait."""
        self._flushed_s = time.monotonic()
        self._place()
        if not self._poses:
            return
        stamps, positions, quaternions = map(np.array, zip(*self._poses, strict=True))
        self._poses.clear()
        self.newest_ns, self._goes_back = int(stamps[-1]), False
        batch = PoseBatch(stamps, positions, quaternions)
        moved = batch.select(np.flatnonzero(batch.finite))
        jumped = self.steps.jumps
        self.steps.add_stamps(stamps)
        if len(moved):
            self.last_poses = newest_poses(self.last_poses, moved)
            self.steps.add_places(moved.stamps_ns, moved.positions_m)
        if self.steps.jumps and not jumped:
            self._node.get_logger().error(
                f'{self._pose_topic}: the TCP would move at {self.steps.fastest_m_per_s:.0f} m/s '
                'between two poses: do two guns publish here, or two clocks stamp the poses?'
            )
        if self._node.active:
            began_s = time.monotonic()
            self._node.film.guns[self._number].add_poses(batch)
            spent_s = time.monotonic() - began_s
            steps_ns = np.diff(stamps)
            if (steps_ns > 0).any():
                # N poses stand for N intervals: one of them lies before the batch.
                duration_s = float(np.median(steps_ns[steps_ns > 0])) * len(batch) * 1e-9
                self.times_s.append((spent_s, duration_s))
            return
        if not self.unpainted:
            self._node.get_logger().warning(
                f'{self._pose_topic}: poses arrive and are not painted: the node is inactive'
            )
        self.unpainted += len(batch)

    # --- poses

    def _place(self) -> None:
        """Put the poses whose transforms are known into the next batch."""
        frame = self._node.frame
        for pose, placed in frame.placed_in_order(self.tf_queue):
            frame_id = pose.header.frame_id
            if not isinstance(placed, NoTransform):
                self.anomalies['poses without a frame'] += not frame_id
                stamp = stamp_ns(pose.header)
                self._goes_back |= stamp <= self._highest_ns
                self._highest_ns = max(self._highest_ns, stamp)
                self._poses.append((stamp, *placed))
                continue
            if frame_id not in self.refused_frames and len(self.refused_frames) >= MOST_NAMES:
                frame_id = 'others'
            self.refusal, self.refused_s = str(placed), time.monotonic()
            if frame_id not in self.refused_frames:
                self._node.get_logger().error(
                    f"{self._pose_topic}: poses in frame '{frame_id}' are refused: the mesh is in "
                    f"frame '{frame.frame_id}' and {placed}"
                )
            self.refused_frames[frame_id] += 1

    def _report_progress(self) -> None:
        message = PoseProgress(
            reporter=self._node.get_fully_qualified_name(), poses_received=self.poses_received
        )
        if self._newest is not None:
            message.header = self._newest.header
        self._progress.publish(message)
