"""Panels too small for the pattern: noticed, and the uncertainty made honest."""

import numpy as np
import pytest
from scipy.stats import norm

from inference.fitting.panels import OUTLINE_M, PANEL, column, passes, readings_at
from paint_deposition.api.inference import compare
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.inference.fitting.calibration import Calibration, calibrate
from paint_deposition.inference.fitting.estimates import estimates
from paint_deposition.inference.fitting.panel import short_reaches
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.surface import Surface

TRUTH = PlanarPattern(
    K1_cm3_per_s=1.6, K2=0.15, K3=0.2, phi_rad=0.6, r_m=0.22, sigma1_m=0.09, sigma2_m=0.15
)
RIM_M = 0.015


def panel_campaign(height_m: float, passes_m, edge_gain: float = 0.0) -> Campaign:
    """A panel 0.8 m wide, measured across its whole height but for the rim."""
    outline = OUTLINE_M.copy()
    outline[2:, 2] = height_m
    surface = Surface.from_triangles(outline, np.array([[0, 2, 1], [0, 3, 2]]), 0.05)
    points = column(RIM_M, height_m - RIM_M, 36)
    effects = (EdgeBuild(gain=edge_gain),) if edge_gain else ()
    model = DepositionModel(planar=TRUTH, effects=effects)
    integrator = FilmIntegrator(surface.at(points), model, 'double')
    path, _ = spray_path(passes(passes_m))
    integrator.add(path)
    readings = readings_at(points, integrator.gauge_um, noise_um=0.5)
    return Campaign((Experiment.of('panel', surface, path, readings),))


@pytest.fixture(scope='module')
def too_small() -> Calibration:
    """A panel of half a metre with 30 % more film along its rim, as fat edges have it."""
    return calibrate(panel_campaign(0.5, (0.45, 0.25, 0.05), edge_gain=0.3))


def covered(values) -> dict[str, bool]:
    names = ('K1_cm3_per_s', 'K2', 'r_m', 'sigma1_m', 'sigma2_m')
    return {v.name: v.low <= getattr(TRUTH, v.name) <= v.high for v in values if v.name in names}


def test_paint_beyond_the_readings_is_that_of_the_normal_distribution():
    """A pattern of one Gaussian leaves a Gaussian across the pass."""
    sigma_m = 0.2
    gaussian = DepositionModel(planar=PlanarPattern(K2=1.0, K3=0.0, sigma2_m=sigma_m))
    path, _ = spray_path(passes((1.0,)))
    points = column(0.8, 1.3)
    experiment = Experiment.of('panel', PANEL, path, readings_at(points, np.ones(len(points))))
    (reach,) = short_reaches(Campaign((experiment,)), gaussian)
    assert sorted(reach.ends_m) == pytest.approx([0.2, 0.3], abs=1e-6)
    expected = {round(end, 3): norm.sf(end / sigma_m) for end in reach.ends_m}
    for end, beyond in zip(reach.ends_m, reach.beyond, strict=True):
        assert beyond == pytest.approx(expected[round(end, 3)], rel=1e-3)
    assert reach.needed_m == pytest.approx(norm.isf(0.025) * sigma_m, rel=1e-3)
    wide = column(0.6, 1.4)
    enough = Experiment.of('wide', PANEL, path, readings_at(wide, np.ones(len(wide))))
    assert short_reaches(Campaign((enough,)), gaussian) == ()
    assert short_reaches(Campaign((experiment, enough)), gaussian) == ()


@pytest.mark.slow
def test_a_panel_that_shows_both_edges_is_not_warned_of():
    result = calibrate(panel_campaign(1.4, (0.7,)))
    assert not any('lands further out' in warning for warning in result.warnings)
    assert len(result.shifts) == 0
    assert [v.sigma for v in result.parameters] == [v.sigma for v in estimates(result.fit)]


@pytest.mark.slow
def test_a_panel_too_small_is_named_with_the_remedy(too_small):
    (warning,) = (line for line in too_small.warnings if 'lands further out' in line)
    assert warning.startswith('panel: the readings end 0.23 and 0.23 m to the sides of a pass')
    assert 'on a larger panel if need be' in warning
    assert 'intervals are widened' in warning


@pytest.mark.slow
def test_the_widened_intervals_hold_the_truth(too_small):
    """What the fit alone is sure of is wrong by many of its standard deviations."""
    assert sum(covered(estimates(too_small.fit)).values()) <= 2
    assert all(covered(too_small.parameters).values())
    known = too_small.posterior
    (at,) = (k for k, name in enumerate(known.names) if name == 'r_m')
    widths = {v.name: v.sigma for v in too_small.parameters}
    assert np.sqrt(known.matrix[at, at]) == pytest.approx(widths['r_m'], rel=0.05)


@pytest.mark.slow
def test_a_comparison_with_a_pattern_fitted_to_such_a_panel_warns():
    campaign = panel_campaign(0.5, (0.45, 0.25, 0.05), edge_gain=0.3)
    (warning,) = compare(campaign).warnings
    assert 'the edges of the pattern are extrapolated' in warning
    assert compare(campaign, DepositionModel(planar=TRUTH)).warnings == ()
