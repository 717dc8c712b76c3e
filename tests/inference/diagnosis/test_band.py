"""How well a learned curve is known: its band covers the true one as often as it says."""

from dataclasses import replace

import numpy as np
import pytest

from inference.diagnosis.linear import PARAMETERS, fit_linear
from paint_deposition.effects.learned.curves import CURVES
from paint_deposition.effects.learned.law import hat_weights
from paint_deposition.inference.diagnosis.smooth_laws import Basis, RandomLaw
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.report.style import TWO_SIDED_95

KNOTS, LENGTH, SIZE = 12, 3.0, 0.1
FILM_UM, NOISE_UM = 30.0, 0.6


def at_places(places: np.ndarray) -> RandomLaw:
    """Factors over a covariate, for readings (P,) of which each has one value, in knots."""
    settings = {'kind': 'factor', 'low': 0.0, 'high': KNOTS - 1.0}
    film_um = FILM_UM * hat_weights(places, KNOTS)
    at = np.arange(KNOTS, dtype=float)[:, np.newaxis]
    return Basis(CURVES['time_s'], settings, film_um, at, 1.0).random(SIZE, LENGTH)


def fitted(law: RandomLaw, truth: np.ndarray, random: np.random.Generator) -> Fit:
    """The fit of readings of a true curve (K,), the level of all film being unknown, too."""
    jacobian = np.zeros((len(law.basis.film_um), len(PARAMETERS)))
    jacobian[:, 0] = FILM_UM / NOISE_UM
    level = PARAMETERS.prior.centre[0] + 0.05
    true = law.basis.film_um @ truth / NOISE_UM + jacobian[:, 0] * level
    fit = fit_linear(jacobian, true + random.normal(size=len(true)))
    return replace(fit, nuisance=law.change_um / NOISE_UM)


def from_the_mean(law: RandomLaw, values: np.ndarray) -> np.ndarray:
    """(K,) values of a curve from their mean over all film."""
    return values - np.average(values, weights=law.basis.film_um.sum(axis=0))


def covered(law: RandomLaw, truth: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """(K,) whether the band of a fit holds the true curve at the knots."""
    learned = law.learned(*fitted(law, truth, random).amplitudes)
    away = from_the_mean(law, np.array(learned.learned) - truth)
    return np.abs(away) <= TWO_SIDED_95 * np.array(learned.sd)


@pytest.fixture
def law() -> RandomLaw:
    """Readings that are few on one side."""
    places = (KNOTS - 1) * np.random.default_rng(1).beta(1.0, 2.0, size=60)
    return at_places(places)


def test_the_band_holds_curves_of_the_prior_as_often_as_it_says(law):
    random = np.random.default_rng(2)
    held = [
        covered(law, law.at_knots @ random.normal(size=law.at_knots.shape[1]), random)
        for _ in range(300)
    ]
    # The standard error is below 0.7 %, as a curve counts for several independent values.
    assert np.mean(held) == pytest.approx(0.95, abs=0.02)
    assert np.mean(held, axis=0) == pytest.approx(np.full(KNOTS, 0.95), abs=0.05)


def test_the_band_is_wide_where_readings_are_few_and_no_wider_than_before_them(law):
    random = np.random.default_rng(4)
    fit = fitted(law, np.zeros(KNOTS), random)
    sd, before = law.sd(fit.amplitudes[1]), law.sd(np.eye(law.at_knots.shape[1]))
    assert sd[-1] > 3.0 * sd[2]
    assert (sd < before).all()
    doubled = replace(fit, nuisance=0.5 * fit.nuisance, jacobian=0.5 * fit.jacobian)
    assert (law.sd(doubled.amplitudes[1]) > 1.2 * sd).all()


def test_a_level_that_the_pattern_takes_up_does_not_widen_the_band(law):
    """It would hide the form: the level of pattern and factor together is known, not each."""
    covariance = fitted(law, np.zeros(KNOTS), np.random.default_rng(5)).amplitudes[1]
    level = np.sqrt(np.diag(law.at_knots @ covariance @ law.at_knots.T)).min()
    assert level > 2.0 * np.median(law.sd(covariance))
    settings = {**law.basis.settings, 'kind': 'addition'}
    added = replace(law, basis=replace(law.basis, settings=settings))
    assert added.sd(covariance).min() == pytest.approx(level)
