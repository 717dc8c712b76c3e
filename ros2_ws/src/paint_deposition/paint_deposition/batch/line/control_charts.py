"""Control charts of a series: Shewhart, EWMA and CUSUM, with limits for a wanted run length.

The run length is the number of parts until a false alarm, on average, while nothing changes.
Montgomery, Introduction to Statistical Quality Control, 2012, chapters 6 and 9; EWMA limits by
the Markov chain of Lucas and Saccucci (1990), CUSUM by the approximation of Siegmund (1985).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

# The EWMA's weight of the newest part, and the CUSUM's reference value: both for changes of about
# one standard deviation.
WEIGHT, REFERENCE = 0.2, 0.5
# Median over standard deviation of the moving range of two: robust against single steps.
MEDIAN_RANGE = 0.954
STATES = 101


@dataclass(frozen=True)
class Charts:
    """The three charts of n values in standard deviations from the centre.

    Attributes:
        values: (n,) for Shewhart. ewma: (n,). high, low: (n,) the two sums of the CUSUM.
        shewhart_limit, ewma_limit, cusum_limit: a value beyond, either way, is an alarm; that of
            the EWMA is (n,), for it widens over the first parts.
    """

    values: np.ndarray
    ewma: np.ndarray
    high: np.ndarray
    low: np.ndarray
    shewhart_limit: float
    ewma_limit: np.ndarray
    cusum_limit: float

    @property
    def alarms(self) -> dict[str, np.ndarray]:
        """Rows beyond the limits, by chart."""
        return {
            'shewhart': np.flatnonzero(np.abs(self.values) > self.shewhart_limit),
            'ewma': np.flatnonzero(np.abs(self.ewma) > self.ewma_limit),
            'cusum': np.flatnonzero(np.maximum(self.high, self.low) > self.cusum_limit),
        }

    @property
    def first_alarm(self) -> int | None:
        """Row of the first alarm of any chart, None if there is none."""
        rows = [int(found[0]) for found in self.alarms.values() if len(found)]
        return min(rows, default=None)


def charts(values: np.ndarray, run_length: float) -> Charts:
    """Draw up the charts of values in standard deviations; each has this run length.

    The CUSUM begins anew after an alarm.
    """
    limit = cusum_limit(run_length)
    high, low, ewma = (np.zeros(len(values)) for _ in range(3))
    up = down = level = 0.0
    for row, value in enumerate(values):
        up, down = max(0.0, up + value - REFERENCE), max(0.0, down - value - REFERENCE)
        level += WEIGHT * (value - level)
        high[row], low[row], ewma[row] = up, down, level
        if max(up, down) > limit:
            up = down = 0.0
    spread = np.sqrt(
        WEIGHT / (2.0 - WEIGHT) * (1.0 - (1.0 - WEIGHT) ** (2.0 * np.arange(1, len(values) + 1)))
    )
    return Charts(
        values, ewma, high, low, shewhart_limit(run_length), ewma_limit(run_length) * spread, limit
    )


def robust_deviation(values: np.ndarray) -> float:
    """Standard deviation of a series from its moving range, hardly touched by a few steps."""
    return float(np.median(np.abs(np.diff(values))) / MEDIAN_RANGE)


def shewhart_limit(run_length: float) -> float:
    """In standard deviations."""
    return float(norm.isf(0.5 / run_length))


def cusum_limit(run_length: float) -> float:
    """Decision interval h of the two-sided CUSUM, in standard deviations."""
    return _solved(_cusum_run_length, run_length, 1.0, 40.0)


@lru_cache(maxsize=256)
def ewma_limit(run_length: float) -> float:
    """In standard deviations of the settled EWMA."""
    return _solved(_ewma_run_length, run_length, 1.5, 7.0)


def _cusum_run_length(h: float) -> float:
    b = h + 1.166
    return (np.exp(2.0 * REFERENCE * b) - 2.0 * REFERENCE * b - 1.0) / (4.0 * REFERENCE**2)


def _ewma_run_length(limit: float) -> float:
    edge = limit * np.sqrt(WEIGHT / (2.0 - WEIGHT))
    half = edge / STATES
    middle = np.linspace(-edge + half, edge - half, STATES)
    moved = (middle[np.newaxis] - (1.0 - WEIGHT) * middle[:, np.newaxis]) / WEIGHT
    chances = norm.cdf(moved + half / WEIGHT) - norm.cdf(moved - half / WEIGHT)
    lengths = np.linalg.solve(np.eye(STATES) - chances, np.ones(STATES))
    return float(lengths[STATES // 2])


def _solved(length: Callable[[float], float], wanted: float, low: float, high: float) -> float:
    return float(brentq(lambda x: np.log(length(x)) - np.log(wanted), low, high, xtol=1e-4))
