"""The time in a bag while it is replayed: it runs on between the messages."""

from __future__ import annotations

import math
import threading
import time


class ReplayClock:
    """Bag time as a function of the steady clock; safe to use from several threads.

    It stands until it has begun, and while paused. `rate` is bag seconds for one second; 0: time
    jumps from message to message. `running` is False while paused.
    """

    def __init__(self, rate: float, running: bool = True) -> None:
        self._rate = rate
        self._changed = threading.Condition()
        self._time_ns: int | None = None
        self._since_s: float | None = None  # when it was _time_ns; None while time stands still
        self._begun = False
        self.running = running

    @property
    def time_ns(self) -> int | None:
        """Time in the bag now [ns], None before it is known."""
        with self._changed:
            if self._since_s is None or self._time_ns is None:
                return self._time_ns
            passed_s = time.monotonic() - self._since_s
            return self._time_ns + round(passed_s * self._rate * 1e9)

    def stand_at(self, time_ns: int) -> None:
        """Stand still at this time until `begin`."""
        with self._changed:
            self._set(begun=False, running=self.running)
            self._time_ns = time_ns

    def begin(self) -> None:
        """Let time run from where it stands, as soon as it is not paused."""
        self._set(begun=True, running=self.running)

    def end(self) -> None:
        """Stand still from now on."""
        self._set(begun=False, running=self.running)

    def pause(self) -> None:
        """Stand still until `resume`."""
        self._set(begun=self._begun, running=False)

    def resume(self) -> None:
        """End a `pause`."""
        self._set(begun=self._begun, running=True)

    def reach(self, time_ns: int) -> None:
        """At rate 0: jump to the time of a message."""
        with self._changed:
            if self._rate == 0.0:
                self._time_ns = time_ns

    def wait_for(self, time_ns: int, timeout_s: float) -> bool:
        """Wait at most so long for that time, at rate 0 only for the end of a pause.

        Returns:
            Whether it has come.
        """
        with self._changed:
            left_s = self._left_s(time_ns)
            if left_s > 0.0:
                self._changed.wait(min(left_s, timeout_s))
            return self._left_s(time_ns) <= 0.0

    def _left_s(self, time_ns: int) -> float:
        if self._rate == 0.0:
            return 0.0 if self.running else math.inf
        if self._since_s is None or self._time_ns is None:
            return math.inf
        passed_s = time.monotonic() - self._since_s
        return (time_ns - self._time_ns) * 1e-9 / self._rate - passed_s

    def _set(self, begun: bool, running: bool) -> None:
        with self._changed:
            self._time_ns, self._begun, self.running = self.time_ns, begun, running
            self._since_s = time.monotonic() if begun and running and self._rate else None
            self._changed.notify_all()
