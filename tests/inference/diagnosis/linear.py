"""Fits of models that are exactly linear, to compare closed forms with direct ones."""

from dataclasses import replace

import numpy as np

import paint_deposition as pd
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, Explanation
from paint_deposition.inference.diagnosis.gaussian import NullModel
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import FreeParameters, Posterior

MODEL = pd.DepositionModel()
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


def linear_fit(random: np.random.Generator, count: int, parameters=PARAMETERS) -> Fit:
    """A fit of readings (count,) of a linear model with noise 1."""
    prior = parameters.prior
    jacobian = random.normal(size=(count, len(prior.centre))) @ prior.whitening
    data = jacobian @ (prior.centre + prior.factor @ random.normal(size=len(prior.centre)))
    return fit_linear(jacobian, data + random.normal(size=count), parameters)


def fit_linear(jacobian: np.ndarray, data: np.ndarray, parameters=PARAMETERS) -> Fit:
    """The most probable values (ridge regression toward the priors)."""
    prior = parameters.prior
    covariance = prior.factor @ prior.factor.T
    gain = covariance @ jacobian.T
    innovation = np.eye(len(data)) + jacobian @ gain
    misfit = data - jacobian @ prior.centre
    vector = prior.centre + gain @ np.linalg.solve(innovation, misfit)
    predicted = jacobian @ vector
    found = predicted, data - predicted, jacobian, True, np.empty((len(data), 0))
    return Fit(parameters, vector, parameters.start, *found)


def null_of(fit: Fit, nuisance: np.ndarray | None = None) -> NullModel:
    """The null hypothesis around a fit, with nuisance directions (P, n) or none."""
    return NullModel.around(fit, fit.nuisance if nuisance is None else nuisance)


def law(name: str, *columns: np.ndarray, side=1.0, share=1.0, **shape: float) -> Explanation:
    """An effect by the directions (P,) of its amplitudes."""
    sides = np.full(len(columns), side)
    return Explanation(name, np.column_stack(columns), sides, share, EFFECTS[name](**shape))


def unknown(columns: np.ndarray, share: float = 1.0) -> Explanation:
    """A law of any form by its directions (P, n)."""
    return Explanation(UNKNOWN, columns, np.zeros(columns.shape[1]), share)
