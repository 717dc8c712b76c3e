"""How far the subscribers of a replay have come with the poses they were sent."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

# A subscriber that has reported the same pose for so long while none was sent has got all that
# will ever reach it.
LOST_AFTER_S = 5.0
# One that has never reported is given up after so long; nodes report once their mesh is read.
UNHEARD_AFTER_S = 20.0


@dataclass
class _Subscriber:
    taken: int
    advanced_s: float
    reported_s: float | None = None
    lost: int = 0
    unheard: bool = False


class PoseWindow:
    """Poses that were published, and which of them each reporting subscriber has taken.

    A subscriber is known by its full name; one that joins late, or again, starts with what is
    published after. Its reports name the newest
    pose it took by stamp: what was lost before that one does not matter any more. All times are
    monotonic seconds. Safe to use from several threads.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._published = 0
        self._published_s = 0.0
        self._stamps: deque[int] = deque()  # of the poses that somebody has not taken yet
        self._subscribers: dict[str, _Subscriber] = {}
        self._unheard: list[str] = []

    def publish(self, stamp_ns: int, now_s: float) -> None:
        """Note that the pose of this stamp was sent."""
        with self._lock:
            self._published += 1
            self._published_s = now_s
            if self._subscribers:
                self._stamps.append(stamp_ns)

    def present(self, names: Iterable[str], now_s: float) -> None:
        """Say which subscribers report progress now: others are no longer waited for."""
        with self._lock:
            names = set(names)
            for name in names - self._subscribers.keys():
                self._subscribers[name] = _Subscriber(self._published, now_s)
            for name in self._subscribers.keys() - names:
                del self._subscribers[name]
            self._forget_taken()

    def report(self, name: str | None, stamp_ns: int, now_s: float) -> None:
        """Note that the pose of this stamp is the newest that a subscriber has taken.

        Without a name this is noted for every subscriber.
        """
        with self._lock:
            taken = self._number_of(stamp_ns)
            for known, subscriber in self._subscribers.items():
                if name not in (None, known):
                    continue
                subscriber.reported_s = now_s
                if subscriber.unheard:  # what was forgotten meanwhile is not waited for
                    subscriber.unheard = False
                    subscriber.taken = self._published - len(self._stamps)
                if taken > subscriber.taken:
                    subscriber.taken = taken
                    subscriber.advanced_s = now_s
            self._forget_taken()

    def ahead(self, now_s: float) -> int:
        """Poses that the slowest subscriber has not taken yet."""
        with self._lock:
            for name, subscriber in self._subscribers.items():
                self._give_up_unheard(name, subscriber, now_s)
                self._give_up_lost(subscriber, now_s)
            self._forget_taken()
            return len(self._stamps)

    def slowest(self) -> list[str]:
        """The subscribers that are furthest behind."""
        with self._lock:
            least = self._least_taken()
            if least == self._published:
                return []
            return [name for name, s in self._subscribers.items() if s.taken == least]

    def take_unheard(self) -> list[str]:
        """Subscribers given up since the last call because they have never reported."""
        with self._lock:
            unheard, self._unheard = self._unheard, []
            return unheard

    def take_lost(self) -> dict[str, int]:
        """Poses that never reached a subscriber, by its name; counted from zero again."""
        with self._lock:
            lost = {name: s.lost for name, s in self._subscribers.items() if s.lost}
            for subscriber in self._subscribers.values():
                subscriber.lost = 0
            return lost

    def _number_of(self, stamp_ns: int) -> int:
        """How many poses were published up to the newest one of this stamp; 0: not among them."""
        for back, stamp in enumerate(reversed(self._stamps)):
            if stamp == stamp_ns:
                return self._published - back
        return 0

    def _give_up_unheard(self, name: str, subscriber: _Subscriber, now_s: float) -> None:
        if subscriber.reported_s is not None or subscriber.unheard:
            return
        quiet_since_s = max(self._published_s, subscriber.advanced_s)
        waited_for = subscriber.taken < self._published
        if waited_for and now_s - quiet_since_s > UNHEARD_AFTER_S:
            subscriber.unheard = True
            self._unheard.append(name)

    def _least_taken(self) -> int:
        heard = (s.taken for s in self._subscribers.values() if not s.unheard)
        return min(heard, default=self._published)

    def _give_up_lost(self, subscriber: _Subscriber, now_s: float) -> None:
        if subscriber.taken == self._published or subscriber.reported_s is None:
            return
        quiet_since_s = max(self._published_s, subscriber.advanced_s)
        still_reports = subscriber.reported_s > quiet_since_s + 0.5 * LOST_AFTER_S
        if still_reports and now_s - quiet_since_s > LOST_AFTER_S:
            subscriber.lost += self._published - subscriber.taken
            subscriber.taken = self._published

    def _forget_taken(self) -> None:
        least = self._least_taken()
        while len(self._stamps) > self._published - least:
            self._stamps.popleft()
