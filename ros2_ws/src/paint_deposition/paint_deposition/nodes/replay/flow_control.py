"""Flow control of a replay: it waits for the nodes that take its poses."""

from __future__ import annotations

import math
import threading
import time

from paint_msgs.msg import PoseProgress
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.nodes.replay.pose_window import PoseWindow
from paint_deposition.nodes.runtime import qos
from paint_deposition.nodes.runtime.messages import PROGRESS_TOPIC
from paint_deposition.nodes.runtime.qos_watch import endpoint_name

# Discovery brings a node's subscriptions and its progress publisher one after the other.
SETTLED_S = 0.5
GRAPH_PERIOD_S = 0.1
NOTICE_PERIOD_S = 5.0
ACKNOWLEDGED_WITHIN = Duration(seconds=0.05)


class FlowControl:
    """Holds a publisher of poses back until its subscribers have taken them.

    Nodes that take the poses and publish PoseProgress on `atomizer/progress` are waited for, pose
    by pose; of all others only the acknowledgement by their middleware is known. The waiting
    methods are for one thread beside the executor; they return early once `stopped` is set.
    `doing` says in words what is waited for.
    """

    def __init__(self, node: Node, publisher: Publisher, window: int, stopped: threading.Event):
        self._node = node
        self._publisher = publisher
        self._limit = window
        self._stopped = stopped
        self._window = PoseWindow()
        self._sent = 0
        self._looked_s = -math.inf
        self.doing = 'starting'
        node.create_subscription(PoseProgress, PROGRESS_TOPIC, self._take_report, qos.PROGRESS)

    @property
    def poses_ahead(self) -> int:
        """Poses that the slowest reporting subscriber has not taken yet."""
        return self._window.ahead(time.monotonic())

    def sent(self, pose_stamp_ns: int) -> None:
        """Note a pose that is about to be published."""
        self._sent += 1
        self._window.publish(pose_stamp_ns, time.monotonic())

    def wait_for_subscribers(self, wanted: int) -> None:
        """Wait for so many subscribers, and until no more turn up at the same moment."""
        seen, since_s, notice_s = None, time.monotonic(), 0.0
        while wanted and not self._stopped.is_set():
            count = self._publisher.get_subscription_count()
            present = count, self._look_around()
            now_s = time.monotonic()
            if present != seen:
                seen, since_s = present, now_s
            if count >= wanted and now_s - since_s >= SETTLED_S:
                break
            if count < wanted and now_s - notice_s > NOTICE_PERIOD_S:
                notice_s = now_s
                topic = self._publisher.topic_name
                self._notice(f'waiting for {wanted} subscribers on {topic}, {count} there')
            self._stopped.wait(GRAPH_PERIOD_S)
        self._look_around()

    def wait_for_room(self) -> None:
        """Let the subscribers come so near that one more pose is within the window."""
        if self._sent % self._limit == 0:
            self._publisher.wait_for_all_acked(ACKNOWLEDGED_WITHIN)
        self._wait_until_ahead_is_less_than(self._limit)

    def wait_until_taken(self) -> None:
        """Wait until every pose was taken, or is known never to be."""
        self._wait_until_ahead_is_less_than(1)
        deadline_s = time.monotonic() + NOTICE_PERIOD_S
        while not self._stopped.is_set() and time.monotonic() < deadline_s:
            if self._publisher.wait_for_all_acked(ACKNOWLEDGED_WITHIN):
                break
        for name, count in self._window.take_lost().items():
            self._node.get_logger().warning(f'{name} never got the last {count} poses')

    def _wait_until_ahead_is_less_than(self, limit: int) -> None:
        notice_s = time.monotonic()
        while not self._stopped.is_set():
            now_s = time.monotonic()
            if now_s - self._looked_s > GRAPH_PERIOD_S:
                self._look_around()
            ahead = self.poses_ahead
            for name in self._window.take_unheard():
                self._node.get_logger().warning(
                    f'{name} has never reported its progress: it is no longer waited for, and '
                    'may lose what its queue does not hold'
                )
            if ahead < limit:
                break
            if now_s - notice_s > NOTICE_PERIOD_S:
                notice_s = now_s
                slowest = ' '.join(self._window.slowest())
                self._notice(f'waiting for {slowest}, {self.poses_ahead} poses behind')
            self._stopped.wait(0.001)
        self.doing = 'playing'

    def _notice(self, doing: str) -> None:
        self.doing = doing
        self._node.get_logger().info(doing)

    def _take_report(self, progress: PoseProgress) -> None:
        stamp = stamp_ns(progress.header)
        self._window.report(progress.reporter or None, stamp, time.monotonic())

    def _look_around(self) -> frozenset[str]:
        self._looked_s = time.monotonic()
        names = self._reporters()
        self._window.present(names, time.monotonic())
        return names

    def _reporters(self) -> frozenset[str]:
        """Full names of the nodes that take the poses and can report progress."""
        progress_topic = self._node.resolve_topic_name(PROGRESS_TOPIC)
        node = self._node
        takers = node.get_subscriptions_info_by_topic(self._publisher.topic_name)
        tellers = node.get_publishers_info_by_topic(progress_topic)
        return frozenset(map(endpoint_name, takers)) & frozenset(map(endpoint_name, tellers))
