"""The pattern found back from readings of panels, and from those too small for it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

import paint_deposition as pd
from inference.fitting.panels import column, painted_by, panel_of, passes, readings_at
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.errors import ReadingsError
from paint_deposition.files.model_file import read_model_file
from paint_deposition.film.pass_film import collapse_um, sampled_collapse
from paint_deposition.inference.fitting.estimates import estimates
from paint_deposition.inference.fitting.panel import Panel, fit_collapse, reach_of, short_reaches
from paint_deposition.inference.fitting.posterior import with_mean_level
from paint_deposition.inference.fitting.study import Study
from paint_deposition.model.eq1_pattern import PlanarPattern
from refusals import refusal
from virtual_paint_shop.files import write
from virtual_paint_shop.shop import panel_study

pytestmark = pytest.mark.slow

PLANAR = PlanarPattern(
    K1_cm3_per_s=1.6, K2=0.25, K3=0.25, phi_rad=0.0, r_m=0.2, sigma1_m=0.08, sigma2_m=0.14
)
TRUTH = pd.DepositionModel(planar=PLANAR)
HEIGHTS_M = (1.577, 1.0, 0.423)


@pytest.fixture(scope='module')
def panel():
    return painted_by(TRUTH, passes(HEIGHTS_M), column())


@pytest.mark.parametrize('turned', [False, True])
def test_a_panel_is_seen_as_one_with_its_turned_passes(panel, turned):
    part = painted_by(TRUTH, passes(HEIGHTS_M, turned=True), column()) if turned else panel
    seen = Panel.of(part)
    np.testing.assert_allclose(np.sort(seen.passes_m), sorted(HEIGHTS_M), atol=1e-6)
    np.testing.assert_allclose(seen.speed_m_per_s, 0.15, rtol=1e-6)
    assert seen.distance_m == pytest.approx(0.25, abs=1e-6)
    assert seen.scale_m == pytest.approx(0.577, abs=1e-6)
    assert seen.mirrored.tolist() == [False, turned, False]
    film_um = sum(
        collapse_um(TRUTH, seen.across_m - line, speed, seen.distance_m, seen.travel_rad, turned=m)
        for line, speed, m in zip(seen.passes_m, seen.speed_m_per_s, seen.mirrored, strict=True)
    )
    off_um = film_um - part.readings.mean_um
    assert np.sqrt(np.mean(off_um**2)) < 0.3
    assert (np.abs(part.readings.mean_um - panel.readings.mean_um).max() > 1.0) == turned


def test_three_gaussians_forgive_gross_errors(panel):
    seen, measured = Panel.of(panel), panel.readings.mean_um.copy()
    clean = fit_collapse(seen, measured, np.full(len(measured), 0.3))
    measured[[5, 20]] += 12.0
    robust = fit_collapse(seen, measured, np.full(len(measured), 0.3))
    x = np.linspace(-0.5, 0.5, 101)
    difference = robust.thickness_um(x) - clean.thickness_um(x)
    assert np.abs(difference).max() < 0.05 * clean.thickness_um(x).max()
    expected = sampled_collapse(TRUTH, 0.15).area_um_m
    assert clean.area_um_m == pytest.approx(expected, rel=0.02)


def test_true_values_lie_in_their_intervals(panel):
    calibrated = pd.calibrate(pd.Campaign((panel,)))
    by_name = {value.name: value for value in calibrated.parameters}
    for name, value in by_name.items():
        truth = getattr(TRUTH.planar, name)
        assert value.low - 0.3 * value.sigma <= truth <= value.high + 0.3 * value.sigma, value
    assert calibrated.chi_square_per_freedom == pytest.approx(1.0, abs=0.6)
    assert not calibrated.is_incomplete
    assert by_name['K1_cm3_per_s'].determined
    assert not by_name['phi_rad'].determined


def test_a_pattern_that_no_bell_has_is_named_as_what_the_model_lacks(panel):
    """Fog that settles low looks like a ring as large as the panel."""
    film_um, height_m = panel.readings.mean_um, column()[:, 2]
    foggy = with_film(panel, film_um + 40.0 * np.exp(-height_m[: len(film_um)] / 0.4))
    calibrated = pd.calibrate(pd.Campaign((foggy,)))
    strange = [one for one in calibrated.parameters if 'no usual bell has' in one.reason]
    assert {one.name for one in strange} <= {'r_m', 'sigma1_m', 'sigma2_m'}
    assert strange
    assert not any(one.determined for one in strange)
    assert f'no usual bell has {strange[0].value:.2f} m; what the model lacks may have driven' in (
        ' '.join(calibrated.warnings)
    )
    # It comes first, and no reading is blamed.
    assert calibrated.is_incomplete
    assert 'find it with paint diagnose, and plan with its model' in calibrated.warnings[0]
    assert not any('measure there again' in warning for warning in calibrated.warnings)


def test_crosswise_passes_determine_the_asymmetry(panel):
    """They are further off than the model plane, which is taken into account."""
    across = [[x, 0.0, 1.0] for x in np.linspace(-0.38, 0.38, 25)]
    upward = passes((-0.3, 0.3), standoff_m=0.35)
    # The same to and fro, but upward on the panel: its x becomes z.
    turned = replace(upward, positions_m=upward.positions_m[:, [2, 1, 0]] + [0.0, 0.0, 1.0])
    crossing = painted_by(TRUTH, turned, np.array(across), name='crossing', seed=1)
    both = pd.calibrate(pd.Campaign((panel, crossing)))
    by_name = {value.name: value for value in both.parameters}
    assert by_name['phi_rad'].determined
    assert by_name['K3'].determined
    for name in ('phi_rad', 'r_m'):
        truth = getattr(TRUTH.planar, name)
        assert by_name[name].value == pytest.approx(truth, abs=3.0 * by_name[name].sigma)


def test_papers_study_fit_at_577_predict_525_and_625(tmp_path):
    """On panels of the virtual paint shop, which shares no code with the model."""

    def campaign(index_m: float) -> pd.Campaign:
        painted = panel_study(4, index_m, parcels=2_000_000)
        return pd.read_campaign(write(painted, tmp_path / f'{index_m}'))

    fitted, noise_um = pd.calibrate(campaign(0.577)), 0.73
    assert fitted.residuals[0].sd_um < 1.15 * noise_um
    for index_m in (0.525, 0.625):
        other = Study.of(campaign(index_m))
        residuals = other.residuals(other.forward.predict_um(fitted.model))
        assert residuals.predicted_um.mean() == pytest.approx(other.measured_um.mean(), rel=0.015)
        assert residuals.sd_um < 1.2 * noise_um


def with_film(panel, film_um, repeats=1, noise_um=0.0):
    places = column()[: len(film_um)]
    return panel.with_readings(readings_at(places, film_um, noise_um, repeats))


SIX = slice(10, 16)


def in_unit(panel, factor, rows=slice(None)):
    film_um = panel.readings.mean_um.copy()
    film_um[rows] /= factor
    return with_film(panel, film_um)


@pytest.mark.parametrize(
    ('made', 'words'),
    [
        (lambda panel: with_film(panel, panel.readings.mean_um[:6]),
         'readings at 6 points; .* measure at least 10'),
        (lambda _: painted_by(TRUTH, passes((1.0,)), column(1.05, 1.6, 30)),
         'one side of the passes'),
        (lambda panel: with_film(panel, np.full(40, 20.0), 2, noise_um=0.7), 'no pattern in it'),
        (lambda of: with_film(of, np.where(np.arange(40) == 7, -4.5, of.readings.mean_um)),
         "point 'P7' reads -4.5 µm; .* zero the gauge"),
        (lambda panel: in_unit(panel, 25.4), 'look like mil, say unit: {thickness: mil}'),
        (lambda panel: in_unit(panel, 1000.0), 'look like mm, say unit: {thickness: mm}'),
        (lambda panel: in_unit(panel, 25.4, SIX),
         r"6 of the readings in 'thickness_um'.* look like mil: multiply them by 25\.4 or"),
        (lambda panel: in_unit(panel, 1000.0, SIX),
         '6 of the readings.* look like mm: multiply them by 1000'),
    ],
    ids=['few', 'one side', 'even', 'negative', 'mils', 'mm', 'six in mils', 'six in mm'],
)  # fmt: skip
def test_readings_that_determine_nothing_or_are_in_another_unit_are_refused(panel, made, words):
    line = refusal(ReadingsError, pd.calibrate, pd.Campaign((made(panel),)))
    assert re.search(words, line), line


WIDE = PlanarPattern(
    K1_cm3_per_s=1.6, K2=0.15, K3=0.2, phi_rad=0.6, r_m=0.22, sigma1_m=0.09, sigma2_m=0.15
)
RIM_M = 0.015


def panel_campaign(height_m: float, passes_m, *effects: EdgeBuild) -> pd.Campaign:
    """A panel measured across its whole height but for the rim."""
    model, panel = pd.DepositionModel(planar=WIDE, effects=effects), panel_of(height_m, 0.05)
    places = column(RIM_M, height_m - RIM_M, 36)
    part = painted_by(model, passes(passes_m), places, surface=panel, noise_um=0.5)
    return pd.Campaign((part,))


def covered(values) -> list[bool]:
    names = ('K1_cm3_per_s', 'K2', 'r_m', 'sigma1_m', 'sigma2_m')
    return [v.low <= getattr(WIDE, v.name) <= v.high for v in values if v.name in names]


def test_paint_beyond_the_readings_is_that_of_the_normal_and_none_is_not_warned_of():
    """A pattern of one Gaussian leaves a Gaussian across the pass."""
    sigma_m = 0.2
    gaussian = pd.DepositionModel(planar=PlanarPattern(K2=1.0, K3=0.0, sigma2_m=sigma_m))
    one_pass, ends = passes((1.0,)), ((0.8, 1.3), (0.6, 1.4))
    narrow, wide = (painted_by(gaussian, one_pass, column(*e), name=f'{e}') for e in ends)
    ends_m, beyond, needed_m = reach_of(Panel.of(narrow), gaussian)
    assert sorted(ends_m) == pytest.approx([0.2, 0.3], abs=1e-6)
    assert beyond == pytest.approx(norm.sf(np.array(ends_m) / sigma_m), rel=1e-3)
    assert needed_m == pytest.approx(norm.isf(0.025) * sigma_m, rel=1e-3)
    assert [*short_reaches(pd.Campaign((narrow,)), gaussian)] == [0]
    for enough in ((wide,), (narrow, wide)):
        assert short_reaches(pd.Campaign(enough), gaussian) == {}
    result = pd.calibrate(panel_campaign(1.4, (0.7,)))
    assert not any('lands further out' in warning for warning in result.warnings)
    assert len(result.shifts) == 0
    known = estimates(result.fit, with_mean_level(result.fit, result.study.campaign))
    assert [v.sigma for v in result.parameters] == [v.sigma for v in known]


def test_a_panel_too_small_is_named_and_the_widened_intervals_hold_the_truth(tmp_path):
    """What the fit alone is sure of is wrong by many of its standard deviations.

    The panel of half a metre has 30 % more film along its rim, as fat edges have it.
    """
    small = panel_campaign(0.5, (0.45, 0.25, 0.05), EdgeBuild(gain=0.3))
    found = pd.calibrate(small)
    (warning,) = (line for line in found.warnings if 'lands further out' in line)
    assert warning.startswith('panel: the readings end 0.23 and 0.23 m to the sides of a pass')
    assert 'on a larger panel if need be' in warning
    assert 'intervals are widened' in warning
    assert sum(covered(estimates(found.fit))) <= 2
    assert all(covered(found.parameters))
    at = found.posterior.names.index('r_m')
    widths = {v.name: v.sigma for v in found.parameters}
    assert np.sqrt(found.posterior.matrix[at, at]) == pytest.approx(widths['r_m'], rel=0.05)
    pd.write(found, tmp_path)
    file = read_model_file(tmp_path / 'model.yaml')
    np.testing.assert_allclose(file.posterior.matrix, found.posterior.matrix, rtol=1e-6)
    assert file.uncertainty['planar']['r_m'] == pytest.approx(widths['r_m'], rel=0.01)
    # A comparison with a pattern that was fitted to such a panel warns, too.
    (warning,) = pd.compare(small).warnings
    assert 'the edges of the pattern are extrapolated' in warning
    assert pd.compare(small, pd.DepositionModel(planar=WIDE)).warnings == ()
