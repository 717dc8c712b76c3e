"""Figures of a stream of poses: lost poses, impossible steps, and the speed at the moment."""

import math
from collections import deque

import numpy as np

# Intervals whose median is the stream's rhythm, and how much longer a long one is.
REMEMBERED = 250
LONG = 1.5
# Painting robots move their TCP at 3 m/s at most; stamps that tremble make any step of a slow gun
# look fast.
IMPOSSIBLE_M_PER_S = 10.0
LEAST_STEP_M = 0.05
# Single steps between poses carry the noise of the encoders and the jitter of the stamps.
WINDOW_NS, MOST_IN_WINDOW = 200_000_000, 2000


class Intervals:
    """Intervals between the stamps of poses received in order, the longest, and how many are long.

    Long are more than 1.5 times the median of those before: with a steady stream, lost poses.
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
            if step_ns > 0:
                self.longest_ns = max(self.longest_ns, step_ns)
                typical_ns = typical_ns or step_ns
                self.long += step_ns > LONG * typical_ns
                self._recent.append(step_ns)


class Jumps:
    """Steps that no robot makes: two guns on one topic, or stamps of two clocks.

    Their count, and the speed that the worst of them would take, 0 where there is none.
    """

    def __init__(self) -> None:
        self.count = 0
        self.fastest_m_per_s = 0.0
        self._last_ns: np.ndarray = np.empty(0, dtype=np.int64)
        self._last_m: np.ndarray = np.empty((0, 3))

    def add(self, stamps_ns: np.ndarray, positions_m: np.ndarray) -> None:
        """Take stamps (N,) int64 and positions (N, 3) [m]; a stamp that goes back begins anew."""
        stamps_ns = np.concatenate([self._last_ns, stamps_ns])
        positions_m = np.concatenate([self._last_m, positions_m])
        self._last_ns, self._last_m = stamps_ns[-1:], positions_m[-1:]
        step_s = np.diff(stamps_ns) * 1e-9
        step_m = np.linalg.norm(np.diff(positions_m, axis=0), axis=1)
        far = (step_s > 0.0) & (step_m > np.fmax(LEAST_STEP_M, IMPOSSIBLE_M_PER_S * step_s))
        self.count += int(np.count_nonzero(far))
        fastest = step_m[far] / step_s[far]
        self.fastest_m_per_s = float(np.max(fastest, initial=self.fastest_m_per_s))


class SpeedNow:
    """The speed over the last 0.2 s of a stream of poses."""

    def __init__(self) -> None:
        self._stamps_ns: np.ndarray = np.empty(0, dtype=np.int64)
        self._positions_m: np.ndarray = np.empty((0, 3))

    def add(self, stamps_ns: np.ndarray, positions_m: np.ndarray) -> None:
        """Take stamps (N,) int64 and positions (N, 3) [m]; stamps that go back begin anew."""
        if not len(self._stamps_ns) or stamps_ns[0] > self._stamps_ns[-1]:
            stamps_ns = np.concatenate([self._stamps_ns, stamps_ns])
            positions_m = np.concatenate([self._positions_m, positions_m])
        recent = np.flatnonzero(stamps_ns >= stamps_ns[-1] - WINDOW_NS)[-MOST_IN_WINDOW:]
        self._stamps_ns, self._positions_m = stamps_ns[recent], positions_m[recent]

    @property
    def m_per_s(self) -> float:
        """Way over time [m/s]; NaN while there are no two times."""
        if len(self._stamps_ns) < 2 or self._stamps_ns[-1] <= self._stamps_ns[0]:
            return math.nan
        way_m = np.linalg.norm(np.diff(self._positions_m, axis=0), axis=1).sum()
        return float(way_m / (1e-9 * (self._stamps_ns[-1] - self._stamps_ns[0])))
