"""Laws of any form as changes of readings: what they are in a model is what they were in a fit."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from booth import MODEL
from inference.diagnosis.linear import PARAMETERS, fit_linear
from inference.diagnosis.readings_on_door import on_door, on_panel, study_of
from paint_deposition.effects.catalogue import LEARNED
from paint_deposition.effects.learned.law import LearnedLaw, hat_weights
from paint_deposition.inference.diagnosis import smooth_laws
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.report.style import TWO_SIDED_95
from reference import reference_film_um

OF_ANY_KIND = pytest.mark.parametrize(
    ('law', 'kind'),
    [
        (law, kind)
        for law in LEARNED.values()
        for kind in law.kinds
        if law is not LEARNED['speed_m_per_s']
    ],
    ids=lambda value: value if isinstance(value, str) else value.covariate,
)


@pytest.fixture(scope='module')
def study() -> Study:
    return study_of(on_door(count=12))


def film_um(experiment: Experiment, model: pd.DepositionModel, law: LearnedLaw | None = None):
    """(P,) film at the readings, ray by ray, with a law in the model or none."""
    points, path = experiment.measured_points, experiment.path
    if law is None:
        return reference_film_um(points, path, model)
    arrived_um = reference_film_um(points, law.on_path(path, None), model.with_effect(law))
    return law.on_film(arrived_um, points)


@pytest.mark.slow
@OF_ANY_KIND
def test_a_random_law_changes_the_readings_as_the_law_in_the_model_does(law, kind, study):
    """No linearisation is left: film is linear in the values of one law at its knots."""
    (basis,) = smooth_laws.bases_over(study, MODEL, law, kind)
    random = basis.random(0.03, 1.0)
    amplitudes = np.random.default_rng(2).normal(size=random.at_knots.shape[1])
    change_um = random.change_um @ amplitudes
    (door,) = study.campaign.experiments
    in_model = film_um(door, MODEL, random.learned(amplitudes)) - film_um(door, MODEL)
    assert np.abs(in_model).max() > 0.01
    np.testing.assert_allclose(change_um, in_model, atol=1e-10)


def test_around_another_model_a_law_keeps_its_values_and_changes_other_film(study):
    twice = MODEL.planar.model_copy(update={'K1_cm3_per_s': 2.0 * MODEL.planar.K1_cm3_per_s})
    other = MODEL.model_copy(update={'planar': twice})
    for covariate in ('time_s', 'place', 'footprint'):
        (basis,) = smooth_laws.bases_over(study, MODEL, LEARNED[covariate], 'factor')
        random = basis.random(0.05, 1.0)
        moved = random.around(study, other)
        assert np.array_equal(moved.at_knots, random.at_knots)
        np.testing.assert_allclose(moved.change_um, 2.0 * random.change_um, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(
    ('edges', 'lengths', 'correlation'),
    [
        (False, (0.5, 1.0, 3.0), lambda d: np.exp(-0.5 * d**2)),
        # A map bends more sharply: beyond an edge it still knows less of the other side.
        (True, (3.0,), lambda d: (1.0 + np.sqrt(3.0) * d) * np.exp(-np.sqrt(3.0) * d)),
    ],
    ids=['curve', 'map'],
)
def test_values_have_the_size_and_the_correlation_that_were_asked_for(edges, lengths, correlation):
    step, knots = 0.5, np.arange(9)
    at = step * knots[:, np.newaxis]
    basis = smooth_laws.Basis(LEARNED['height_fraction'], {}, np.eye(9), at, step, edges=edges)
    away = step * np.abs(np.subtract.outer(knots, knots))
    for length in lengths:
        random = basis.random(0.2, length)
        expected = 0.2**2 * correlation(away / length)
        covariance = random.at_knots @ random.at_knots.T
        assert covariance == pytest.approx(expected, abs=0.03 * 0.2**2)


def test_harmonics_of_a_footprint_are_independent(study):
    random = smooth_laws.footprint_basis(study, MODEL).random(1.0, 2.0)
    covariance = random.at_knots @ random.at_knots.T
    wave = np.arange(len(covariance)) % 5
    assert np.abs(covariance[wave[:, np.newaxis] != wave]).max() < 1e-9
    assert covariance[10, 5] == pytest.approx(np.exp(-0.5 / 2.0**2), abs=0.03)


def test_each_part_has_a_map_of_its_own_and_parts_of_one_shape_share_it():
    study = study_of(on_door(count=12), on_panel('first'), on_panel('second'))
    owner = study.campaign.experiment_of
    door, panel, both = smooth_laws.map_bases(study, MODEL)
    assert door.film_um[owner == 0].any()
    assert not door.film_um[owner > 0].any()
    assert not panel.film_um[owner == 0].any()
    assert np.array_equal(panel.film_um[owner == 1], panel.film_um[owner == 2])
    # The laws say so themselves.
    points = [experiment.measured_points for experiment in study.campaign.experiments]
    grids = both.settings['maps']
    assert grids == (*door.settings['maps'], *panel.settings['maps'])
    assert [[grid.is_of(p) for p in points] for grid in grids] == [
        [True, False, False],
        [False, True, True],
    ]


# How well a learned curve is known: its band covers the true one as often as it says.

KNOTS, LENGTH, SIZE = 12, 3.0, 0.1
FILM_UM, NOISE_UM = 30.0, 0.6


def at_places(places: np.ndarray) -> smooth_laws.RandomLaw:
    """Factors over a covariate, for readings (P,) of which each has one value, in knots."""
    settings = {'kind': 'factor', 'low': 0.0, 'high': KNOTS - 1.0}
    film_um = FILM_UM * hat_weights(places, KNOTS)
    at = np.arange(KNOTS, dtype=float)[:, np.newaxis]
    return smooth_laws.Basis(LEARNED['time_s'], settings, film_um, at, 1.0).random(SIZE, LENGTH)


def fitted(law: smooth_laws.RandomLaw, truth: np.ndarray, random: np.random.Generator) -> Fit:
    """The fit of readings of a true curve (K,), the level of all film being unknown, too."""
    jacobian = np.zeros((len(law.basis.film_um), len(PARAMETERS)))
    jacobian[:, 0] = FILM_UM / NOISE_UM
    level = PARAMETERS.prior.centre[0] + 0.05
    true = law.basis.film_um @ truth / NOISE_UM + jacobian[:, 0] * level
    fit = fit_linear(jacobian, true + random.normal(size=len(true)))
    return replace(fit, nuisance=law.change_um / NOISE_UM)


def covered(
    law: smooth_laws.RandomLaw, truth: np.ndarray, random: np.random.Generator
) -> np.ndarray:
    """(K,) whether the band of a fit holds the true curve at the knots, but for its level."""
    learned = law.learned(*fitted(law, truth, random).amplitudes)
    away = np.array(learned.learned) - truth
    away -= np.average(away, weights=law.basis.film_um.sum(axis=0))
    return np.abs(away) <= TWO_SIDED_95 * np.array(learned.sd)


@pytest.fixture
def law() -> smooth_laws.RandomLaw:
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
    # Its form is what a centred law keeps.
    forms = [np.diff(one.at_knots, axis=0) for one in (law.centred, law)]
    np.testing.assert_allclose(*forms)
    added = replace(law, basis=replace(law.basis, settings=settings))
    assert added.sd(covariance).min() == pytest.approx(level)
