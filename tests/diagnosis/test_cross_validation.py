"""Leaving out blocks by moving the fit linearly is refitting, where the model is linear."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from diagnosis.linear import KNOWN, PARAMETERS, bounds, fit_linear, linear_fit, null_of
from paint_deposition.diagnosis import cross_validation
from paint_deposition.diagnosis.cross_validation import hold_out, nested_rmse_um
from paint_deposition.diagnosis.evidence import NullModel
from paint_deposition.diagnosis.explanations import UNKNOWN, Explanation
from paint_deposition.diagnosis.model_space import ModelSpace
from paint_deposition.diagnosis.sensitivities import Sensitivity
from paint_deposition.diagnosis.smooth_laws import CurveBasis
from paint_deposition.effects.learned import LEARNED
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.readings.residuals import root_mean_square

READINGS = 24
BLOCKS = np.arange(READINGS) % 5


@pytest.fixture(params=[PARAMETERS, KNOWN], ids=['weak', 'known'])
def fit(request):
    return linear_fit(np.random.default_rng(8), READINGS, parameters=request.param)


def test_the_linear_update_is_a_refit(fit):
    data = fit.predicted_um + fit.residual
    expected, score = np.empty(READINGS), 0.0
    for block in range(5):
        out = block == BLOCKS
        kept = fit_linear(fit.jacobian[~out], data[~out], fit.parameters)
        expected[out] = data[out] - fit.jacobian[out] @ kept.vector
        spread = np.eye(out.sum()) + fit.jacobian[out] @ kept.covariance @ fit.jacobian[out].T
        score += multivariate_normal.logpdf(expected[out], cov=spread)
    left_out = hold_out(fit, BLOCKS)
    assert left_out.deviation == pytest.approx(expected)
    assert left_out.log_score == pytest.approx(score / READINGS)


def test_everything_left_out_is_predicted_by_the_priors(fit):
    prior = fit.parameters.prior
    data = fit.predicted_um + fit.residual
    left_out = hold_out(fit, np.zeros(READINGS))
    scaled = fit.jacobian @ prior.factor
    density = multivariate_normal(
        fit.jacobian @ prior.centre, np.eye(READINGS) + scaled @ scaled.T
    )
    assert left_out.deviation == pytest.approx(data - fit.jacobian @ prior.centre)
    assert left_out.log_score == pytest.approx(density.logpdf(data) / READINGS)


def test_readings_left_out_are_predicted_worse_than_fitted_ones():
    random = np.random.default_rng(9)
    worse = 0
    for _ in range(20):
        fit = linear_fit(random, READINGS)
        worse += np.sum(hold_out(fit, BLOCKS).deviation ** 2) > fit.chi_square
    assert worse == 20


# Choosing causes and curves without the points left out.

POINTS, SIGMA_UM = 80, 0.7
PATCHES = np.arange(POINTS) // 8


def space_of(change: np.ndarray, form: np.ndarray, seed: int = 0) -> ModelSpace:
    """An effect of this form (P,) and curves over the place, on readings moved by a change."""
    fit = linear_fit(np.random.default_rng(seed), POINTS)
    base = null_of(fit)
    null = NullModel.of(base.columns, base.raw + change)
    law = Sensitivity(EdgeBuild(), ('peak',), form[:, np.newaxis], *bounds([1]))
    knots = 8
    at = np.linspace(0.0, knots - 1.0, POINTS)
    film = np.maximum(0.0, 1.0 - np.abs(at[:, np.newaxis] - np.arange(knots)))
    basis = CurveBasis(LEARNED['height_fraction'], 'factor', 0.0, 1.0, film, at.std())
    values = basis.root(0.5)
    curve = Explanation(
        UNKNOWN, film @ values, np.zeros(values.shape[1]), 1.0, curve=(basis, values)
    )
    return ModelSpace(
        null, [Explanation(EdgeBuild.id, law.columns, law.sides, 1.0, law), curve], np.inf
    )


FORM = np.where(np.arange(POINTS) % 4 == 0, 2.0, 0.2)
WAVE = 3.0 * np.sin(np.linspace(0.0, 7.0, POINTS))


def nested(space: ModelSpace, curves: bool) -> float:
    """In standard deviations of the noise."""
    return nested_rmse_um(space, PATCHES, np.full(POINTS, SIGMA_UM), curves) / SIGMA_UM


@pytest.mark.parametrize('curves', [False, True])
def test_on_noise_the_nested_error_is_larger_than_the_fitted_one(curves):
    for seed in range(5):
        space = space_of(np.zeros(POINTS), FORM, seed)
        fitted = linear_fit(np.random.default_rng(seed), POINTS).residual
        assert nested(space, curves) > root_mean_square(fitted)


def test_what_acts_lowers_the_nested_error_to_the_noise():
    """The effect by its law; the wave, which no law has, by a learned curve only."""
    effect = space_of(2.0 * FORM, FORM)
    assert nested(effect, curves=False) == pytest.approx(1.0, abs=0.25)
    wave = space_of(WAVE, FORM)
    assert nested(wave, curves=False) > 1.7
    assert nested(wave, curves=True) == pytest.approx(1.0, abs=0.3)
    both = space_of(WAVE + 2.0 * FORM, FORM)
    assert nested(both, curves=True) < 0.8 * nested(both, curves=False)


def test_a_point_left_out_has_no_part_in_its_own_prediction(monkeypatch):
    """However wrong a block is, what is predicted there stays as it is."""
    monkeypatch.setattr(cross_validation, 'FOLDS', len(np.unique(PATCHES)))
    out = PATCHES == 3
    errors = []
    for amount in (0.0, 100.0):
        space = space_of(2.0 * FORM + amount * out, FORM)
        part = space.select(~out)
        errors.append(part.inclusion(EdgeBuild.id))
        rest = cross_validation._chosen_columns(space, ~out, True)
        errors.append(np.linalg.norm(np.hstack(rest)))
    assert errors[:2] == pytest.approx(errors[2:], rel=1e-12)
    assert errors[0] > 0.9
