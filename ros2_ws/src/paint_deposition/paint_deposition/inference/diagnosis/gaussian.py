"""Evidence (marginal likelihood) of what may be missing, in closed form.

Around the fitted model the readings are linear in the pattern's parameters and in the amplitudes
of every explanation, all with normal priors. Integrated over these, the deviations are normal
with a known covariance. Whitening them by the covariance under the null hypothesis removes the
pattern's parameters; every explanation then adds a low-rank term to the identity.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr

from paint_deposition.inference.fitting.least_squares import Fit, covariance_factor

# Of q parameters at bounds: (P, q) change of the readings over the noise for a step inward, the
# others following; (q,) slope and precision of their prior there, and its log density.
AtBounds = tuple[np.ndarray, np.ndarray, np.ndarray, float]


@dataclass(frozen=True)
class NullModel:
    """The null hypothesis that nothing is missing, as the distribution it gives the readings."""

    # (P, m) directions in which the base model and the nuisance vary, for unit amplitudes, over
    # the noise.
    columns: np.ndarray
    # (P,) deviations over the noise from the base model at the centre of its priors.
    scaled_deviation: np.ndarray
    # (P, P) covariance of the discrepancy, or None if nothing is.
    discrepancy: np.ndarray | None
    lower: np.ndarray  # (P, P) Cholesky factor of the deviations' covariance
    deviation: np.ndarray  # (P,) whitened deviations; standard normal if nothing is missing
    held: AtBounds | None  # parameters that the fit has driven to bounds of physics, if any

    @staticmethod
    def of(
        columns: np.ndarray,
        scaled_deviation: np.ndarray,
        discrepancy: np.ndarray | None = None,
        held: AtBounds | None = None,
    ) -> 'NullModel':
        """From directions (P, m), deviations (P,), what is left over, and what is held."""
        lower = covariance_factor(columns, discrepancy)
        deviation = solve_triangular(lower, scaled_deviation, lower=True, check_finite=False)
        return NullModel(columns, scaled_deviation, discrepancy, lower, deviation, held)

    @staticmethod
    def around(
        fit: Fit,
        nuisance: np.ndarray,
        discrepancy: np.ndarray | None = None,
    ) -> 'NullModel':
        """Linear around a fit, with nuisance directions (P, n) over the noise.

        Args:
            nuisance: directions that carry no meaning.
            discrepancy: (P, P) covariance of the discrepancy.
        """
        prior, jacobian = fit.parameters.prior, fit.jacobian
        away, covariance = fit.vector - prior.centre, prior.factor @ prior.factor.T
        # What the fit has driven to a bound of physics does not go on beyond it.
        low, high = np.isclose(fit.vector, fit.parameters.bounds, rtol=0.0, atol=1e-6)
        free, held = ~(low | high), None
        if not free.all():
            ends = ~free
            inward = np.where(low, 1.0, -1.0)[ends]
            precision = np.linalg.inv(covariance[np.ix_(ends, ends)])
            # The others are then as they are given what is held.
            by_held = covariance[np.ix_(free, ends)] @ precision
            moved = inward * (jacobian[:, ends] + jacobian[:, free] @ by_held)
            pull, log_det = precision @ away[ends], np.linalg.slogdet(precision / (2.0 * np.pi))[1]
            log_density = 0.5 * (log_det - away[ends] @ pull)
            held = (moved, inward * pull, np.diag(precision), float(log_density))
            away = away[free] - by_held @ away[ends]
            covariance = covariance[np.ix_(free, free)] - by_held @ covariance[np.ix_(ends, free)]
        raw = fit.residual + jacobian[:, free] @ away
        directions = jacobian[:, free] @ np.linalg.cholesky(covariance)
        return NullModel.of(np.hstack([directions, nuisance]), raw, discrepancy, held)

    def beside(self, more: np.ndarray) -> 'NullModel':
        """The null hypothesis with some more directions (P, n), if any, that may vary."""
        if not more.size:
            return self
        return NullModel.of(
            np.hstack([self.columns, more]), self.scaled_deviation, self.discrepancy, self.held
        )

    def with_discrepancy(self, discrepancy: np.ndarray) -> 'NullModel':
        """The null hypothesis with another covariance (P, P) of the discrepancy."""
        return NullModel.of(self.columns, self.scaled_deviation, discrepancy, self.held)

    def log_evidence(self, deviations: np.ndarray, freedom: float) -> np.ndarray:
        """(D,) log likelihood of whitened deviations (P, D), the noise's scale integrated out.

        Args:
            deviations: of the readings, or simulated. freedom: of the noise estimate.
        """
        constant = self.log_inward - np.log(np.diag(self.lower)).sum()
        squares = np.sum(deviations**2, axis=0)
        if not np.isfinite(freedom):
            return constant - 0.5 * squares
        count = freedom + len(self.scaled_deviation)
        return constant - 0.5 * count * np.log1p(squares / freedom)

    @cached_property
    def log_inward(self) -> float:
        """What the evidence has from parameters at bounds: the integral from there inward.

        Each of several by itself. Along one the density falls as exp(-a t - b t^2 / 2): it does
        not rise, since the fit would not have stayed there.
        """
        if self.held is None:
            return 0.0
        columns, pull, precision, log_density = self.held
        shown = self.whiten(columns)
        root = np.sqrt(precision + np.sum(shown**2, axis=0))
        slope = np.maximum(pull - shown.T @ self.deviation, 0.0) / root
        integral = 0.5 * np.log(2.0 * np.pi) - np.log(root) + 0.5 * slope**2 + log_ndtr(-slope)
        return log_density + float(integral.sum())

    def first(self, count: int) -> 'NullModel':
        """The same for the first so many of the readings; nothing is factored anew."""
        discrepancy = self.discrepancy
        return NullModel(
            self.columns[:count],
            self.scaled_deviation[:count],
            None if discrepancy is None else discrepancy[:count, :count],
            self.lower[:count, :count],
            self.deviation[:count],
            self.held and (self.held[0][:count], *self.held[1:]),
        )

    def predicted(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Deviations of the last Q readings, given the first so many.

        Returns:
            Their mean (Q,), and the lower Cholesky factor (Q, Q) of their covariance.
        """
        known, more = self.lower[count:, :count], self.lower[count:, count:]
        return known @ self.deviation[:count], more

    def whiten(self, columns: np.ndarray) -> np.ndarray:
        """(P, n) directions of the readings, whitened like the deviations."""
        return solve_triangular(self.lower, columns, lower=True, check_finite=False)

    def select(self, rows: np.ndarray) -> 'NullModel':
        """The null hypothesis for some of the readings."""
        kept = None if self.discrepancy is None else self.discrepancy[np.ix_(rows, rows)]
        held = self.held and (self.held[0][rows], *self.held[1:])
        return NullModel.of(self.columns[rows], self.scaled_deviation[rows], kept, held)


@dataclass(frozen=True)
class OrthogonalDirections:
    """Whitened directions of one explanation, turned to be orthogonal to each other."""

    columns: np.ndarray  # (P, m) the directions
    axes: np.ndarray  # (n, m) what each amplitude, a row, is along them
    signed: np.ndarray  # (q, m) rows of the amplitudes whose sign is known
    sides: np.ndarray  # (q,) +1 or -1

    @staticmethod
    def of(columns: np.ndarray, sides: np.ndarray) -> 'OrthogonalDirections':
        """Turn whitened directions (P, n), with sides (n,) that are 0 where no sign is known.

        Where none is known, directions that do not show are left out: a map of hundreds of knots
        has no more of them than there are readings.
        """
        known = sides != 0.0
        if known.any():
            _, axes = np.linalg.eigh(columns.T @ columns)
            return OrthogonalDirections(columns @ axes, axes, axes[known], sides[known])
        wide = columns.shape[1] > len(columns)
        squares, turned = np.linalg.eigh(columns @ columns.T if wide else columns.T @ columns)
        # A direction whose squared length, in standard deviations, is less cannot be seen.
        shown = squares > 1e-9
        turned, lengths = turned[:, shown], np.sqrt(squares[shown])
        if wide:
            turned, axes = turned * lengths, columns.T @ (turned / lengths)
        else:
            turned, axes = columns @ turned, turned
        return OrthogonalDirections(turned, axes, axes[known], sides[known])

    @cached_property
    def squares(self) -> np.ndarray:
        """(m,) squared lengths of the directions."""
        return np.sum(self.columns**2, axis=0)

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
        noise = np.ones_like(explained)
        if np.isfinite(freedom):
            count = freedom + len(deviations)
            factors = factors - 0.5 * count * np.log1p(-explained / (freedom + squares))
            # Size of the noise that is left, over that which was told.
            noise = np.sqrt((freedom + squares - explained) / count)
        else:
            factors = factors + 0.5 * explained
        for row, side in zip(self.signed, self.sides, strict=True):
            mean = (sizes * row / precision) @ scores
            deviation = np.sqrt((row**2 / precision).sum(axis=1, keepdims=True))
            factors += np.log(2.0) + log_ndtr(side * mean / (deviation * noise))
        return factors


def simulated(
    count: int, freedom: float, draws: int, seed: int | np.random.Generator
) -> np.ndarray:
    """(count, draws) whitened deviations under the null hypothesis.

    The scale of the noise varies between draws as that of an estimate with ``freedom`` degrees of
    freedom.
    """
    random = np.random.default_rng(seed)
    deviations = random.normal(size=(count, draws))
    if np.isfinite(freedom):
        deviations /= np.sqrt(random.chisquare(freedom, draws) / freedom)
    return deviations
