"""Leaving out blocks by moving the fit linearly is refitting, where the model is linear."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from diagnosis.linear import PARAMETERS, fit_linear, linear_fit
from paint_deposition.diagnosis.cross_validation import hold_out

READINGS = 24
BLOCKS = np.arange(READINGS) % 5


@pytest.fixture
def fit():
    return linear_fit(np.random.default_rng(8), READINGS)


def test_the_linear_update_is_a_refit(fit):
    data = fit.predicted_um + fit.residual
    expected, score = np.empty(READINGS), 0.0
    for block in range(5):
        out = block == BLOCKS
        kept = fit_linear(fit.jacobian[~out], data[~out])
        expected[out] = data[out] - fit.jacobian[out] @ kept.vector
        spread = np.eye(out.sum()) + fit.jacobian[out] @ kept.covariance @ fit.jacobian[out].T
        score += multivariate_normal.logpdf(expected[out], cov=spread)
    left_out = hold_out(fit, BLOCKS)
    assert left_out.deviation == pytest.approx(expected)
    assert left_out.log_score == pytest.approx(score / READINGS)


def test_everything_left_out_is_predicted_by_the_priors(fit):
    centre, width = PARAMETERS.prior
    data = fit.predicted_um + fit.residual
    left_out = hold_out(fit, np.zeros(READINGS))
    scaled = fit.jacobian * width
    density = multivariate_normal(fit.jacobian @ centre, np.eye(READINGS) + scaled @ scaled.T)
    assert left_out.deviation == pytest.approx(data - fit.jacobian @ centre)
    assert left_out.log_score == pytest.approx(density.logpdf(data) / READINGS)


def test_readings_left_out_are_predicted_worse_than_fitted_ones():
    random = np.random.default_rng(9)
    worse = 0
    for _ in range(20):
        fit = linear_fit(random, READINGS)
        worse += np.sum(hold_out(fit, BLOCKS).deviation ** 2) > fit.chi_square
    assert worse == 20
