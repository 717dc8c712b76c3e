"""Fits of models that are exactly linear, to compare closed forms with direct ones."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned.curves import CURVES
from paint_deposition.effects.learned.law import LearnedFootprint, hat_weights
from paint_deposition.inference.diagnosis.discrepancy import Footprints, ModelDiscrepancy
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, Explanation, Sensitivity
from paint_deposition.inference.diagnosis.gaussian import NullModel
from paint_deposition.inference.diagnosis.smooth_laws import Basis, RandomLaw
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.posterior import Posterior

MODEL = DepositionModel()
PARAMETERS = FreeParameters.of(MODEL)


def correlated(parameters: FreeParameters, seed: int = 0) -> Posterior:
    """A posterior narrower than the weak prior, in which every coordinate goes with all others."""
    prior, random = parameters.weak_prior, np.random.default_rng(seed)
    root = random.normal(size=(len(parameters), len(parameters))) / 5.0
    covariance = np.outer(prior.width, prior.width) * (root @ root.T)
    covariance *= np.outer(parameters.scale, parameters.scale)
    centre = parameters.offset + parameters.scale * (prior.centre + 0.1 * prior.width)
    readings = ('those of another job',)
    return Posterior.of(parameters.coordinates, centre, covariance, readings=readings)


# The same parameters after another job.
KNOWN = replace(PARAMETERS, known=correlated(PARAMETERS))


def linear_fit(
    random: np.random.Generator,
    count: int,
    data: np.ndarray | None = None,
    parameters: FreeParameters = PARAMETERS,
) -> Fit:
    """A fit of readings (count,), drawn if not given, of a linear model with noise 1."""
    prior = parameters.prior
    jacobian = random.normal(size=(count, len(prior.centre))) @ prior.whitening
    if data is None:
        data = jacobian @ (prior.centre + prior.factor @ random.normal(size=len(prior.centre)))
        data = data + random.normal(size=count)
    return fit_linear(jacobian, data, parameters)


def fit_linear(
    jacobian: np.ndarray, data: np.ndarray, parameters: FreeParameters = PARAMETERS
) -> Fit:
    """The most probable values (ridge regression toward the priors)."""
    prior = parameters.prior
    covariance = prior.factor @ prior.factor.T
    gain = covariance @ jacobian.T
    innovation = np.eye(len(data)) + jacobian @ gain
    misfit = data - jacobian @ prior.centre
    vector = prior.centre + gain @ np.linalg.solve(innovation, misfit)
    predicted = jacobian @ vector
    nuisance = np.empty((len(data), 0))
    return Fit(
        parameters, vector, parameters.start, predicted, data - predicted, jacobian, True, nuisance
    )


def null_of(fit: Fit, nuisance: np.ndarray | None = None) -> NullModel:
    """The null hypothesis around a fit, with nuisance directions (P, n) or none."""
    return NullModel.around(fit, fit.nuisance if nuisance is None else nuisance)


def smooth_curves(place: np.ndarray, knots: int, length: float) -> RandomLaw:
    """Curves of unit size over a covariate of which each reading has one value, in knots (P,)."""
    spread = float(np.std(place))
    at = np.arange(knots)[:, np.newaxis] / spread
    basis = Basis(CURVES['height_fraction'], {}, hat_weights(place, knots), at, 1.0 / spread)
    return basis.random(1.0, length)


def no_discrepancy(count: int) -> ModelDiscrepancy:
    """No discrepancy at so many readings."""
    none = np.zeros((count, count))
    lengths_m = (0.02, 0.05, 0.1)
    fields, one_setting = 3 * (none,), np.zeros(count, dtype=int)
    laws = 3 * (footprint_law(none[:1, :1]),)
    footprint = Footprints(3 * (none[:, :1],), laws, none[0, :1], none[0, :1])
    return ModelDiscrepancy(MODEL, footprint, none, fields, fields, False, lengths_m, one_setting)


def footprint_law(at_knots: np.ndarray) -> RandomLaw:
    """A deviation of a footprint that shows in no reading, by its values (K, n) at knots."""
    none = np.empty((0, len(at_knots)))
    return RandomLaw(Basis(LearnedFootprint, {}, none, none.T, 1.0), at_knots)


def prior_covariance(fit: Fit) -> np.ndarray:
    """(P, P) covariance of readings that the base model predicts before it is fitted."""
    scaled = fit.jacobian @ fit.parameters.prior.factor
    return np.eye(len(fit.residual)) + scaled @ scaled.T


def deviation(fit: Fit) -> np.ndarray:
    """(P,) data minus prediction at the priors' centre."""
    return fit.residual + fit.jacobian @ (fit.vector - fit.parameters.prior.centre)


def explanation_of(
    effect: Effect, *columns: np.ndarray, sides: Sequence[int], share: float = 1.0
) -> Explanation:
    """An effect by the directions (P,) of its first amplitudes, which are ten sizes wide."""
    known = np.array(sides, dtype=float)
    low, high = np.where(known > 0, 0.0, -10.0), np.where(known < 0, 0.0, 10.0)
    names = type(effect).amplitudes()[: len(columns)]
    law = Sensitivity(effect, names, np.column_stack(columns), low, high)
    return Explanation(effect.id, law.columns, law.sides, share, law)


def unknown(columns: np.ndarray, share: float = 1.0) -> Explanation:
    """A law of any form by its directions (P, n)."""
    return Explanation(UNKNOWN, columns, np.zeros(columns.shape[1]), share)
