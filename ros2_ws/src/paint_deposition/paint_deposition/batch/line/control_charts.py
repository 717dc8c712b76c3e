"""Control charts of a series: Shewhart and EWMA, with limits for a wanted run length.

The run length is the number of parts until a false alarm, on average, while nothing changes.
Montgomery, Introduction to Statistical Quality Control, 2012, chapters 6 and 9; EWMA limits by
the Markov chain of Lucas and Saccucci (1990).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.signal import lfilter
from scipy.stats import norm

# The EWMA's weight of the newest part, for changes of about one standard deviation.
WEIGHT = 0.2
# Median over standard deviation of the moving range of two: robust against single steps.
MEDIAN_RANGE = 0.954
STATES = 101


@dataclass(frozen=True)
class Charts:
    """The two charts of n values in standard deviations from the centre."""

    values: np.ndarray  # (n,) for Shewhart
    ewma: np.ndarray  # (n,)
    # A value beyond, either way, is an alarm; that of the EWMA is (n,), for it widens over the
    # first parts.
    shewhart_limit: float
    ewma_limit: np.ndarray

    @property
    def in_alarm(self) -> np.ndarray:
        """(n,) whether a part is beyond the limits of either chart."""
        beyond = np.zeros(len(self.values), dtype=bool)
        beyond[np.concatenate(list(self.alarms.values()))] = True
        return beyond

    @property
    def alarms(self) -> dict[str, np.ndarray]:
        """Rows beyond the limits, by chart."""
        return {
            'shewhart': np.flatnonzero(np.abs(self.values) > self.shewhart_limit),
            'ewma': np.flatnonzero(np.abs(self.ewma) > self.ewma_limit),
        }


def charts(values: np.ndarray, run_length: float) -> Charts:
    """Draw up the charts of values in standard deviations; each has this run length.

    A value beyond Shewhart's limits counts in the EWMA as one at the limit: a single bad part does
    not put the parts after it in alarm.
    """
    limit = shewhart_limit(run_length)
    ewma = lfilter([WEIGHT], [1.0, WEIGHT - 1.0], np.clip(values, -limit, limit))
    parts = np.arange(1, len(values) + 1)
    spread = np.sqrt(WEIGHT / (2.0 - WEIGHT) * (1.0 - (1.0 - WEIGHT) ** (2.0 * parts)))
    return Charts(values, ewma, limit, ewma_limit(run_length) * spread)


def robust_deviation(values: np.ndarray) -> float:
    """Standard deviation of a series from its moving range, hardly touched by a few steps."""
    return float(np.median(np.abs(np.diff(values))) / MEDIAN_RANGE)


def shewhart_limit(run_length: float) -> float:
    """In standard deviations."""
    return float(norm.isf(0.5 / run_length))


@lru_cache(maxsize=256)
def ewma_limit(run_length: float) -> float:
    """In standard deviations of the settled EWMA."""
    wanted = np.log(run_length)
    return float(brentq(lambda x: np.log(_ewma_run_length(x)) - wanted, 1.5, 7.0, xtol=1e-4))


def _ewma_run_length(limit: float) -> float:
    edge = limit * np.sqrt(WEIGHT / (2.0 - WEIGHT))
    half = edge / STATES
    middle = np.linspace(-edge + half, edge - half, STATES)
    moved = (middle[np.newaxis] - (1.0 - WEIGHT) * middle[:, np.newaxis]) / WEIGHT
    chances = norm.cdf(moved + half / WEIGHT) - norm.cdf(moved - half / WEIGHT)
    lengths = np.linalg.solve(np.eye(STATES) - chances, np.ones(STATES))
    return float(lengths[STATES // 2])
