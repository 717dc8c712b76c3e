"""Evidence (marginal likelihood) of what may be missing, in closed form.

Around the fitted model the readings are linear in the pattern's parameters and in the amplitudes
of every explanation, all with normal priors. Integrated over these, the deviations are normal
with a known covariance. Whitening them by the covariance under the null hypothesis removes the
pattern's parameters; every explanation then adds a low-rank term to the identity.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.linalg import solve_triangular

from paint_deposition.fitting.least_squares import Fit, covariance_factor

# More degrees of freedom than this count as a noise that is known.
KNOWN_NOISE = 1e9


@dataclass(frozen=True)
class NullModel:
    """The null hypothesis that nothing is missing, as the distribution it gives the readings.

    Attributes:
        columns: (P, m) directions in which the base model and the nuisance vary, for unit
            amplitudes, over the noise.
        nuisance: how many of them, the last ones, are nuisance.
        raw: (P,) deviations over the noise from the base model at the centre of its priors.
        lower: (P, P) Cholesky factor of the deviations' covariance.
        deviation: (P,) whitened deviations; standard normal if nothing is missing.
    """

    columns: np.ndarray
    nuisance: int
    raw: np.ndarray
    lower: np.ndarray
    deviation: np.ndarray

    @staticmethod
    def of(columns: np.ndarray, raw: np.ndarray, nuisance: int = 0) -> 'NullModel':
        """From directions (P, m), the last of which are nuisance, and deviations (P,)."""
        lower = covariance_factor(columns)
        return NullModel(columns, nuisance, raw, lower, solve_triangular(lower, raw, lower=True))

    @staticmethod
    def around(fit: Fit, nuisance: np.ndarray, apart: frozenset[str] = frozenset()) -> 'NullModel':
        """Linear around a fit, with nuisance directions (P, n) over the noise.

        Args:
            fit: of the model.
            nuisance: directions that carry no meaning.
            apart: ids of effects in it that the null hypothesis does not have: what they
                contribute to the film counts as deviation.
        """
        prior, entries = fit.parameters.prior, fit.parameters.of_effects
        pattern = len(fit.vector) - len(entries)
        kept = np.array([True] * pattern + [entry.effect not in apart for entry in entries])
        # The shape of an effect that is not there contributes nothing; its amplitude does.
        shape = np.array([False] * pattern + [entry.is_shape for entry in entries])
        counted = kept | ~shape
        raw = fit.residual + fit.jacobian[:, counted] @ (fit.vector - prior.centre)[counted]
        directions = fit.jacobian[:, kept] @ prior.factor[np.ix_(kept, kept)]
        return NullModel.of(np.hstack([directions, nuisance]), raw, nuisance.shape[1])

    def whiten(self, columns: np.ndarray) -> np.ndarray:
        """(P, n) directions of the readings, whitened like the deviations."""
        return solve_triangular(self.lower, columns, lower=True)

    def select(self, rows: np.ndarray) -> 'NullModel':
        """The same for some of the readings."""
        return NullModel.of(self.columns[rows], self.raw[rows], self.nuisance)


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


@njit(cache=True)
def log_normal_cdf(x):
    """Logarithm of the standard normal distribution function."""
    if x > -30.0:
        return math.log(0.5 * math.erfc(-x / math.sqrt(2.0)))
    return -0.5 * x * x - math.log(-x * math.sqrt(2.0 * math.pi))


@njit(cache=True)
def log_bayes_factor(gram, scores, square, sides, scale, freedom, count):
    """Log Bayes factor of explanations together against the null hypothesis.

    Args:
        gram: (n, n) products of their whitened directions. scores: (n,) products with the
            deviations. square: of the deviations' length.
        sides: (n,) +1 or -1 where the sign of an amplitude is known, else 0; several such
            amplitudes count as independent in the posterior.
        scale: (n,) standard deviation of each amplitude, in units of its direction.
        freedom: degrees of freedom of the noise estimate; the evidence integrates over the
            noise's unknown scale, so with few a misfit counts less.
        count: of readings.
    """
    n = len(scores)
    lower, half = np.zeros((n, n)), np.empty(n)
    log_det = explained = 0.0
    for i in range(n):
        for j in range(i + 1):
            value = gram[i, j] * scale[i] * scale[j]
            for k in range(j):
                value -= lower[i, k] * lower[j, k]
            if i == j:
                lower[i, i] = math.sqrt(max(value + 1.0, 1e-12))
                log_det += 2.0 * math.log(lower[i, i])
            else:
                lower[i, j] = value / lower[j, j]
        value = scores[i] * scale[i]
        for k in range(i):
            value -= lower[i, k] * half[k]
        half[i] = value / lower[i, i]
        explained += half[i] * half[i]
    if freedom < KNOWN_NOISE:
        share = min(explained / (freedom + square), 1.0 - 1e-12)
        factor = -0.5 * (freedom + count) * math.log1p(-share) - 0.5 * log_det
    else:
        factor = 0.5 * (explained - log_det)
    if not sides.any():
        return factor
    mean, column = np.empty(n), np.empty(n)
    for i in range(n - 1, -1, -1):
        value = half[i]
        for k in range(i + 1, n):
            value -= lower[k, i] * mean[k]
        mean[i] = value / lower[i, i]
    for i in range(n):
        if sides[i] != 0.0:
            variance = 0.0
            for row in range(i, n):
                value = 1.0 if row == i else 0.0
                for k in range(i, row):
                    value -= lower[row, k] * column[k]
                column[row] = value / lower[row, row]
                variance += column[row] * column[row]
            factor += math.log(2.0) + log_normal_cdf(sides[i] * mean[i] / math.sqrt(variance))
    return factor


def evidence(columns: np.ndarray, null: NullModel, freedom: float) -> float:
    """Log Bayes factor of whitened directions (P, n), of unit variance each, against the null."""
    count = columns.shape[1]
    return log_bayes_factor(
        columns.T @ columns, columns.T @ null.deviation, float(null.deviation @ null.deviation),
        np.zeros(count), np.ones(count), min(freedom, 2.0 * KNOWN_NOISE), len(null.deviation),
    )  # fmt: skip
