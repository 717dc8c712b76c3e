"""The fit: the vector that it varies, a known pattern, and uncertainties as wide as they are."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import paint_deposition as pd
from inference.fitting.panels import PANEL, column, grid_m, painted_by, passes
from paint_deposition.effects.catalogue import EFFECTS, LEARNED
from paint_deposition.inference.fitting.estimates import scaled_covariance
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import derivatives, fit_readings
from paint_deposition.inference.fitting.parameters import SHAPE_DEVIATIONS, FreeParameters
from paint_deposition.inference.fitting.study import FOLDS, TEXTURE_SHARE, Study
from paint_deposition.model.eq1_pattern import PATTERN, PlanarPattern
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.path_builder import spray_path
from scenes import painted

BASE = pd.DepositionModel()
PLANAR = PlanarPattern(
    K1_cm3_per_s=1.6, K2=0.3, K3=0.25, phi_rad=0.9, r_m=0.17, sigma1_m=0.07, sigma2_m=0.12
)
TRUTH = pd.DepositionModel(planar=PLANAR)
SIGMA_UM = 0.15


@pytest.fixture(scope='module')
def spotted() -> pd.Campaign:
    """Two short strokes that do not meet, so that the whole pattern shows, not its collapse."""
    path, _ = spray_path(passes([0.55, 1.35]))
    path = path.with_(flow=np.where(np.abs(path.position_m[:, 0]) < 0.1, 8.0 * path.flow, 0.0))
    return pd.Campaign((painted_by(TRUTH, path, grid_m()),))


@pytest.fixture(scope='module')
def forward(spotted):
    return Forward(spotted, (EFFECTS['overspray_fog'](),))


@pytest.fixture(scope='module')
def exact(forward):
    """What the true model predicts there."""
    return forward.predict_um(TRUTH)


def test_readings_without_noise_are_the_film_and_give_the_pattern_back(spotted, exact, forward):
    film = painted(PANEL.at(grid_m()), spotted.experiments[0].path, TRUTH, 'double')
    assert exact == pytest.approx(film.film_um, rel=1e-9)
    assert 5.0 < exact.max() < 100.0
    sigma_um = np.full(len(exact), 0.003)
    fit = fit_readings(forward, exact, sigma_um, FreeParameters.of(BASE), starts=6)
    assert fit.converged
    assert fit.chi_square < 1.0
    for name, value in TRUTH.planar:
        assert getattr(fit.model.planar, name) == pytest.approx(value, rel=0.01), name


def test_derivatives_are_those_of_the_prediction(forward, exact):
    parameters = FreeParameters.of(TRUTH, EFFECTS['overspray_fog'](fog_um=0.5))
    vector = parameters.encode(parameters.start)
    found = derivatives(forward, parameters, vector, np.full(len(exact), SIGMA_UM))
    for k in range(len(vector)):
        step = 1e-4 * (np.arange(len(vector)) == k)
        low, high = (forward.predict_um(parameters.decode(vector + s)) for s in (-step, step))
        slope = (high - low) / 2e-4 / SIGMA_UM
        assert found[:, k] == pytest.approx(slope, abs=1e-5 * np.abs(slope).max()), k


@pytest.mark.slow
@pytest.mark.parametrize('size', [0.0, 2.0], ids=['noise', 'and a field that the fit ignores'])
def test_the_covariance_is_the_scatter_of_repeated_campaigns(forward, exact, size):
    random = np.random.default_rng(4)
    waves = size * np.sin(np.outer(np.linspace(0.0, 6.0, len(exact)), [1.0, 2.0, 3.0]))
    parameters = FreeParameters.of(TRUTH)
    sigma = np.full(len(exact), SIGMA_UM)
    vectors = []
    for _ in range(25):
        noise = random.normal(size=len(exact)) + waves @ random.normal(size=3)
        measured = exact + SIGMA_UM * noise
        vectors.append(fit_readings(forward, measured, sigma, parameters).vector)
    reference = fit_readings(forward, exact, sigma, parameters)
    # With fixed truth the estimates scatter a little less, as it is not drawn from the priors.
    field = waves @ waves.T
    covariance = scaled_covariance(replace(reference, discrepancy=field if size else None))
    gain = scaled_covariance(reference) @ reference.jacobian.T
    expected = np.sqrt(np.diag(gain @ (np.eye(len(exact)) + field) @ gain.T))
    # The standard error of a deviation from 25 draws is 14 %.
    assert np.std(vectors, axis=0, ddof=1) / expected == pytest.approx(np.ones(7), abs=0.45)
    assert (np.sqrt(np.diag(covariance)) >= expected).all()
    shift = np.mean(vectors, axis=0) - reference.vector
    assert (np.abs(shift) < 4.0 * expected / np.sqrt(25.0)).all()


def test_readings_that_say_nothing_leave_the_priors(forward, exact):
    parameters = FreeParameters.of(BASE)
    fit = fit_readings(forward, exact, np.full(len(exact), 1e9), parameters)
    prior = parameters.prior
    assert fit.vector == pytest.approx(prior.centre, abs=1e-3)
    assert np.sqrt(np.diag(scaled_covariance(fit))) == pytest.approx(prior.width, rel=1e-3)


def test_nuisance_directions_are_allowed_for(forward, exact):
    parameters = FreeParameters.of(TRUTH)
    sigma = np.full(len(exact), SIGMA_UM)
    wrong = exact + 1.5
    nuisance = np.full((len(exact), 1), 2.0 / SIGMA_UM)
    strict = fit_readings(forward, wrong, sigma, parameters)
    lenient = fit_readings(forward, wrong, sigma, parameters, nuisance=nuisance)
    truth = parameters.encode(TRUTH)
    assert np.linalg.norm(lenient.vector - truth) < 0.5 * np.linalg.norm(strict.vector - truth)
    assert lenient.marginal.chi_square < 0.2 * strict.chi_square
    discrepancy = nuisance @ nuisance.T
    same = fit_readings(forward, wrong, sigma, parameters, discrepancy=discrepancy)
    assert same.vector == pytest.approx(lenient.vector, abs=1e-6)
    assert same.objective == pytest.approx(lenient.objective)


def test_a_point_is_as_certain_as_its_repeats_and_the_films_texture():
    experiment = painted_by(TRUTH, passes([0.55, 1.35]), grid_m(), repeats=4, noise_um=0.6)
    study = Study.of(pd.Campaign((experiment,)))
    assert study.noise.source == 'repeats'
    assert study.noise.degrees_of_freedom == 3 * len(study)
    gauge = study.noise.sigma_um[: len(study)]
    expected = np.hypot(gauge / 2, TEXTURE_SHARE * study.measured_um)
    assert study.sigma_um == pytest.approx(expected, rel=0.02)
    assert study.nuisance.shape == (len(study), 0)


def test_of_one_part_patches_are_left_out(spotted):
    """A neighbour would tell what the model cannot."""
    study = Study.of(spotted)
    folds, places_m = study.folds(), study.campaign.positions_m
    assert len(np.unique(folds)) == FOLDS
    centres_m = np.array([places_m[folds == k].mean(axis=0) for k in range(FOLDS)])
    away_m = np.linalg.norm(places_m[:, np.newaxis] - centres_m, axis=2)
    assert np.mean(away_m.argmin(axis=1) == folds) > 0.95


def test_a_prediction_does_not_depend_on_what_was_predicted_before(forward):
    """Films and prepared paths are kept, but for models of the same path and flux only."""
    effects = [EFFECTS[name].typical() for name in ('tcp_tilt', 'overspray_fog', 'occlusion')]
    models = [TRUTH.with_effect(effect) for effect in effects]
    models += [TRUTH.with_effect(EFFECTS['air_drift'](shift_down_m=0.002 * k)) for k in range(12)]
    models += [TRUTH.model_copy(update={'projection': Projection(model_plane_m=0.25)}), TRUTH]
    alone = [Forward(forward.campaign).predict_um(model) for model in models]
    # No drift, and no shadow: these two are that of the last.
    assert len({film.tobytes() for film in alone}) >= len(models) - 2
    for _ in range(2):
        for model, expected in zip(models, alone, strict=True):
            assert np.array_equal(forward.predict_um(model), expected)


@pytest.mark.slow
def test_a_model_without_a_law_of_the_study_does_not_have_it():
    """Laws of one model are compiled for all, and absent in a model that has others."""
    law = LEARNED['incidence_deg'](low=0.0, high=60.0, learned=(0.1, 0.4))
    campaign = pd.Campaign((painted_by(BASE, passes([0.7, 1.3]), column(0.5, 1.5, 9)),))
    other = pd.DepositionModel(effects=(EFFECTS['pattern_spread'].typical(),))
    alone = Forward(campaign).predict_um(other)
    np.testing.assert_array_equal(Forward(campaign, (law,)).predict_um(other), alone)


@given(
    st.builds(
        PlanarPattern, K1_cm3_per_s=st.floats(0.05, 20.0), K2=st.floats(0.0, 1.0),
        K3=st.floats(0.01, 0.98), phi_rad=st.floats(-3.1, 3.1), r_m=st.floats(0.0, 0.6),
        sigma1_m=st.floats(0.01, 0.5), sigma2_m=st.floats(0.01, 0.5),
    )
)  # fmt: skip
def test_a_pattern_survives_the_way_there_and_back(planar):
    """Effects do so below, at the ends of their bounds."""
    parameters = FreeParameters.of(pd.DepositionModel(planar=planar))
    again = parameters.decode(parameters.encode(parameters.start))
    for name, value in planar:
        assert getattr(again.planar, name) == pytest.approx(value, abs=1e-12), name
    assert again.projection == parameters.start.projection


def test_shapes_are_varied_on_a_logarithmic_scale_and_a_learned_law_not_at_all():
    """Neutral is the centre; the whole physical range is a few widths of the prior."""
    parameters = FreeParameters.of(pd.DepositionModel(), EFFECTS['corner_slowdown'](gain=0.5))
    assert parameters.varied == (('corner_slowdown', 'gain'), ('corner_slowdown', 'length_m'))
    vector = parameters.encode(parameters.start)
    info = EFFECTS['corner_slowdown'].parameters()['length_m']
    vectors = [np.append(vector[:-1], entry) for entry in (-0.5, 0.0, 0.5)]
    effects = [parameters.decode(each).effect('corner_slowdown') for each in vectors]
    assert [effect.gain for effect in effects] == pytest.approx([0.5] * 3)
    low, middle, high = (effect.length_m for effect in effects)
    assert middle == pytest.approx(info['neutral'])
    assert high / middle == pytest.approx(middle / low)
    assert high > low
    low, high = parameters.bounds
    assert high[-1] - low[-1] == pytest.approx(SHAPE_DEVIATIONS)
    ends = [parameters.decode(end).effect('corner_slowdown').length_m for end in (low, high)]
    assert ends == pytest.approx([info['low'], info['high']])
    law = LEARNED['time_s'](low=0.0, high=9.0, learned=(0.1, 0.0, -0.1))
    parameters = FreeParameters.of(pd.DepositionModel(), law)
    assert len(parameters) == len(PATTERN)
    assert parameters.decode(parameters.encode(parameters.start)).effect(law.id) == law


@pytest.mark.parametrize('effect', EFFECTS.values(), ids=EFFECTS.keys())
def test_bounds_and_prior_suit_every_effect(effect):
    parameters = FreeParameters.of(pd.DepositionModel(), effect())
    low, high = parameters.bounds
    prior = parameters.prior
    assert (low <= prior.centre).all()
    assert (prior.centre <= high).all()
    assert (prior.width > 0.0).all()
    for end in (low, high):
        decoded = parameters.decode(end)
        assert parameters.encode(decoded)[len(PATTERN) :] == pytest.approx(end[len(PATTERN) :])
