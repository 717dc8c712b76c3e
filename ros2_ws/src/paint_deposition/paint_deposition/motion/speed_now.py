"""How fast the TCP moves now."""

import math

import numpy as np

# Single steps between poses carry the noise of the encoders and the jitter of the stamps.
WINDOW_NS = 200_000_000


class SpeedNow:
    """The speed over the last 0.2 s of a stream of poses."""

    def __init__(self) -> None:
        self._stamps_ns: np.ndarray = np.empty(0, dtype=np.int64)
        self._positions_m: np.ndarray = np.empty((0, 3))

    def add(self, stamps_ns: np.ndarray, positions_m: np.ndarray) -> None:
        """Take stamps (N,) int64 and positions (N, 3) [m]; stamps that go back begin anew."""
        if len(self._stamps_ns) and stamps_ns[0] <= self._stamps_ns[-1]:
            self._stamps_ns, self._positions_m = self._stamps_ns[:0], self._positions_m[:0]
        stamps_ns = np.concatenate([self._stamps_ns, stamps_ns])
        positions_m = np.concatenate([self._positions_m, positions_m])
        recent = stamps_ns >= stamps_ns[-1] - WINDOW_NS
        self._stamps_ns, self._positions_m = stamps_ns[recent], positions_m[recent]

    @property
    def m_per_s(self) -> float:
        """Way over time [m/s]; NaN while there are no two times."""
        if len(self._stamps_ns) < 2 or self._stamps_ns[-1] <= self._stamps_ns[0]:
            return math.nan
        way_m = np.linalg.norm(np.diff(self._positions_m, axis=0), axis=1).sum()
        return float(way_m / (1e-9 * (self._stamps_ns[-1] - self._stamps_ns[0])))
