"""Smooth random fields over parts and covariates, as square roots of their covariances."""

from collections.abc import Iterable

import numpy as np
from scipy.linalg import eigh


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
    return covariance_root(np.exp(-0.5 * away**2), negligible)


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
        covariance_root(np.where(same, np.exp(-0.5 * square / length**2), 0.0), negligible)
        for length in lengths_m
    ]
