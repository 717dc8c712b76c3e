"""Panels too small for the pattern: noticed, and the uncertainty made honest."""

import numpy as np
import pytest
from scipy.stats import norm

import paint_deposition as pd
from inference.fitting.panels import column, painted_by, panel_of, passes
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.inference.fitting.calibration import calibrate
from paint_deposition.inference.fitting.estimates import estimates
from paint_deposition.inference.fitting.panel import short_reaches
from paint_deposition.model.eq1_pattern import PlanarPattern

TRUTH = PlanarPattern(
    K1_cm3_per_s=1.6, K2=0.15, K3=0.2, phi_rad=0.6, r_m=0.22, sigma1_m=0.09, sigma2_m=0.15
)
RIM_M = 0.015


def panel_campaign(height_m: float, passes_m, *effects: EdgeBuild) -> pd.Campaign:
    """A panel measured across its whole height but for the rim."""
    model, places = pd.DepositionModel(planar=TRUTH, effects=effects), (RIM_M, height_m - RIM_M)
    return pd.Campaign((
        painted_by(
            model, passes(passes_m), column(*places, 36), surface=panel_of(height_m, 0.05),
            noise_um=0.5,
        ),
    ))  # fmt: skip


@pytest.fixture(scope='module')
def small() -> pd.Campaign:
    """A panel of half a metre with 30 % more film along its rim, as fat edges have it."""
    return panel_campaign(0.5, (0.45, 0.25, 0.05), EdgeBuild(gain=0.3))


def covered(values) -> list[bool]:
    names = ('K1_cm3_per_s', 'K2', 'r_m', 'sigma1_m', 'sigma2_m')
    return [v.low <= getattr(TRUTH, v.name) <= v.high for v in values if v.name in names]


def test_paint_beyond_the_readings_is_that_of_the_normal_distribution():
    """A pattern of one Gaussian leaves a Gaussian across the pass."""
    sigma_m = 0.2
    gaussian = pd.DepositionModel(planar=PlanarPattern(K2=1.0, K3=0.0, sigma2_m=sigma_m))
    narrow, wide = (
        painted_by(gaussian, passes((1.0,)), column(*ends), name=f'{ends}')
        for ends in ((0.8, 1.3), (0.6, 1.4))
    )
    (reach,) = short_reaches(pd.Campaign((narrow,)), gaussian)
    assert sorted(reach.ends_m) == pytest.approx([0.2, 0.3], abs=1e-6)
    expected = norm.sf(np.array(reach.ends_m) / sigma_m)
    assert reach.beyond == pytest.approx(expected, rel=1e-3)
    assert reach.needed_m == pytest.approx(norm.isf(0.025) * sigma_m, rel=1e-3)
    for enough in ((wide,), (narrow, wide)):
        assert short_reaches(pd.Campaign(enough), gaussian) == ()


@pytest.mark.slow
def test_a_panel_that_shows_both_edges_is_not_warned_of():
    result = calibrate(panel_campaign(1.4, (0.7,)))
    assert not any('lands further out' in warning for warning in result.warnings)
    assert len(result.shifts) == 0
    assert [v.sigma for v in result.parameters] == [v.sigma for v in estimates(result.fit)]


@pytest.mark.slow
def test_a_panel_too_small_is_named_and_the_widened_intervals_hold_the_truth(small):
    """What the fit alone is sure of is wrong by many of its standard deviations."""
    found = calibrate(small)
    (warning,) = (line for line in found.warnings if 'lands further out' in line)
    assert warning.startswith('panel: the readings end 0.23 and 0.23 m to the sides of a pass')
    assert 'on a larger panel if need be' in warning
    assert 'intervals are widened' in warning
    assert sum(covered(estimates(found.fit))) <= 2
    assert all(covered(found.parameters))
    at = found.posterior.names.index('r_m')
    widths = {v.name: v.sigma for v in found.parameters}
    assert np.sqrt(found.posterior.matrix[at, at]) == pytest.approx(widths['r_m'], rel=0.05)


@pytest.mark.slow
def test_a_comparison_with_a_pattern_fitted_to_such_a_panel_warns(small):
    (warning,) = pd.compare(small).warnings
    assert 'the edges of the pattern are extrapolated' in warning
    assert pd.compare(small, pd.DepositionModel(planar=TRUTH)).warnings == ()
