"""Normal distributions of a fit's vector before the readings."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular


@dataclass(frozen=True)
class Prior:
    """A normal distribution, its covariance given by a square root.

    Attributes:
        centre: (k,) mean.
        factor: (k, k) lower Cholesky factor of the covariance.
    """

    centre: np.ndarray
    factor: np.ndarray

    @cached_property
    def width(self) -> np.ndarray:
        """(k,) standard deviations."""
        return np.linalg.norm(self.factor, axis=1)

    @cached_property
    def whitening(self) -> np.ndarray:
        """(k, k) inverse of the factor."""
        return solve_triangular(self.factor, np.eye(len(self.factor)), lower=True)

    @property
    def precision(self) -> np.ndarray:
        """(k, k) inverse covariance."""
        return self.whitening.T @ self.whitening

    def whiten(self, vector: np.ndarray) -> np.ndarray:
        """(k,) deviations of a vector from the centre, independent and in standard deviations."""
        return self.whitening @ (vector - self.centre)
