"""Log Bayes factors in closed form against the densities they stand for."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import f, kstest, multivariate_normal, multivariate_t, norm

from diagnosis.linear import deviation, hypothesis, linear_fit, prior_covariance
from paint_deposition.diagnosis.evidence import Evidence, NullModel, simulated

READINGS = 30


@pytest.fixture
def fit():
    return linear_fit(np.random.default_rng(3), READINGS)


@pytest.fixture
def columns():
    return np.random.default_rng(4).normal(size=(READINGS, 3))


def test_whitening_makes_the_null_model_standard_normal(fit, columns):
    null = NullModel.of(fit, columns)
    covariance = prior_covariance(fit) + columns @ columns.T
    assert null.lower @ null.lower.T == pytest.approx(covariance)
    assert null.lower @ null.deviation == pytest.approx(deviation(fit))


def test_factor_is_the_ratio_of_gaussian_densities(fit, columns):
    null = NullModel.of(fit)
    without = prior_covariance(fit)
    expected = multivariate_normal.logpdf(
        deviation(fit), cov=without + columns @ columns.T
    ) - multivariate_normal.logpdf(deviation(fit), cov=without)
    assert Evidence(hypothesis(null, columns)).log_bayes_factor(null.deviation) == pytest.approx(
        expected
    )


@pytest.mark.parametrize('freedom', [6.0, 40.0])
def test_factor_is_the_ratio_of_student_densities_where_the_noise_was_estimated(
    fit, columns, freedom
):
    null = NullModel.of(fit)
    without = prior_covariance(fit)
    expected = multivariate_t.logpdf(
        deviation(fit), shape=without + columns @ columns.T, df=freedom
    ) - multivariate_t.logpdf(deviation(fit), shape=without, df=freedom)
    evidence = Evidence(hypothesis(null, columns), freedom)
    assert evidence.log_bayes_factor(null.deviation) == pytest.approx(expected)


def test_many_degrees_of_freedom_are_a_known_noise(fit, columns):
    null = NullModel.of(fit)
    missing = hypothesis(null, columns)
    known = Evidence(missing).log_bayes_factor(null.deviation)
    assert Evidence(missing, 1e7).log_bayes_factor(null.deviation) == pytest.approx(
        known, abs=1e-3
    )


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize('strength', [-0.6, 0.0, 0.9])
def test_factor_of_a_signed_amplitude_is_the_integral_over_its_side(fit, columns, side, strength):
    null = NullModel.of(fit)
    column = null.whiten(columns[:, :1])
    data = null.deviation + strength * column[:, 0]

    def likelihood_ratio(amplitude: float) -> float:
        left = data - amplitude * column[:, 0]
        return np.exp(0.5 * (data @ data - left @ left)) * 2.0 * norm.pdf(amplitude)

    ends = sorted((0.0, 8.0 * side))
    integral, _ = quad(likelihood_ratio, *ends, points=[strength] if ends[0] < strength < ends[1]
                       else None, limit=200)  # fmt: skip
    evidence = Evidence(hypothesis(null, columns[:, :1], [side]))
    assert evidence.log_bayes_factor(data) == pytest.approx(np.log(integral), abs=1e-6)


def test_the_wrong_sign_speaks_against_a_signed_amplitude(fit, columns):
    null = NullModel.of(fit)
    column = columns[:, :1]
    data = null.deviation - 1.5 * null.whiten(column)[:, 0]
    free = Evidence(hypothesis(null, column)).log_bayes_factor(data)
    wrong = Evidence(hypothesis(null, column, [1.0])).log_bayes_factor(data)
    right = Evidence(hypothesis(null, column, [-1.0])).log_bayes_factor(data)
    assert right == pytest.approx(free + np.log(2.0), abs=1e-3)
    assert wrong < 0.0 < free


def test_amplitudes_are_those_of_ridge_regression(fit, columns):
    null = NullModel.of(fit)
    white = null.whiten(columns)
    expected = np.linalg.solve(np.eye(3) + white.T @ white, white.T @ null.deviation)
    evidence = Evidence(hypothesis(null, columns))
    assert evidence.posterior_mean(null.deviation) == pytest.approx(expected)


@pytest.mark.parametrize('freedom', [np.inf, 12.0])
@pytest.mark.parametrize('sides', [(0, 0, 0), (1, 0, -1)])
def test_many_deviations_at_once_are_those_one_by_one(fit, columns, freedom, sides):
    null = NullModel.of(fit)
    evidence = Evidence(hypothesis(null, columns, sides), freedom)
    draws = simulated(READINGS, freedom, 5, seed=1)
    together = evidence.log_bayes_factor(draws)
    assert together == pytest.approx([evidence.log_bayes_factor(draw) for draw in draws.T])


def test_no_column_is_no_evidence(fit):
    null = NullModel.of(fit)
    nothing = hypothesis(null, np.empty((READINGS, 0)))
    assert Evidence(nothing).log_bayes_factor(null.deviation) == 0.0


def test_a_factor_averages_to_one_where_nothing_is_missing(fit, columns):
    """The defining property of a Bayes factor, whatever the sides and the noise."""
    null = NullModel.of(fit)
    evidence = Evidence(hypothesis(null, 0.1 * columns[:, :2], (1, 0)))
    factors = np.exp(evidence.log_bayes_factor(simulated(READINGS, np.inf, 40_000, seed=2)))
    assert factors.mean() == pytest.approx(1.0, abs=4.0 * factors.std() / 200.0)


def test_simulated_deviations_are_as_wide_as_the_noise_is_uncertain():
    squares = (simulated(1, 8.0, 4000, seed=3) ** 2).ravel()
    assert kstest(squares, f(1, 8).cdf).pvalue > 0.01
    assert np.std(simulated(50, np.inf, 400, seed=3)) == pytest.approx(1.0, abs=0.02)
