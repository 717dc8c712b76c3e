"""Whether a node can keep up with the motion."""

from __future__ import annotations

from collections import deque

import numpy as np

# Batches over which it is taken.
REMEMBERED = 100


class RealTimeFactor:
    """Time spent on painting over the duration of the motion by its stamps."""

    def __init__(self) -> None:
        self._spans: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)

    def note(self, spent_s: float, stamps_ns: np.ndarray) -> None:
        """Take the time spent on poses (N,) int64 of these stamps."""
        steps_ns = np.diff(stamps_ns)
        steps_ns = steps_ns[steps_ns > 0]
        if len(steps_ns):
            # One interval more than there are between the batch's own poses.
            lasted_s = float(np.median(steps_ns)) * len(stamps_ns) * 1e-9
            self._spans.append((spent_s, lasted_s))

    @property
    def value(self) -> float:
        """Above 1 the node falls behind a motion that comes in real time; 0 before any."""
        lasted_s = sum(lasted for _, lasted in self._spans)
        return sum(spent for spent, _ in self._spans) / lasted_s if lasted_s else 0.0
