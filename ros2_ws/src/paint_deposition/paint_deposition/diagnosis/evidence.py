"""Evidence for hypotheses about what is missing, in closed form.

Around the fitted model the readings are linear in the pattern's parameters and in the amplitudes
of effects, all with normal priors, so every hypothesis says: the whitened deviations are normal
with a known covariance. Whitening them once more by the base model's own covariance makes the
pattern's parameters disappear; each hypothesis is then a low-rank addition to the identity.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import norm

from paint_deposition.fitting.least_squares import Fit


@dataclass(frozen=True)
class BaseSpace:
    """Deviations seen with the base model's own freedom taken out.

    Attributes:
        lower: (P, P) Cholesky factor of the base covariance, noise 1.
        deviation: (P,) deviations; standard normal if nothing is missing.
    """

    lower: np.ndarray
    deviation: np.ndarray

    @staticmethod
    def of(fit: Fit, nuisance: np.ndarray | None = None) -> 'BaseSpace':
        """Around a fit; ``nuisance`` (P, n) are further directions without meaning."""
        centre, width = fit.unknowns.prior
        columns = fit.jacobian * width
        deviation = fit.residual + fit.jacobian @ (fit.vector - centre)
        if nuisance is not None and nuisance.size:
            columns = np.hstack([columns, nuisance])
        lower = cholesky(np.eye(len(deviation)) + columns @ columns.T, lower=True)
        return BaseSpace(lower, solve_triangular(lower, deviation, lower=True))

    def project(self, columns: np.ndarray) -> np.ndarray:
        """(P, n) directions of the readings, seen in this space."""
        return solve_triangular(self.lower, columns, lower=True)


@dataclass(frozen=True)
class Hypothesis:
    """Something may be missing along these directions.

    Attributes:
        effects: ids of the effects it adds; empty for the base model and for shapeless ones.
        columns: (P, n) in the base space, for amplitudes with unit variance.
        sides: (n,) +1 or -1 where physics fixes the sign, else 0.
        other: 'unknown' or 'footprint' if it also adds what no effect in the library is.
        prior: probability before the readings.
        shape: values of the shape parameters that the columns stand for.
    """

    effects: tuple[str, ...]
    columns: np.ndarray
    sides: np.ndarray
    other: str
    prior: float
    shape: tuple[tuple[str, str, float], ...] = ()


class Judge:
    """Evidence of one hypothesis for any number of deviation vectors at once.

    Args:
        hypothesis: what may be missing.
        freedom: degrees of freedom behind the noise's size; inf where it is known. With few, a
            misfit may as well be noise that was underestimated, and the evidence allows for it.
    """

    def __init__(self, hypothesis: Hypothesis, freedom: float = np.inf) -> None:
        self.freedom = freedom
        columns = hypothesis.columns
        self.columns = columns
        precision = np.eye(columns.shape[1]) + columns.T @ columns
        self._lower = cholesky(precision, lower=True)
        self._log_det = 2.0 * float(np.sum(np.log(np.diag(self._lower))))
        self.covariance = np.linalg.inv(precision)
        self._signed = np.flatnonzero(hypothesis.sides)
        self._sides = hypothesis.sides[self._signed]

    def amplitudes(self, deviations: np.ndarray) -> np.ndarray:
        """(n,) or (n, D) posterior means for (P,) or (P, D) deviations."""
        return self.covariance @ (self.columns.T @ deviations)

    def explained(self, deviations: np.ndarray) -> np.ndarray:
        """How much the quadratic form of the deviations falls; scalar or (D,)."""
        scores = solve_triangular(self._lower, self.columns.T @ deviations, lower=True)
        return np.sum(scores**2, axis=0)

    def log_factor(self, deviations: np.ndarray) -> np.ndarray:
        """Log Bayes factor against the base model; scalar or (D,)."""
        explained = self.explained(deviations)
        if np.isfinite(self.freedom):
            before = self.freedom + np.sum(deviations**2, axis=0)
            count = self.freedom + len(deviations)
            factor = -0.5 * count * np.log1p(-explained / before) - 0.5 * self._log_det
        else:
            factor = 0.5 * (explained - self._log_det)
        if len(self._signed):
            means = self.amplitudes(deviations)[self._signed]
            spread = np.sqrt(np.diag(self.covariance)[self._signed])
            spread = spread[:, np.newaxis] if means.ndim > 1 else spread
            sides = self._sides[:, np.newaxis] if means.ndim > 1 else self._sides
            factor = factor + np.sum(np.log(2.0) + norm.logcdf(sides * means / spread), axis=0)
        return factor


def simulated(count: int, freedom: float, draws: int, seed: int) -> np.ndarray:
    """(count, draws) deviations with nothing missing.

    The noise's size is as uncertain as it was when it was estimated with ``freedom`` degrees of
    freedom.
    """
    random = np.random.default_rng(seed)
    deviations = random.normal(size=(count, draws))
    if np.isfinite(freedom):
        deviations /= np.sqrt(random.chisquare(freedom, draws) / freedom)
    return deviations


def log_sum(log_terms: np.ndarray) -> np.ndarray:
    """Log of the sum of exponentials along the first axis."""
    top = log_terms.max(axis=0)
    return top + np.log(np.sum(np.exp(log_terms - top), axis=0))
