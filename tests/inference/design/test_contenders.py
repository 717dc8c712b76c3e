"""How much further readings tell between explanations, against draws of these readings."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from paint_deposition.inference.design.contenders import Forecast, Placement
from paint_deposition.inference.diagnosis.gaussian import NullModel

READINGS, DRAWS = 6, 40_000


def forecast(spread: float = 1.0) -> Forecast:
    """Two effects and the footprint: other means, and covariances as unlike as this."""
    rng = np.random.default_rng(3)
    means = rng.normal(size=(3, READINGS))
    roots = spread * rng.normal(size=(3, READINGS, 2))
    covariances = np.eye(READINGS) + roots @ roots.transpose(0, 2, 1)
    contenders = [
        SimpleNamespace(is_effect=True), SimpleNamespace(is_effect=True),
        SimpleNamespace(is_effect=False),
    ]  # fmt: skip
    return Forecast(contenders, np.array([0.0, 0.4, 1.0]), means, np.linalg.cholesky(covariances))


def log_odds_drawn(told: Forecast, true: int, other: int) -> np.ndarray:
    """(DRAWS,) logarithm of the odds of the true one after readings that it gives."""
    rng = np.random.default_rng(4)
    laws = [
        multivariate_normal(mean, factor @ factor.T)
        for mean, factor in zip(told.means, told.factors, strict=True)
    ]
    readings = laws[true].rvs(DRAWS, rng)
    return told.odds[true, other] + laws[true].logpdf(readings) - laws[other].logpdf(readings)


def test_the_log_odds_are_those_of_readings_that_are_drawn():
    told = forecast()
    for true, other in ((0, 1), (1, 0), (0, 2)):
        drawn = log_odds_drawn(told, true, other)
        mean, variance = told.gains[:, true, other]
        error = drawn.std() / np.sqrt(DRAWS)
        assert told.odds[true, other] + mean == pytest.approx(drawn.mean(), abs=4.0 * error)
        assert variance == pytest.approx(drawn.var(), rel=0.05)


def test_nothing_tells_between_explanations_that_say_the_same():
    told = forecast()
    same = replace(
        told,
        log_weight=np.zeros(3),
        means=np.tile(told.means[0], (3, 1)),
        factors=np.tile(told.factors[0], (3, 1, 1)),
    )
    assert same.separations == pytest.approx((0.0, 0.0), abs=1e-6)
    assert same.chance == 0.0


@pytest.mark.parametrize(('spread', 'tolerance'), [(0.0, 1e-6), (0.5, 0.15)])
def test_single_readings_add_up_to_all_of_them(spread, tolerance):
    """With errors that differ the mean of what is read so far goes on: about as much."""
    told = forecast(spread)
    placement = Placement(told)
    for reading in range(READINGS):
        placement.take(reading)
    found = placement.separation(placement.nearest())
    assert found == pytest.approx(told.separations[1], rel=tolerance)
    if not spread:
        # Equal errors leave the distance of the means.
        two = Forecast(told.contenders[:2], np.zeros(2), told.means[:2], told.factors[:2])
        away = float(np.linalg.norm(told.means[1] - told.means[0]))
        assert two.separations == pytest.approx((0.0, away))


def test_some_readings_are_predicted_from_others():
    rng = np.random.default_rng(5)
    columns, raw = rng.normal(size=(9, 4)), rng.normal(size=9)
    null = NullModel.of(columns, raw)
    mean, factor = null.predicted(6)
    first, anew = null.first(6), NullModel.of(columns[:6], raw[:6])
    assert first.lower == pytest.approx(anew.lower)
    assert first.deviation == pytest.approx(anew.deviation)
    covariance = np.eye(9) + columns @ columns.T
    slope = covariance[6:, :6] @ np.linalg.inv(covariance[:6, :6])
    assert mean == pytest.approx(slope @ raw[:6])
    assert factor @ factor.T == pytest.approx(covariance[6:, 6:] - slope @ covariance[:6, 6:])
