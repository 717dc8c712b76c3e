"""Evidence (marginal likelihood) of hypotheses about what is missing, in closed form.

Around the fitted model the readings are linear in the pattern's parameters and in the amplitudes
of effects, all with normal priors. Integrated over these, the deviations are normal with a known
covariance under every hypothesis. Whitening them by the covariance under the null hypothesis
removes the pattern's parameters; every other hypothesis then adds a low-rank term to the identity.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import norm

from paint_deposition.fitting.least_squares import Fit, covariance_factor


@dataclass(frozen=True)
class NullModel:
    """The null hypothesis that nothing is missing, as the distribution it gives the readings.

    Attributes:
        lower: (P, P) Cholesky factor of the deviations' covariance, in units of the noise.
        deviation: (P,) whitened deviations; standard normal if nothing is missing.
    """

    lower: np.ndarray
    deviation: np.ndarray

    @staticmethod
    def of(fit: Fit, nuisance: np.ndarray | None = None) -> 'NullModel':
        """The base model, linear around a fit, with nuisance directions (P, n) over the noise."""
        centre, width = fit.parameters.prior
        columns = fit.jacobian * width
        deviation = fit.residual + fit.jacobian @ (fit.vector - centre)
        if nuisance is not None and nuisance.size:
            columns = np.hstack([columns, nuisance])
        lower = covariance_factor(columns)
        return NullModel(lower, solve_triangular(lower, deviation, lower=True))

    def whiten(self, columns: np.ndarray) -> np.ndarray:
        """(P, n) directions of the readings, whitened like the deviations."""
        return solve_triangular(self.lower, columns, lower=True)


@dataclass(frozen=True)
class Hypothesis:
    """A statement about what is missing: the readings deviate along some directions.

    Attributes:
        effects: ids of the effects it adds; empty for the null hypothesis and for shapeless ones.
        columns: (P, n) whitened directions, for amplitudes with unit variance.
        sides: (n,) +1 or -1 where physics fixes the sign, else 0.
        other: 'unknown' or 'footprint' if it also adds something outside the library, else ''.
        prior: its prior probability.
        shape: values of the shape parameters that the columns stand for.
    """

    effects: tuple[str, ...]
    columns: np.ndarray
    sides: np.ndarray
    other: str
    prior: float
    shape: tuple[tuple[str, str, float], ...] = ()


class Evidence:
    """Evidence of one hypothesis, for any number of deviation vectors at once.

    Args:
        hypothesis: what may be missing.
        freedom: degrees of freedom of the noise estimate; inf where the noise is known. The
            evidence integrates over the noise's unknown scale, so with few degrees of freedom a
            misfit counts less: the noise may have been underestimated.
    """

    def __init__(self, hypothesis: Hypothesis, freedom: float = np.inf) -> None:
        self.hypothesis, self.freedom = hypothesis, freedom
        self.columns = columns = hypothesis.columns
        precision = np.eye(columns.shape[1]) + columns.T @ columns
        self._lower = cholesky(precision, lower=True)
        self._log_det = 2.0 * float(np.sum(np.log(np.diag(self._lower))))
        self.covariance = np.linalg.inv(precision)
        self._signed = np.flatnonzero(hypothesis.sides)
        self._sides = hypothesis.sides[self._signed]

    def posterior_mean(self, deviations: np.ndarray) -> np.ndarray:
        """(n,) or (n, D) posterior means of the amplitudes for (P,) or (P, D) deviations."""
        return self.covariance @ (self.columns.T @ deviations)

    def explained(self, deviations: np.ndarray) -> np.ndarray:
        """By how much the chi-square of the deviations falls; scalar or (D,)."""
        scores = solve_triangular(self._lower, self.columns.T @ deviations, lower=True)
        return np.sum(scores**2, axis=0)

    def log_bayes_factor(self, deviations: np.ndarray) -> np.ndarray:
        """Log Bayes factor against the null hypothesis; scalar or (D,)."""
        explained = self.explained(deviations)
        if np.isfinite(self.freedom):
            before = self.freedom + np.sum(deviations**2, axis=0)
            count = self.freedom + len(deviations)
            factor = -0.5 * count * np.log1p(-explained / before) - 0.5 * self._log_det
        else:
            factor = 0.5 * (explained - self._log_det)
        if len(self._signed):
            means = self.posterior_mean(deviations)[self._signed]
            spread = np.sqrt(np.diag(self.covariance)[self._signed])
            spread = spread[:, np.newaxis] if means.ndim > 1 else spread
            sides = self._sides[:, np.newaxis] if means.ndim > 1 else self._sides
            factor = factor + np.sum(np.log(2.0) + norm.logcdf(sides * means / spread), axis=0)
        return factor


def simulated(count: int, freedom: float, draws: int, seed: int) -> np.ndarray:
    """(count, draws) whitened deviations under the null hypothesis.

    The scale of the noise varies between draws as that of an estimate with ``freedom`` degrees of
    freedom.
    """
    random = np.random.default_rng(seed)
    deviations = random.normal(size=(count, draws))
    if np.isfinite(freedom):
        deviations /= np.sqrt(random.chisquare(freedom, draws) / freedom)
    return deviations
