"""Samples that a driver sends again with a new stamp before the robot has given the next one."""

import numpy as np

# Equal values over a longer time are a robot that stands still [ns].
LONGEST_REPEAT_NS = 50_000_000
# So many repeats, and such a share of the samples, are the driver's habit; fewer are chance.
FEWEST_REPEATS = 20
LEAST_SHARE = 0.2


class RepeatedSamples:
    """Finds the samples of a stream that repeat the one before them under a later stamp.

    A loop that is faster than the robot sends each sample two or three times: speeds of zero and
    of thrice. Equal samples between two that differ are repeats if they last no longer than
    ``LONGEST_REPEAT_NS``. They are found as soon as they are known as a habit, from what came
    before alone, so that a live stream and its recording lose the same ones.

    Attributes:
        count: repeats that were found.
    """

    def __init__(self) -> None:
        self.count = 0
        self._last: list[float] = []
        self._last_ns = self._since_ns = 0
        self._waiting = self._seen = self._moved = 0

    def are_new(self, stamps_ns: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Whether the samples, (N,) int64 and (N, K), are no repeats: (N,) of bool."""
        new = np.ones(len(values), dtype=bool)
        for row, (stamp_ns, value) in enumerate(
            zip(stamps_ns.tolist(), values.tolist(), strict=True)
        ):
            if value != self._last:
                stood = self._last_ns - self._since_ns > LONGEST_REPEAT_NS
                self._seen += 0 if stood else self._waiting
                self._moved += 1
                self._last, self._since_ns, self._waiting = value, stamp_ns, 0
            elif stamp_ns > self._last_ns:
                self._waiting += 1
                soon = stamp_ns - self._since_ns <= LONGEST_REPEAT_NS
                new[row] = not (soon and self._is_habit)
            self._last_ns = stamp_ns
        self.count += int(np.count_nonzero(~new))
        return new

    @property
    def _is_habit(self) -> bool:
        share = LEAST_SHARE * (self._seen + self._moved)
        return self._seen >= FEWEST_REPEATS and self._seen >= share
