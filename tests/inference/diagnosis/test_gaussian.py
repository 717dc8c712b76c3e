"""Log Bayes factors in closed form against the densities they stand for."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import f, kstest, multivariate_normal, multivariate_t, norm

from inference.diagnosis.linear import KNOWN, PARAMETERS, linear_fit, null_of
from paint_deposition.inference.diagnosis import gaussian
from paint_deposition.inference.diagnosis.model_space import SIZES

READINGS = 30


@pytest.fixture(params=[PARAMETERS, KNOWN], ids=['weak', 'known'])
def fit(request):
    return linear_fit(np.random.default_rng(3), READINGS, parameters=request.param)


@pytest.fixture
def columns():
    return np.random.default_rng(4).normal(size=(READINGS, 3))


@pytest.fixture
def discrepancy(columns):
    """A covariance of the discrepancy."""
    return 2.0 * columns @ columns.T


def log_density(data: np.ndarray, covariance: np.ndarray, freedom: float):
    """Student's where the noise was estimated, else the normal one."""
    if np.isinf(freedom):
        return multivariate_normal.logpdf(data, cov=covariance)
    return multivariate_t.logpdf(data, shape=covariance, df=freedom)


def test_the_null_model_has_the_covariance_of_pattern_nuisance_and_discrepancy(
    fit, columns, discrepancy
):
    """It is the same where the discrepancy is given as columns; some readings have their part."""
    plain = null_of(fit, columns)
    prior = fit.parameters.prior
    pattern = fit.jacobian @ prior.factor
    covariance = np.eye(READINGS) + pattern @ pattern.T + columns @ columns.T
    deviation = fit.residual + fit.jacobian @ (fit.vector - prior.centre)
    assert plain.lower @ plain.lower.T == pytest.approx(covariance)
    rows = np.arange(READINGS) % 3 > 0
    for null in (
        gaussian.NullModel.around(fit, columns, discrepancy=discrepancy),
        gaussian.NullModel.around(fit, columns, discrepancy=covariance).with_discrepancy(
            discrepancy
        ),
        plain.beside(np.sqrt(2.0) * columns),
    ):
        assert null.lower @ null.lower.T == pytest.approx(covariance + discrepancy)
        assert null.lower @ null.deviation == pytest.approx(deviation)
        part = null.select(rows)
        expected = (covariance + discrepancy)[np.ix_(rows, rows)]
        assert part.lower @ part.lower.T == pytest.approx(expected)
        assert part.lower @ part.deviation == pytest.approx(null.scaled_deviation[rows])


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_signed_amplitude_beside_free_ones_is_integrated_over_its_side(side):
    """Two directions that are not orthogonal, the second of one sign."""
    random = np.random.default_rng(6)
    columns = random.normal(size=(8, 2)) * 0.5
    columns[:, 1] += 0.5 * columns[:, 0]
    data = random.normal(size=8) + columns @ [0.5, 1.0]

    def likelihood_ratio(second: float, first: float) -> float:
        left = data - columns @ [first, second]
        prior = 2.0 * norm.pdf(first) * norm.pdf(second)
        return np.exp(0.5 * (data @ data - left @ left)) * prior

    integral, _ = dblquad(likelihood_ratio, -7.0, 7.0, *sorted((0.0, 7.0 * side)))
    directions = gaussian.OrthogonalDirections.of(columns, np.array([0.0, side]))
    found = directions.log_bayes_factors(data[:, np.newaxis], np.ones(1), np.inf)[0, 0]
    assert found == pytest.approx(np.log(integral), abs=1e-5)


def test_simulated_deviations_are_as_wide_as_the_noise_is_uncertain():
    squares = (gaussian.simulated(1, 8.0, 4000, seed=3) ** 2).ravel()
    assert kstest(squares, f(1, 8).cdf).pvalue > 0.01
    assert np.std(gaussian.simulated(50, np.inf, 400, seed=3)) == pytest.approx(1.0, abs=0.02)


def test_a_parameter_that_a_bound_has_stopped_is_no_direction(fit):
    """The fit would go on if it could: what it leaves is a deviation, not the pattern's."""
    _, high = fit.parameters.bounds
    last = len(fit.vector) - 1
    stopped = replace(fit, vector=np.where(np.arange(last + 1) == last, high, fit.vector))
    null = null_of(stopped)
    rest, prior = slice(0, last), fit.parameters.prior
    columns = fit.jacobian[:, rest] @ prior.factor[rest, rest]
    assert null.columns == pytest.approx(columns)
    away = (stopped.vector - prior.centre)[rest]
    assert null.scaled_deviation == pytest.approx(fit.residual + fit.jacobian[:, rest] @ away)


@pytest.mark.parametrize('freedom', [np.inf, 6.0])
@pytest.mark.parametrize('count', [3, 40])
def test_factor_is_the_ratio_of_densities_whatever_does_not_show(count, freedom):
    """Of directions there may be more than readings or fewer."""
    random = np.random.default_rng(4)
    seen = random.normal(size=(12, count))
    columns = np.hstack([seen, seen @ random.normal(size=(count, 30))])
    data = random.normal(size=(12, 5))
    found = gaussian.OrthogonalDirections.of(columns, np.zeros(columns.shape[1]))
    assert found.columns.shape[1] == min(count, 12)
    factor = found.log_bayes_factors(data, np.array([0.7]), freedom)[0]
    covariance = np.eye(12) + 0.49 * columns @ columns.T
    of_one, of_none = (log_density(data.T, c, freedom) for c in (covariance, np.eye(12)))
    np.testing.assert_allclose(factor, of_one - of_none, rtol=1e-8)
    amounts = found.amplitudes(data[:, 0], np.array([0.7]))[0]
    mean = 0.49 * columns.T @ np.linalg.solve(covariance, data[:, 0])
    np.testing.assert_allclose(amounts, mean, atol=1e-8)


@pytest.mark.parametrize('side', [0.0, 1.0])
def test_shifted_deviations_are_weighed_as_if_they_were_there(columns, side):
    draws = gaussian.simulated(READINGS, 8.0, 4, seed=6)
    shifts = np.random.default_rng(8).normal(size=(READINGS, 3))
    moved = (draws[:, np.newaxis] + shifts[:, :, np.newaxis]).reshape(READINGS, -1)
    principal = gaussian.OrthogonalDirections.of(columns, np.array([side, 0.0, 0.0]))
    expected = principal.log_bayes_factors(moved, SIZES, 8.0)
    np.testing.assert_allclose(principal.log_bayes_factors(draws, SIZES, 8.0, shifts), expected)
