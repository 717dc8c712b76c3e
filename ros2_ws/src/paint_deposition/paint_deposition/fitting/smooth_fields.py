"""Smooth random fields over parts and covariates, as square roots of their covariances."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh


def smooth(away: ArrayLike) -> np.ndarray:
    """Correlation at a distance over its length: that of a field without any edge."""
    return np.exp(-0.5 * np.square(away))


def with_edges(away: ArrayLike) -> np.ndarray:
    """The same of a field that may bend sharply: Matérn's with smoothness 3/2."""
    scaled = np.sqrt(3.0) * np.asarray(away)
    return (1.0 + scaled) * np.exp(-scaled)


def covariance_root(covariance: np.ndarray, negligible: float) -> np.ndarray:
    """(N, n) square root of a covariance (N, N).

    Args:
        covariance: of the values.
        negligible: directions below this share of the largest variance are left out.
    """
    values, vectors = eigh(covariance)
    kept = values > negligible * values[-1]
    return vectors[:, kept] * np.sqrt(values[kept])


def field_over_values(values: np.ndarray, length: float, negligible: float) -> np.ndarray:
    """(P, n) root of a field of unit variance over values (P,), with a length of correlation."""
    away = (values[:, np.newaxis] - values) / length
    return covariance_root(smooth(away), negligible)


def fields_over_parts(
    owner: np.ndarray, positions_m: np.ndarray, lengths_m: Iterable[float], negligible: float
) -> list[np.ndarray]:
    """Roots (P, n) of fields of unit variance over each part; parts share no field.

    Args:
        owner: (P,) part of each point. positions_m: (P, 3) [m].
        lengths_m: of correlation, one for each field [m].
        negligible: as in ``covariance_root``.
    """
    same = owner[:, np.newaxis] == owner
    square = np.sum((positions_m[:, np.newaxis] - positions_m) ** 2, axis=2)
    return [
        covariance_root(np.where(same, smooth(np.sqrt(square) / length), 0.0), negligible)
        for length in lengths_m
    ]
