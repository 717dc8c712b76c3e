"""The rhythm of a stream of poses: what its stamps say about poses that never came."""

from collections import deque

import numpy as np

# Intervals whose median is the stream's rhythm, and how much longer a long one is.
REMEMBERED = 250
LONG = 1.5


class Intervals:
    """Intervals between the stamps of poses received in order.

    Attributes:
        longest_ns: the longest.
        long: how many were longer than 1.5 times the median of those before them. With a steady
            stream each of them is a pose that was lost.
    """

    def __init__(self) -> None:
        self.longest_ns = 0
        self.long = 0
        self._last_ns: int | None = None
        self._recent: deque[int] = deque(maxlen=REMEMBERED)

    @property
    def typical_ns(self) -> float:
        """Median of the last intervals; 0 before there are any."""
        return float(np.median(self._recent)) if self._recent else 0.0

    def add(self, stamps_ns: np.ndarray) -> None:
        """Take stamps (N,) int64; a stamp that does not move forward begins anew."""
        typical_ns = self.typical_ns
        for stamp_ns in stamps_ns.tolist():
            step_ns = 0 if self._last_ns is None else stamp_ns - self._last_ns
            self._last_ns = stamp_ns
            if step_ns <= 0:
                continue
            self.longest_ns = max(self.longest_ns, step_ns)
            typical_ns = typical_ns or step_ns
            self.long += step_ns > LONG * typical_ns
            self._recent.append(step_ns)
