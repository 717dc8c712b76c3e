"""Spearman's rank correlation."""

import numpy as np
from scipy.special import stdtr


def rank_correlation(first: np.ndarray, second: np.ndarray) -> tuple[float, float]:
    """Of values (P,) and (P,): the correlation, and the p-value of none, by Student's t.

    As ``scipy.stats.spearmanr``, whose package takes as long to load as a whole comparison.
    """
    correlation = np.corrcoef(_ranks(first), _ranks(second))[0, 1]
    freedom = len(first) - 2
    with np.errstate(divide='ignore'):
        t = correlation * np.sqrt(freedom / ((1.0 + correlation) * (1.0 - correlation)))
    return float(correlation), float(2.0 * stdtr(freedom, -abs(t)))


def _ranks(values: np.ndarray) -> np.ndarray:
    """(P,) ranks from 1; equal values share the mean of theirs."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - 0.5 * (count - 1))[place]
