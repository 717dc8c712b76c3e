"""Evidence (marginal likelihood) of what may be missing, in closed form.

Around the fitted model the readings are linear in the pattern's parameters and in the amplitudes
of every explanation, all with normal priors. Integrated over these, the deviations are normal
with a known covariance. Whitening them by the covariance under the null hypothesis removes the
pattern's parameters; every explanation then adds a low-rank term to the identity.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr

from paint_deposition.inference.fitting.least_squares import Fit, covariance_factor

# More degrees of freedom than this count as a noise that is known.
KNOWN_NOISE = 1e9
# An entry of a fit this close to a bound has been stopped by it.
AT_BOUND = 1e-6
# A direction whose squared length, in standard deviations, is less cannot be seen.
UNSEEN = 1e-9


@dataclass(frozen=True)
class NullModel:
    """The null hypothesis that nothing is missing, as the distribution it gives the readings.

    Attributes:
        columns: (P, m) directions in which the base model and the nuisance vary, for unit
            amplitudes, over the noise.
        raw: (P,) deviations over the noise from the base model at the centre of its priors.
        lower: (P, P) Cholesky factor of the deviations' covariance.
        deviation: (P,) whitened deviations; standard normal if nothing is missing.
    """

    columns: np.ndarray
    raw: np.ndarray
    lower: np.ndarray
    deviation: np.ndarray

    @staticmethod
    def of(columns: np.ndarray, raw: np.ndarray) -> 'NullModel':
        """From directions (P, m) and deviations (P,)."""
        lower = covariance_factor(columns)
        return NullModel(columns, raw, lower, solve_triangular(lower, raw, lower=True))

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
        # What the fit has driven to a bound of physics does not go on beyond it.
        ends = np.isclose(fit.vector, fit.parameters.bounds, rtol=0.0, atol=AT_BOUND)
        free = ~ends.any(axis=0)
        # The shape of an effect that is not there contributes nothing; its amplitude does.
        shape = np.array([False] * pattern + [entry.is_shape for entry in entries])
        counted = free & (kept | ~shape)
        kept &= free
        raw = fit.residual + fit.jacobian[:, counted] @ (fit.vector - prior.centre)[counted]
        directions = fit.jacobian[:, kept] @ prior.factor[np.ix_(kept, kept)]
        return NullModel.of(np.hstack([directions, nuisance]), raw)

    def whiten(self, columns: np.ndarray) -> np.ndarray:
        """(P, n) directions of the readings, whitened like the deviations."""
        return solve_triangular(self.lower, columns, lower=True)

    def select(self, rows: np.ndarray) -> 'NullModel':
        """The same for some of the readings."""
        return NullModel.of(self.columns[rows], self.raw[rows])


@dataclass(frozen=True)
class Principal:
    """Whitened directions of one explanation, turned to be orthogonal to each other.

    Attributes:
        columns: (P, m) the directions.
        axes: (n, m) what each amplitude, a row, is along them.
        signed: (q, m) rows of the amplitudes whose sign is known. sides: (q,) +1 or -1.
    """

    columns: np.ndarray
    axes: np.ndarray
    signed: np.ndarray
    sides: np.ndarray

    @staticmethod
    def of(columns: np.ndarray, sides: np.ndarray) -> 'Principal':
        """Turn whitened directions (P, n), with sides (n,) that are 0 where no sign is known.

        Where none is known, directions that do not show are left out: a map of hundreds of knots
        has no more of them than there are readings.
        """
        known = sides != 0.0
        if known.any():
            _, axes = np.linalg.eigh(columns.T @ columns)
            return Principal(columns @ axes, axes, axes[known], sides[known])
        wide = columns.shape[1] > len(columns)
        squares, turned = np.linalg.eigh(columns @ columns.T if wide else columns.T @ columns)
        shown = squares > UNSEEN
        turned, lengths = turned[:, shown], np.sqrt(squares[shown])
        if wide:
            turned, axes = turned * lengths, columns.T @ (turned / lengths)
        else:
            turned, axes = columns @ turned, turned
        return Principal(turned, axes, axes[known], sides[known])

    @cached_property
    def squares(self) -> np.ndarray:
        """(m,) squared lengths of the directions."""
        return np.sum(self.columns**2, axis=0)

    def length(self, amplitudes: np.ndarray, some: slice = slice(None)) -> np.ndarray:
        """(...) standard deviations by which original amplitudes (..., n), or some, move all."""
        return np.sqrt((amplitudes[..., some] @ self.axes[some]) ** 2 @ self.squares)

    def amplitudes(self, deviation: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """(S, n) posterior means of the original amplitudes at each of S sizes.

        Args:
            deviation: (P,) whitened.
            sizes: (S,) standard deviations of the amplitudes before the readings.
        """
        precision = sizes[:, np.newaxis] ** -2.0 + self.squares
        return (self.columns.T @ deviation / precision) @ self.axes.T

    def log_bayes_factors(
        self,
        deviations: np.ndarray,
        sizes: np.ndarray,
        freedom: float,
        shifts: np.ndarray | None = None,
    ) -> np.ndarray:
        """(S, D) log Bayes factors against the null hypothesis, at S sizes, for D deviations.

        Args:
            deviations: (P, D) whitened.
            sizes: (S,) standard deviations of the amplitudes before the readings.
            freedom: degrees of freedom of the noise estimate.
            shifts: (P, R), each of which is added to all deviations: R times as many.
        """
        scores, squares = self.columns.T @ deviations, np.sum(deviations**2, axis=0)
        if shifts is not None:
            added = (self.columns.T @ shifts)[:, :, np.newaxis]
            scores = (added + scores[:, np.newaxis]).reshape(len(scores), -1)
            both = np.sum(shifts**2, axis=0)[:, np.newaxis] + 2.0 * shifts.T @ deviations
            squares = (squares + both).ravel()
        sizes = sizes[:, np.newaxis]
        precision = 1.0 + sizes**2 * self.squares
        explained = (sizes**2 / precision) @ scores**2
        factors = -0.5 * np.log(precision).sum(axis=1, keepdims=True)
        if np.isfinite(freedom):
            count = freedom + len(deviations)
            factors = factors - 0.5 * count * np.log1p(-explained / (freedom + squares))
        else:
            factors = factors + 0.5 * explained
        for row, side in zip(self.signed, self.sides, strict=True):
            mean = (sizes * row / precision) @ scores
            deviation = np.sqrt((row**2 / precision).sum(axis=1, keepdims=True))
            factors += np.log(2.0) + log_ndtr(side * mean / deviation)
        return factors


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


@njit(cache=True, nogil=True)
def log_normal_cdf(x):
    """Logarithm of the standard normal distribution function."""
    if x > -30.0:
        return math.log(0.5 * math.erfc(-x / math.sqrt(2.0)))
    return -0.5 * x * x - math.log(-x * math.sqrt(2.0 * math.pi))


@njit(cache=True, nogil=True, fastmath={'reassoc', 'contract'})
def log_bayes_factor(gram, scores, square, signed, sides, scale, freedom, count, orthogonal=0):
    """Log Bayes factor of explanations together against the null hypothesis.

    Args:
        gram: (n, n) products of their whitened directions; of those that are orthogonal to each
            other only the diagonal is read.
        scores: (n,) products with the deviations. square: of the deviations' length.
        signed: (q, n) sums of amplitudes, each in units of its standard deviation, whose sign is
            known; they count as independent in the posterior. sides: (q,) +1 or -1.
        scale: (n,) standard deviation of each amplitude, in units of its direction.
        freedom: degrees of freedom of the noise estimate; the evidence integrates over the
            noise's unknown scale, so with few a misfit counts less.
        count: of readings.
        orthogonal: how many of the directions, the first ones, are orthogonal to each other.
    """
    n = len(scores)
    # Cholesky factor of the amplitudes' posterior precision; its first rows are diagonal.
    lower, pivot, half = np.empty((n, n)), np.empty(n), np.empty(n)
    log_det = explained = 0.0
    for i in range(n):
        for j in range(orthogonal if i >= orthogonal else 0):
            lower[i, j] = gram[i, j] * scale[i] * scale[j] / pivot[j]
        for j in range(orthogonal, i):
            value = gram[i, j] * scale[i] * scale[j]
            for k in range(j):
                value -= lower[i, k] * lower[j, k]
            lower[i, j] = value / pivot[j]
        value = 1.0 + gram[i, i] * scale[i] ** 2
        for k in range(i if i >= orthogonal else 0):
            value -= lower[i, k] ** 2
        pivot[i] = math.sqrt(max(value, 1e-12))
        log_det += 2.0 * math.log(pivot[i])
        half[i] = scores[i] * scale[i]
    _solve(lower, pivot, half, orthogonal)
    for i in range(n):
        explained += half[i] ** 2
    if freedom < KNOWN_NOISE:
        share = min(explained / (freedom + square), 1.0 - 1e-12)
        factor = -0.5 * (freedom + count) * math.log1p(-share) - 0.5 * log_det
    else:
        factor = 0.5 * (explained - log_det)
    for q in range(len(sides)):
        column = signed[q].copy()
        _solve(lower, pivot, column, orthogonal)
        mean = variance = 0.0
        for i in range(n):
            mean += column[i] * half[i]
            variance += column[i] ** 2
        factor += math.log(2.0) + log_normal_cdf(sides[q] * mean / math.sqrt(variance))
    return factor


@njit(cache=True, nogil=True, fastmath={'reassoc', 'contract'})
def _solve(lower, pivot, column, orthogonal):
    """Divide a column (n,) by a lower triangle, in place; its first rows are diagonal."""
    for i in range(len(column)):
        value = column[i]
        for k in range(i if i >= orthogonal else 0):
            value -= lower[i, k] * column[k]
        column[i] = value / pivot[i]
