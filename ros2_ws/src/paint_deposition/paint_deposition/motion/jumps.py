"""Steps between poses that no robot makes: two guns on one topic, or stamps of two clocks."""

import numpy as np

# Painting robots move their TCP at 2 m/s, at most 3 m/s.
IMPOSSIBLE_M_PER_S = 10.0
# Stamps that tremble make any step of a slow gun look fast.
LEAST_STEP_M = 0.05


class Jumps:
    """Steps of a stream of poses that are too far for the time between their stamps.

    Attributes:
        count: such steps.
        fastest_m_per_s: the speed that the worst of them would take, 0 where there is none.
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
        if far.any():
            self.count += int(np.count_nonzero(far))
            fastest = float(np.max(step_m[far] / step_s[far]))
            self.fastest_m_per_s = max(self.fastest_m_per_s, fastest)
