"""Smooth random fields over parts and covariates, as square roots of their covariances."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

# Roots that are kept: while models change, most places and lengths stay.
ROOTS_KEPT = 128
Correlation = Callable[[ArrayLike], np.ndarray]


def smooth(away: ArrayLike) -> np.ndarray:
    """Correlation at a distance over its length: that of a field without any edge."""
    return np.exp(-0.5 * np.square(away))


def with_edges(away: ArrayLike) -> np.ndarray:
    """The same of a field that may bend sharply: Matérn's with smoothness 3/2."""
    scaled = np.sqrt(3.0) * np.asarray(away)
    return (1.0 + scaled) * np.exp(-scaled)


def root_of_field(
    places: np.ndarray, length: float, negligible: float, correlation: Correlation = smooth
) -> np.ndarray:
    """(N, n) square root of the covariance of a field of unit variance; not to be changed.

    Args:
        places: (N, D) where its values are.
        negligible: directions below this share of the largest variance are left out.
        correlation: at a distance over the length.
    """
    places = np.ascontiguousarray(places, dtype=float)
    return _root(places.tobytes(), places.shape, length, negligible, correlation)


@lru_cache(ROOTS_KEPT)
def _root(
    places: bytes, shape: tuple[int, int], length: float, negligible: float,
    correlation: Correlation,
) -> np.ndarray:  # fmt: skip
    at = np.frombuffer(places).reshape(shape)
    values, vectors = np.linalg.eigh(correlation(cdist(at, at) / length))
    kept = values > negligible * values[-1]
    root = vectors[:, kept] * np.sqrt(values[kept])
    root.flags.writeable = False
    return root


def field_over_values(values: np.ndarray, length: float, negligible: float) -> np.ndarray:
    """(P, n) root of a field of unit variance over values (P,), with a length of correlation."""
    return root_of_field(values[:, np.newaxis], length, negligible)
