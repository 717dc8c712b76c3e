"""Flow control of a replay: it waits for the nodes that take its poses."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from paint_msgs.msg import PoseProgress
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.nodes.runtime.topics import PROGRESS, PROGRESS_TOPIC, endpoint_name

# Discovery brings a node's subscriptions and its progress publisher one after the other.
SETTLED_S = 0.5
GRAPH_PERIOD_S = 0.1
NOTICE_PERIOD_S = 5.0
ACKNOWLEDGED_WITHIN = Duration(seconds=0.05)
# A subscriber that has reported the same pose for so long while none was sent has got all that
# will ever reach it.
LOST_AFTER_S = 5.0
# One that has never reported is not waited for after so long; nodes report as soon as they run.
UNHEARD_AFTER_S = 20.0
# More poses than the largest window, by which reports are known.
REMEMBERED = 20_000


@dataclass
class Subscriber:
    """Poses taken, when the last of them was, and when it last reported.

    `lost` poses never reached it; one that is `unheard` has never reported and is not waited for.
    """

    taken: int
    advanced_s: float
    reported_s: float | None = None
    lost: int = 0
    unheard: bool = False


class PoseWindow:
    """Poses that were published, and which of them each reporting subscriber has taken.

    A subscriber is known by its full name; one that joins late, or again, starts with what is
    published after. Its reports name the newest pose it took by stamp: what was lost before that
    one does not matter any more. All times are monotonic seconds. Safe to use from several
    threads.

    Attributes:
        subscribers: those that are there, by name.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._published = 0
        self._published_s = 0.0
        self._stamps: deque[int] = deque(maxlen=REMEMBERED)
        self.subscribers: dict[str, Subscriber] = {}

    def publish(self, stamp_ns: int, now_s: float) -> None:
        """Note that the pose of this stamp was sent."""
        with self._lock:
            self._published += 1
            self._published_s = now_s
            self._stamps.append(stamp_ns)

    def present(self, names: Iterable[str], now_s: float) -> None:
        """Note which subscribers are there now: others are no longer waited for."""
        with self._lock:
            known = self.subscribers
            self.subscribers = {
                name: known.get(name) or Subscriber(self._published, now_s)
                for name in sorted(names)
            }

    def report(self, name: str | None, stamp_ns: int, now_s: float) -> None:
        """Note the newest pose that a subscriber has taken; without a name, all of them."""
        with self._lock:
            # Of equal stamps the newest pose is meant.
            back = next((k for k, s in enumerate(reversed(self._stamps)) if s == stamp_ns), None)
            taken = 0 if back is None else self._published - back
            for known, subscriber in self.subscribers.items():
                if name in (None, known):
                    subscriber.reported_s, subscriber.unheard = now_s, False
                    if taken > subscriber.taken:
                        subscriber.taken, subscriber.advanced_s = taken, now_s

    def behind(self, now_s: float) -> dict[str, int]:
        """Poses that subscribers have not taken yet, of those that are waited for."""
        with self._lock:
            waited_for = {}
            for name, subscriber in self.subscribers.items():
                if subscriber.taken < self._published:
                    self._drop_hopeless(subscriber, now_s)
                if subscriber.taken < self._published and not subscriber.unheard:
                    waited_for[name] = self._published - subscriber.taken
            return waited_for

    def _drop_hopeless(self, subscriber: Subscriber, now_s: float) -> None:
        quiet_since_s = max(self._published_s, subscriber.advanced_s)
        if subscriber.reported_s is None:
            subscriber.unheard |= now_s - quiet_since_s > UNHEARD_AFTER_S
        elif (
            now_s - quiet_since_s > LOST_AFTER_S
            # It still reports; one that is silent may be busy.
            and subscriber.reported_s > quiet_since_s + 0.5 * LOST_AFTER_S
        ):
            subscriber.lost += self._published - subscriber.taken
            subscriber.taken = self._published


class FlowControl:
    """Holds a publisher of poses back until its subscribers have taken them.

    Nodes that take the poses and publish PoseProgress on `atomizer/progress` are waited for, pose
    by pose; of all others only the acknowledgement by their middleware is known. The waiting
    methods are for one thread beside the executor; they return early once `stopped` is set.
    `doing` says in words what is waited for.
    """

    def __init__(self, node: Node, publisher: Publisher, window: int, stopped: threading.Event):
        self._node, self._publisher = node, publisher
        self._limit, self._stopped = window, stopped
        self._window = PoseWindow()
        self._sent = 0
        self._looked_s = -math.inf
        self._unheard: set[str] = set()
        self.doing = 'starting'
        node.create_subscription(PoseProgress, PROGRESS_TOPIC, self._take_report, PROGRESS)

    @property
    def poses_ahead(self) -> int:
        """Poses that the slowest reporting subscriber has not taken yet."""
        return max(self._window.behind(time.monotonic()).values(), default=0)

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
        for name, subscriber in self._window.subscribers.items():
            if subscriber.lost:
                self._node.get_logger().warning(f'{name} never got {subscriber.lost} poses')

    def _wait_until_ahead_is_less_than(self, limit: int) -> None:
        notice_s = time.monotonic()
        while not self._stopped.is_set():
            now_s = time.monotonic()
            if now_s - self._looked_s > GRAPH_PERIOD_S:
                self._look_around()
            behind = self._window.behind(now_s)
            if max(behind.values(), default=0) < limit:
                break
            unheard = {name for name, s in self._window.subscribers.items() if s.unheard}
            for name in unheard - self._unheard:
                self._node.get_logger().warning(
                    f'{name} has never reported its progress: it is no longer waited for, and '
                    'may lose what its queue does not hold'
                )
            self._unheard = unheard
            if now_s - notice_s > NOTICE_PERIOD_S:
                notice_s = now_s
                late = ', '.join(f'{name}, {count} poses behind' for name, count in behind.items())
                self._notice(f'waiting for {late}')
            self._stopped.wait(0.001)
        self.doing = 'playing'

    def _notice(self, doing: str) -> None:
        self.doing = doing
        self._node.get_logger().info(doing)

    def _take_report(self, progress: PoseProgress) -> None:
        stamp = stamp_ns(progress.header)
        self._window.report(progress.reporter or None, stamp, time.monotonic())

    def _look_around(self) -> frozenset[str]:
        """Full names of the nodes that take the poses and can report progress."""
        self._looked_s = time.monotonic()
        takers = self._node.get_subscriptions_info_by_topic(self._publisher.topic_name)
        progress = self._node.resolve_topic_name(PROGRESS_TOPIC)
        reporters = self._node.get_publishers_info_by_topic(progress)
        names = frozenset(map(endpoint_name, takers)) & frozenset(map(endpoint_name, reporters))
        self._window.present(names, self._looked_s)
        return names
