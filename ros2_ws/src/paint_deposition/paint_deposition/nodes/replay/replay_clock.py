"""The time in a bag during its replay, which also advances between the messages."""

import math
import threading
import time


class ReplayClock:
    """Bag time as a function of the steady clock; thread-safe.

    It does not advance before `start` and while paused. `rate` is bag seconds per second; at 0,
    time jumps from message to message. `running` is False while paused.
    """

    def __init__(self, rate: float, running: bool = True) -> None:
        self._rate = rate
        self._changed = threading.Condition()
        self._time_ns: int | None = None
        self._since_s: float | None = None  # steady time at _time_ns; None while stopped
        self._started = False
        self.running = running

    @property
    def time_ns(self) -> int | None:
        """Current time in the bag [ns], None before the first `stop_at`."""
        with self._changed:
            if self._since_s is None or self._time_ns is None:
                return self._time_ns
            passed_s = time.monotonic() - self._since_s
            return self._time_ns + round(passed_s * self._rate * 1e9)

    def stop_at(self, time_ns: int) -> None:
        """Set the time, and stop until `start`."""
        with self._changed:
            self._set(started=False, running=self.running)
            self._time_ns = time_ns

    def start(self) -> None:
        """Start from the current time, unless paused."""
        self._set(started=True, running=self.running)

    def stop(self) -> None:
        """Stop at the current time."""
        self._set(started=False, running=self.running)

    def pause(self) -> None:
        """Pause until `resume`."""
        self._set(started=self._started, running=False)

    def resume(self) -> None:
        """End a `pause`."""
        self._set(started=self._started, running=True)

    def jump_to(self, time_ns: int) -> None:
        """At rate 0: jump to the time of a message."""
        with self._changed:
            if self._rate == 0.0:
                self._time_ns = time_ns

    def wait_for(self, time_ns: int, timeout_s: float) -> bool:
        """Wait for that time, at rate 0 only for the end of a pause.

        Returns:
            False after the timeout.
        """
        with self._changed:
            left_s = self._remaining_s(time_ns)
            if left_s > 0.0:
                self._changed.wait(min(left_s, timeout_s))
            return self._remaining_s(time_ns) <= 0.0

    def _remaining_s(self, time_ns: int) -> float:
        if self._rate == 0.0:
            return 0.0 if self.running else math.inf
        if self._since_s is None or self._time_ns is None:
            return math.inf
        passed_s = time.monotonic() - self._since_s
        return (time_ns - self._time_ns) * 1e-9 / self._rate - passed_s

    def _set(self, started: bool, running: bool) -> None:
        with self._changed:
            self._time_ns, self._started, self.running = self.time_ns, started, running
            self._since_s = time.monotonic() if started and running and self._rate else None
            self._changed.notify_all()
