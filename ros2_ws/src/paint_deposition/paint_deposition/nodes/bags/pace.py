"""The pace of a replay: the time in the bag, and how far it may be ahead of its subscribers."""

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

from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.nodes.topics import PROGRESS, PROGRESS_TOPIC, node_name

LOG_PERIOD_S = 5.0
ACKNOWLEDGED_WITHIN = Duration(seconds=0.05)
# If a subscriber reports the same pose for so long while none is sent, later poses are lost to it.
LOST_TIMEOUT_S = 5.0


@dataclass
class Subscriber:
    """Number of poses taken, monotonic times of the last progress and the last report.

    `lost` poses never reached it.
    """

    taken: int
    advanced_s: float
    reported_s: float = -math.inf
    lost: int = 0


class Pace:
    """The time in the bag, by the steady clock, and how far a replay is ahead of its subscribers.

    Time does not advance before it is started and while it is paused. `rate` is bag seconds per
    second; at 0 time goes from message to message, and the publisher of the poses stays at most
    `window` poses ahead of its subscribers.

    It waits for each pose to be reported by the subscribers that publish PoseProgress on
    `atomizer/progress`, and for the middleware's acknowledgement by the others. A subscriber that
    joins, or joins again, starts with the next pose. Its reports identify the newest pose it has
    taken by the stamp; poses lost before that one are not waited for.

    The waiting methods are for one thread beside the executor, and return early once `stopped` is
    set. All times in seconds are monotonic.

    Attributes:
        running: False while paused.
        subscribers: those present that report, by their full names.
        status: what is waited for.
    """

    def __init__(
        self, node: Node, publisher: Publisher, stopped: threading.Event, *, rate: float,
        window: int, running: bool,
    ) -> None:  # fmt: skip
        self._node, self._publisher, self._stopped = node, publisher, stopped
        self._rate, self._window = rate, window
        self._changed = threading.Condition()
        self._time_ns: int | None = None
        self._since_s: float | None = None  # steady time at _time_ns; None while stopped
        self._started, self.running = False, running
        self._sent, self._sent_s = 0, 0.0
        # Larger than the largest window.
        self._stamps: deque[int] = deque(maxlen=20_000)
        self.subscribers: dict[str, Subscriber] = {}
        self._discovered_s = -math.inf
        self.status = 'starting'
        node.create_subscription(
            PoseProgress, PROGRESS_TOPIC,
            lambda said: self.report(said.reporter, stamp_ns(said.header), time.monotonic()),
            PROGRESS,
        )  # fmt: skip

    # --- time in the bag

    @property
    def time_ns(self) -> int | None:
        """Current time in the bag [ns], None before it was set."""
        with self._changed:
            if self._since_s is None or self._time_ns is None:
                return self._time_ns
            passed_s = time.monotonic() - self._since_s
            return self._time_ns + round(passed_s * self._rate * 1e9)

    def change(
        self, *, started: bool | None = None, running: bool | None = None,
        time_ns: int | None = None,
    ) -> None:  # fmt: skip
        """Start or stop, pause or go on; from now, or from that time on."""
        with self._changed:
            self._time_ns = self.time_ns if time_ns is None else time_ns
            self._started = self._started if started is None else started
            self.running = self.running if running is None else running
            goes = self._started and self.running and self._rate
            self._since_s = time.monotonic() if goes else None
            self._changed.notify_all()

    def wait_for(self, time_ns: int) -> None:
        """Wait for the end of a pause, and for that time, at rate 0 for the subscribers."""
        with self._changed:
            while not self._stopped.is_set():
                now_ns, left_s = self.time_ns, math.inf
                if self._rate == 0.0 and self.running:
                    left_s = 0.0
                elif self._since_s is not None and now_ns is not None:
                    left_s = (time_ns - now_ns) * 1e-9 / self._rate
                if left_s <= 0.0:
                    break
                self._changed.wait(min(left_s, 0.05))
        if self._rate == 0.0:
            self.wait_for_lag_below(self._window)
            self.change(time_ns=time_ns)

    # --- who has taken what

    def add_sent(self, stamp_ns: int, now_s: float) -> None:
        """Add a pose that is about to be published, by its stamp."""
        with self._changed:
            self._sent += 1
            self._sent_s = now_s
            self._stamps.append(stamp_ns)

    def set_subscribers(self, names: Iterable[str], now_s: float) -> None:
        """Set the subscribers that are present now; others are no longer waited for."""
        with self._changed:
            known = self.subscribers
            self.subscribers = {
                name: known.get(name) or Subscriber(self._sent, now_s) for name in sorted(names)
            }

    def report(self, name: str, stamp_ns: int, now_s: float) -> None:
        """Set the newest pose that a subscriber has taken."""
        with self._changed:
            # Of poses with equal stamps, the newest.
            back = next((k for k, s in enumerate(reversed(self._stamps)) if s == stamp_ns), None)
            taken = 0 if back is None else self._sent - back
            if subscriber := self.subscribers.get(name):
                subscriber.reported_s = now_s
                if taken > subscriber.taken:
                    subscriber.taken, subscriber.advanced_s = taken, now_s

    def write_off_lost(self, now_s: float) -> dict[str, int]:
        """Take off what subscribers have lost; how many poses each of them still has to take."""
        with self._changed:
            behind = {}
            for name, subscriber in self.subscribers.items():
                left = self._sent - subscriber.taken
                quiet_since_s = max(self._sent_s, subscriber.advanced_s)
                # Without reports in this time it may be busy.
                reports = subscriber.reported_s > quiet_since_s + 0.5 * LOST_TIMEOUT_S
                if reports and now_s - quiet_since_s > LOST_TIMEOUT_S:
                    subscriber.lost += left
                    subscriber.taken = self._sent
                elif left:
                    behind[name] = left
            return behind

    def _discover(self) -> frozenset[str]:
        """Full names of the subscribers that also publish progress."""
        self._discovered_s = time.monotonic()
        takers = self._node.get_subscriptions_info_by_topic(self._publisher.topic_name)
        progress = self._node.resolve_topic_name(PROGRESS_TOPIC)
        reporters = self._node.get_publishers_info_by_topic(progress)
        names = frozenset(map(node_name, takers)) & frozenset(map(node_name, reporters))
        self.set_subscribers(names, self._discovered_s)
        return names

    # --- waiting

    def wait_for_subscribers(self, wanted: int) -> None:
        """Wait until there are so many subscribers and no more appear for a moment."""
        seen, since_s, logged_s = None, time.monotonic(), 0.0
        while wanted and not self._stopped.is_set():
            count = self._publisher.get_subscription_count()
            present = count, self._discover()
            now_s = time.monotonic()
            if present != seen:
                seen, since_s = present, now_s
            # Its subscriptions and its publisher are not discovered at the same moment.
            if count >= wanted and now_s - since_s >= 0.5:
                break
            if count < wanted and now_s - logged_s > LOG_PERIOD_S:
                logged_s = now_s
                topic = self._publisher.topic_name
                self.status = f'waiting for {wanted} subscribers on {topic}, {count} there'
                self._node.get_logger().info(self.status)
            self._stopped.wait(0.1)
        self._discover()

    def wait_until_taken(self) -> None:
        """Wait until every pose is taken or known to be lost."""
        self.wait_for_lag_below(1)
        deadline_s = time.monotonic() + LOG_PERIOD_S
        while not self._stopped.is_set() and time.monotonic() < deadline_s:
            if self._publisher.wait_for_all_acked(ACKNOWLEDGED_WITHIN):
                break
        for name, subscriber in self.subscribers.items():
            if subscriber.lost:
                self._node.get_logger().warning(f'{name} has lost {subscriber.lost} poses')

    def wait_for_lag_below(self, limit: int) -> None:
        """Wait until all subscribers have fewer poses to take than that."""
        if self._sent % self._window == 0:
            self._publisher.wait_for_all_acked(ACKNOWLEDGED_WITHIN)
        logged_s = time.monotonic()
        while not self._stopped.is_set():
            now_s = time.monotonic()
            if now_s - self._discovered_s > 0.1:
                self._discover()
            behind = self.write_off_lost(now_s)
            if max(behind.values(), default=0) < limit:
                break
            if now_s - logged_s > LOG_PERIOD_S:
                logged_s = now_s
                late = ', '.join(f'{name}, {count} poses behind' for name, count in behind.items())
                self.status = f'waiting for {late}'
                self._node.get_logger().info(self.status)
            self._stopped.wait(0.001)
        self.status = 'playing'
