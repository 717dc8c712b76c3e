"""Weighted least squares on the readings, through the forward simulation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import OptimizeResult, least_squares, lsq_linear
from scipy.special import ndtri
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.layout import term_weights
from paint_deposition.inference.fitting.forward import Forward, OfWeights, derivatives_by_pattern
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.pattern_vector import COS, SIN
from paint_deposition.kernel.eq2_flux import BY_COS, BY_SIN, CENTRED, EVEN, TERMS

# Steps of the finite differences by effects, in the vector's units.
STEP = 1e-3
# Patterns whose shapes differ by less, in standard deviations of the prior, are one start.
APART = 0.3

# For functions: BLAS has one thread while they run. Threads that share matrices as small as those
# of a fit mostly wait for each other, on a busy machine ten times as long as the work takes.
on_one_thread = threadpool_limits.wrap(limits=1, user_api='blas')


@dataclass(frozen=True)
class Fit:
    """A model fitted to readings."""

    parameters: FreeParameters  # what was varied
    vector: np.ndarray  # (k,) best values
    model: DepositionModel  # the model they stand for
    predicted_um: np.ndarray  # (P,) [um]
    residual: np.ndarray  # (P,) measured minus predicted, over the standard deviation
    jacobian: np.ndarray  # (P, k) derivative of predictions over the standard deviation
    converged: bool  # whether the last search ended by itself
    # (P, n) nuisance directions that the fit allowed for, over the standard deviation; their
    # amplitudes are independent and standard normal.
    nuisance: np.ndarray
    # (P, P) covariance of the discrepancy, which the fit allowed for, or None if it did
    # not.
    discrepancy: np.ndarray | None = None

    @cached_property
    def marginal(self) -> 'Fit':
        """The fit with residual and Jacobian whitened by nuisance and discrepancy, too."""
        factor = covariance_factor(self.nuisance, self.discrepancy)
        return replace(
            self,
            residual=solve_triangular(factor, self.residual, lower=True),
            jacobian=solve_triangular(factor, self.jacobian, lower=True),
            nuisance=self.nuisance[:, :0],
            discrepancy=None,
        )

    @cached_property
    def amplitudes(self) -> tuple[np.ndarray, np.ndarray]:
        """Posterior mean (n,) and covariance (n, n) of the nuisance directions' amplitudes.

        The model is linear around the fit, its vector is not known exactly either, and there is
        the discrepancy.
        """
        prior, count = self.parameters.prior, self.nuisance.shape[1]
        columns = np.hstack([self.nuisance, self.jacobian @ prior.factor])
        raw = self.residual + self.jacobian @ (self.vector - prior.centre)
        if self.discrepancy is not None:
            factor = covariance_factor(self.nuisance[:, :0], self.discrepancy)
            whitened = solve_triangular(factor, np.column_stack([raw, columns]), lower=True)
            raw, columns = whitened[:, 0], whitened[:, 1:]
        covariance = np.linalg.inv(np.eye(columns.shape[1]) + columns.T @ columns)
        mean = covariance @ (columns.T @ raw)
        return mean[:count], covariance[:count, :count]

    @property
    def chi_square(self) -> float:
        """Sum of squared residuals over the standard deviation."""
        return float(self.residual @ self.residual)

    @property
    def chi_square_per_freedom(self) -> float:
        """About 1 where only noise is left."""
        return self.chi_square / max(len(self.residual) - len(self.vector), 1)

    @property
    def objective(self) -> float:
        """What the fit minimises: chi-square, nuisance integrated out, and that of the prior."""
        away = self.parameters.prior.whiten(self.vector)
        return self.marginal.chi_square + float(np.sum(away**2))


def fit_readings(
    forward: Forward,
    measured_um: np.ndarray,
    sigma_um: np.ndarray,
    parameters: FreeParameters,
    starts: int = 1,
    seed: int = 0,
    nuisance: np.ndarray | None = None,
    discrepancy: np.ndarray | None = None,
    others: Sequence[DepositionModel] = (),
) -> Fit:
    """Find the most probable values (maximum a posteriori).

    Args:
        measured_um, sigma_um: (P,) point means and their standard deviations [um].
        parameters: what is varied; its start model is the first start.
        starts: how many starts; others are the best of many shapes of the pattern around the
            first, drawn with the given seed.
        nuisance: (P, n) nuisance directions, over the standard deviation, along which the
            readings may deviate further with unit variance; default: none.
        discrepancy: (P, P) covariance of the discrepancy; default: nothing is.
        others: models whose patterns are starts, too, of which the best is taken to the end.
    """
    if nuisance is None:
        nuisance = np.empty((len(measured_um), 0))
    problem = _Problem(forward, measured_um, sigma_um, parameters, nuisance, discrepancy)
    first = problem.scaled_to_mean(parameters.encode(parameters.start))
    candidates = [first]
    if starts > 1:
        candidates += _best_starts(problem, first, starts - 1, seed)
    for other in others:
        start = parameters.encode(parameters.start.with_patterns(other.patterns))
        # Patterns whose shapes differ by less lead to the same fit.
        away = (np.array(candidates) - start) / problem.prior.width
        if np.abs(away[:, problem.shape]).max(axis=1).min() > APART:
            candidates.append(start)
    if len(candidates) > 1:
        # A few steps from each start; the best are refined.
        rough = [problem.search(start, 6) for start in candidates]
        rough.sort(key=lambda result: result.cost)
        candidates = [result.x for result in rough[: 4 if starts > 1 else 1]]
    found = [problem.search(start, 60) for start in candidates]
    best = min(found, key=lambda result: result.cost)
    if best.status == 0:  # along a narrow valley its steps ended first
        best = problem.search(best.x, 300)
    fit = fit_at(forward, measured_um, sigma_um, parameters, best.x, nuisance, discrepancy)
    return replace(fit, converged=bool(best.status > 0))


def fit_at(
    forward: Forward,
    measured_um: np.ndarray,
    sigma_um: np.ndarray,
    parameters: FreeParameters,
    vector: np.ndarray,
    nuisance: np.ndarray,
    discrepancy: np.ndarray | None = None,
) -> Fit:
    """The model of a vector (k,) beside readings, see ``fit_readings``; nothing is fitted."""
    model = parameters.decode(vector)
    predicted = forward.predict_um(model)
    residual = (measured_um - predicted) / sigma_um
    jacobian = derivatives(forward, parameters, vector, sigma_um)
    return Fit(
        parameters, vector, model, predicted, residual, jacobian, True, nuisance, discrepancy
    )


def covariance_factor(directions: np.ndarray, more: np.ndarray | None = None) -> np.ndarray:
    """(P, P) lower Cholesky factor of unit noise with deviations along directions (P, n).

    Args:
        directions: for unit amplitudes.
        more: (P, P) covariance of further deviations.
    """
    covariance = directions @ directions.T
    if more is not None:
        covariance += more
    covariance[np.diag_indices(len(covariance))] += 1.0
    return cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)


def _best_starts(
    problem: '_Problem', first: np.ndarray, count: int, seed: int
) -> list[np.ndarray]:
    """The best of many shapes of the pattern, spread evenly over what bells usually have.

    For given r, sigma1 and sigma2 the film is linear in the gains of ring, centre and asymmetry,
    so that only these three need be searched (variable projection, Golub and Pereyra 1973).
    """
    shape, width = problem.shape, problem.prior.width
    # Eight candidate shapes of the pattern for each start.
    spread = ndtri(qmc.Halton(len(shape), seed=seed).random(8 * count))
    tried = []
    for away in spread:
        vector = first.copy()
        vector[shape] += 0.8 * width[shape] * away
        shaped = np.clip(vector, problem.low, problem.high)
        vector = problem.with_best_gains(shaped)
        cost = np.sum(problem.residuals(vector, problem.of_weights(shaped)) ** 2)
        tried.append((float(cost), vector))
    return [vector for _, vector in sorted(tried, key=lambda pair: pair[0])[:count]]


def derivatives(
    forward: Forward, parameters: FreeParameters, vector: np.ndarray, sigma_um: np.ndarray,
    readings_of: OfWeights | None = None,
) -> np.ndarray:  # fmt: skip
    """(P, k) derivative of the predictions by the vector, over the standard deviation.

    Exact by the pattern; by effects it is the difference of two predictions. ``readings_of`` is
    that of the vector, if it is known.
    """
    model, count = parameters.decode(vector), len(parameters.pattern)
    readings_of = readings_of or forward.of_weights(model)
    here, by_pattern = derivatives_by_pattern(readings_of, model.patterns)
    columns = [by_pattern @ parameters.pattern.jacobian(vector[:count])]
    _, high = parameters.bounds
    for k in range(count, len(vector)):
        step = STEP if vector[k] + STEP <= high[k] else -STEP
        moved = vector.copy()
        moved[k] += step
        change = forward.predict_um(parameters.decode(moved)) - here
        columns.append(change[:, np.newaxis] / step)
    return np.hstack(columns) / sigma_um[:, np.newaxis]


class _Problem:
    """Residuals and their derivatives for the optimiser; the prior gives further residuals."""

    def __init__(
        self, forward: Forward, measured_um: np.ndarray, sigma_um: np.ndarray,
        parameters: FreeParameters, nuisance: np.ndarray, discrepancy: np.ndarray | None,
    ) -> None:  # fmt: skip
        self.forward, self.measured, self.sigma = forward, measured_um, sigma_um
        self.parameters = parameters
        # None spares a solve in every step where readings deviate by noise alone.
        noise_alone = discrepancy is None and not nuisance.size
        self.lower = None if noise_alone else covariance_factor(nuisance, discrepancy)
        self.prior = parameters.prior
        self.low, self.high = parameters.bounds
        self._last: tuple[bytes, OfWeights] | None = None
        # Entries of the pattern's shape; its gains are found from anywhere.
        self.shape = [
            k for k, entry in enumerate(parameters.pattern.coordinates)
            if entry.name.rpartition('.')[2] in ('r_m', 'log_sigma1', 'log_sigma2')
        ]  # fmt: skip

    def of_weights(self, vector: np.ndarray) -> OfWeights:
        key = vector.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = (key, self.forward.of_weights(self.parameters.decode(vector)))
        return self._last[1]

    def predict(self, vector: np.ndarray, readings_of: OfWeights | None = None) -> np.ndarray:
        """(P,) readings [um]; ``readings_of`` is that of a vector that differs in gains only."""
        patterns = self.parameters.decode(vector).patterns
        weights = np.concatenate([term_weights(planar)[0] for planar in patterns])
        return (readings_of or self.of_weights(vector))(weights)

    def whitened(self, columns: np.ndarray) -> np.ndarray:
        return columns if self.lower is None else solve_triangular(self.lower, columns, lower=True)

    def residuals(self, vector: np.ndarray, readings_of: OfWeights | None = None) -> np.ndarray:
        misfit = self.whitened((self.predict(vector, readings_of) - self.measured) / self.sigma)
        return np.concatenate([misfit, self.prior.whiten(vector)])

    def jacobian(self, vector: np.ndarray) -> np.ndarray:
        readings_of = self.of_weights(vector)
        slopes = derivatives(self.forward, self.parameters, vector, self.sigma, readings_of)
        return np.vstack([self.whitened(slopes), self.prior.whitening])

    def scaled_to_mean(self, vector: np.ndarray) -> np.ndarray:
        """The vector with the K1s scaled so that the mean film is right."""
        predicted = self.predict(vector)
        weights = self.sigma**-2.0
        most = float(np.sum(weights * predicted**2))
        ratio = float(np.sum(weights * predicted * self.measured)) / most if most > 0 else 1.0
        scaled, pattern = vector.copy(), self.parameters.pattern
        levels = [pattern.entries(row)[0] for row in range(pattern.count)]
        scaled[levels] += np.log(max(ratio, 1e-3))
        return np.clip(scaled, self.low, self.high)

    def with_best_gains(self, vector: np.ndarray) -> np.ndarray:
        """The vector with the best K1, K2, K3 and phi, as far as other effects are linear.

        Of several brushes K3 and phi are those that are best for the first.
        """
        pattern = self.parameters.pattern
        # For each brush: ring alone, centre alone, asymmetry of the ring along x and y.
        one = np.eye(TERMS)[[EVEN, CENTRED, BY_COS, BY_SIN]]
        one[2:] += one[0]
        parts = np.kron(np.eye(pattern.count), one)
        readings_of = self.of_weights(vector)
        films = np.stack([readings_of(part) for part in parts]) / self.sigma
        films = films.reshape(pattern.count, len(one), -1)
        films[:, 2:] -= films[:, :1]
        # Weight of the prior that there is no asymmetry, as a share of what the ring leaves.
        even = 0.05 * np.linalg.norm(films[:, 0], axis=1)
        evenness = np.kron(np.diag(even), np.eye(len(one))[2:])
        solved = lsq_linear(
            np.vstack([films.reshape(len(parts), -1).T, evenness]),
            np.concatenate([self.measured / self.sigma, np.zeros(len(evenness))]),
            bounds=([0.0, 0.0, -np.inf, -np.inf] * pattern.count, np.inf),
        ).x.reshape(pattern.count, len(one))
        ring, centre = solved[:, 0], solved[:, 1]
        # Below this share of all paint the ring has no measurable asymmetry.
        if np.any(ring <= 0.01 * (ring + centre)):
            return self.scaled_to_mean(vector)
        found = vector.copy()
        for row, (log_k1, k2, *_) in enumerate(map(pattern.entries, range(pattern.count))):
            found[log_k1] = np.log(ring[row] + centre[row])
            found[k2] = centre[row] / (ring[row] + centre[row])
        found[[COS, SIN]] = solved[0, 2:] / ring[0]
        return np.clip(found, self.low, self.high)

    def search(self, start: np.ndarray, most_steps: int) -> OptimizeResult:
        margin = 1e-9 * (self.high - self.low)
        return least_squares(
            self.residuals, np.clip(start, self.low + margin, self.high - margin),
            jac=self.jacobian, bounds=(self.low, self.high), x_scale=self.prior.width,
            max_nfev=most_steps, ftol=1e-6, xtol=1e-6, gtol=1e-6,
        )  # fmt: skip
