"""The pattern found back from readings of panels."""

import re
from dataclasses import replace

import numpy as np
import pytest

from inference.fitting.panels import campaign_of, column, painted_by, passes, readings_at
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.inference.fitting.calibration import calibrate
from paint_deposition.inference.fitting.panel import Panel, fit_collapse
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.model.eq1_pattern import PlanarPattern
from virtual_paint_shop.shop import panel_study

pytestmark = pytest.mark.slow

TRUTH = DepositionModel(
    planar=PlanarPattern(
        K1_cm3_per_s=1.6, K2=0.25, K3=0.25, phi_rad=0.0, r_m=0.2, sigma1_m=0.08, sigma2_m=0.14
    )
)
THREE_PASSES = passes((1.577, 1.0, 0.423))


@pytest.fixture(scope='module')
def panel():
    return painted_by(TRUTH, THREE_PASSES, column())


@pytest.fixture(scope='module')
def calibrated(panel):
    return calibrate(Campaign((panel,)))


def test_panel_is_seen_as_one(panel):
    seen = Panel.of(panel)
    np.testing.assert_allclose(np.sort(seen.passes_m), [0.423, 1.0, 1.577], atol=1e-6)
    np.testing.assert_allclose(seen.speed_m_per_s, 0.15, rtol=1e-6)
    assert seen.distance_m == pytest.approx(0.25, abs=1e-6)
    assert seen.scale_m == pytest.approx(0.577, abs=1e-6)
    assert not seen.mirrored.any()


def test_turned_passes_are_told_from_kept_ones(panel):
    motion = passes((1.577, 1.0, 0.423), turned=True)
    turned = painted_by(TRUTH, motion, column())
    assert Panel.of(turned).mirrored.tolist() == [False, True, False]
    kept_um, turned_um = panel.means.mean_um, turned.means.mean_um
    assert np.abs(kept_um - turned_um).max() > 1.0
    film = Panel.of(turned).film_um(TRUTH, Panel.of(turned).across_m)
    assert np.sqrt(np.mean((film - turned_um) ** 2)) < 0.3


def test_three_gaussians_forgive_gross_errors(panel):
    seen, measured = Panel.of(panel), panel.means.mean_um.copy()
    clean = fit_collapse(seen, measured, np.full(len(measured), 0.3))
    measured[[5, 20]] += 12.0
    robust = fit_collapse(seen, measured, np.full(len(measured), 0.3))
    x = np.linspace(-0.5, 0.5, 101)
    difference = robust.collapse.thickness_um(x) - clean.collapse.thickness_um(x)
    assert np.abs(difference).max() < 0.05 * clean.collapse.thickness_um(x).max()
    expected = sampled_collapse(TRUTH, 0.15).area_um_m
    assert clean.collapse.area_um_m == pytest.approx(expected, rel=0.02)


def test_true_values_lie_in_their_intervals(calibrated):
    for value in calibrated.parameters:
        truth = getattr(TRUTH.planar, value.name)
        assert value.low - 0.3 * value.sigma <= truth <= value.high + 0.3 * value.sigma, value
    assert calibrated.chi_square_per_freedom == pytest.approx(1.0, abs=0.6)


def test_undetermined_parameters_are_named(calibrated):
    by_name = {value.name: value for value in calibrated.parameters}
    assert by_name['K1_cm3_per_s'].determined
    assert not by_name['phi_rad'].determined
    assert any(warning.startswith('phi_rad is not determined') for warning in calibrated.warnings)


def test_crosswise_passes_determine_the_asymmetry(panel):
    """They are further off than the model plane, which is taken into account."""
    across = [[x, 0.0, 1.0] for x in np.linspace(-0.38, 0.38, 25)]
    upward = passes((-0.3, 0.3), standoff_m=0.35)
    # The same to and fro, but upward on the panel: its x becomes z.
    turned = replace(upward, positions_m=upward.positions_m[:, [2, 1, 0]] + [0.0, 0.0, 1.0])
    crossing = painted_by(TRUTH, turned, np.array(across), seed=1)
    both = calibrate(Campaign((panel, replace(crossing, name='crossing'))))
    by_name = {value.name: value for value in both.parameters}
    assert by_name['phi_rad'].determined
    assert by_name['K3'].determined
    for name in ('phi_rad', 'r_m'):
        truth = getattr(TRUTH.planar, name)
        assert by_name[name].value == pytest.approx(truth, abs=3.0 * by_name[name].sigma)


def test_papers_study_fit_at_577_predict_525_and_625():
    """On panels of the virtual paint shop, which shares no code with the model."""
    fitted = calibrate(campaign_of(panel_study(4, 0.577, parcels=2_000_000)))
    noise = 0.73
    assert fitted.residuals[0].sd_um < 1.15 * noise
    for index in (0.525, 0.625):
        other = Study.of(campaign_of(panel_study(4, index, parcels=2_000_000)))
        residuals = other.residuals(other.forward.predict_um(fitted.model))
        assert residuals.predicted_um.mean() == pytest.approx(other.measured_um.mean(), rel=0.015)
        assert residuals.sd_um < 1.2 * noise


def with_film(panel, film_um, points=None, repeats=1, noise_um=0.0) -> Campaign:
    points = column() if points is None else points
    return Campaign((panel.with_readings(readings_at(points, film_um, noise_um, repeats)),))


def refused(campaign) -> str:
    with pytest.raises(ReadingsError) as refusal:
        calibrate(campaign)
    assert '\n' not in str(refusal.value)
    return str(refusal.value)


@pytest.mark.parametrize(
    ('made', 'words'),
    [
        (
            lambda panel: with_film(panel, panel.means.mean_um[:6], column()[:6]),
            'readings at 6 points; .* measure at least 10',
        ),
        (
            lambda _: Campaign((painted_by(TRUTH, passes((1.0,)), column(1.05, 1.6, 30)),)),
            'one side of the passes',
        ),
        (
            lambda panel: with_film(panel, np.full(40, 20.0), repeats=2, noise_um=0.7),
            'no pattern in it',
        ),
        (
            lambda panel: with_film(
                panel, np.where(np.arange(40) == 7, -4.5, panel.means.mean_um)
            ),
            "point 'P7' reads -4.5 µm; .* zero the gauge",
        ),
    ],
    ids=['few', 'one side', 'even', 'negative'],
)
def test_readings_that_determine_nothing_are_refused(panel, made, words):
    assert re.search(words, refused(made(panel)))


@pytest.mark.parametrize(('factor', 'unit'), [(25.4, 'mils'), (1000.0, 'mm')])
def test_another_unit(panel, factor, unit):
    film = panel.means.mean_um.copy()
    assert f'look like {unit}, multiply by {factor:g}' in refused(with_film(panel, film / factor))
    film[10:16] /= factor
    text = refused(with_film(panel, film))
    assert f'look like {unit}, multiply them by {factor:g}' in text
    assert '6 of the readings' in text
