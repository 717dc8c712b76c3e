"""The model's equations beside profiles that were really measured.

The measurements are not shipped, as their licences are mixed. What the fits say of them is shipped
in real_profiles.json: tests of these figures run everywhere, tests of the measurements only where
those are.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from inference.fitting.real_profiles import (
    LANE_SPACING_FT,
    figures,
    fitted_spot,
    fitted_transect,
    inclined,
    share_on_the_axis,
    spot,
    table,
)
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq3_collapse import ThreeGaussianCollapse
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses

SHIPPED = json.loads(Path(__file__).with_name('real_profiles.json').read_text())
COLLAPSE = ThreeGaussianCollapse(**SHIPPED['eq3'])
STATIONS_FT = np.arange(-150.0, 151.0, 20.0)


def lanes_of(depth) -> np.ndarray:
    """Depth between two lanes, five of which overlap; `depth(x)` is that of one."""
    x = np.arange(-112.0, 112.0, 1.0)
    return np.sum([depth(x + LANE_SPACING_FT * k) for k in range(-2, 3)], axis=0)


# --- everywhere, on the shipped figures


def test_eq3_comes_back_from_the_profile_that_it_draws():
    depth = COLLAPSE.thickness_um(STATIONS_FT)
    found = fitted_transect(STATIONS_FT, depth)
    assert found.three.residuals.rmse_um < 0.01 * depth.max()
    fine = np.linspace(-150.0, 150.0, 301)
    off = found.three.collapse.thickness_um(fine) - COLLAPSE.thickness_um(fine)
    assert np.sqrt(np.mean(off**2)) < 0.03 * depth.max()


def test_eq5_is_the_unevenness_of_overlapped_lanes():
    total = lanes_of(COLLAPSE.thickness_um)
    predicted = ParallelPasses.one_way(COLLAPSE).sigma_n(LANE_SPACING_FT)
    assert predicted == pytest.approx(total.std() / total.mean(), rel=1e-3)
    assert 0.10 < predicted < 0.13


def test_eq1_comes_back_from_the_profile_that_it_draws():
    pattern = PlanarPattern(**SHIPPED['eq1'])
    radius = np.linspace(0.0, 0.245, 24)
    found = fitted_spot(radius, pattern.flux_um_per_s(radius, 0.0))
    for name, value in pattern:
        assert getattr(found.pattern, name) == pytest.approx(value, rel=1e-3), name


def test_eq2_on_the_axis_is_the_cosine_that_the_coating_follows():
    angle = np.array([90.0, 75.0, 60.0, 45.0, 29.0])
    np.testing.assert_allclose(share_on_the_axis(angle), np.sin(np.radians(angle)), rtol=1e-12)
    shipped = SHIPPED['eq2']
    assert shipped['cosine_exponent'] == pytest.approx(1.0, abs=shipped['cosine_error'])


# --- where the measurements are


def test_the_shipped_figures_are_those_of_the_measurements(shared_data):
    found = figures(shared_data)
    assert found.keys() == SHIPPED.keys()
    for equation, values in found.items():
        assert values == pytest.approx(SHIPPED[equation], rel=1e-4, abs=1e-9), equation


def test_eq1_follows_a_static_radial_profile_within_a_percent(shared_data):
    measured = spot(shared_data)
    residual = measured.thickness - measured.fitted
    peak = measured.thickness.max()
    assert np.sqrt(np.mean(residual**2)) < 0.01 * peak
    assert np.abs(residual).max() < 0.03 * peak
    # The ring and the wide centre are both needed.
    assert 0.03 < measured.pattern.r_m < 0.07
    assert 0.3 < measured.pattern.K2 < 0.9


def test_thickness_falls_with_the_cosine_that_eq2_has(shared_data):
    measured = inclined(shared_data)
    lean = np.radians(90.0 - measured.angle_deg)
    np.testing.assert_allclose(measured.share, np.cos(lean), rtol=1e-12)
    exponent, error, _, _ = measured.exponents
    assert exponent == pytest.approx(1.0, abs=error)
    assert error < 0.1


def test_thickness_does_not_fall_with_the_standoff_as_straight_rays_would(shared_data):
    """Particles of 600 m/s fly nearly parallel: neither 1 / L of a track nor 1 / L^2 of a spot."""
    _, _, exponent, error = inclined(shared_data).exponents
    assert exponent > 2.0 * error
    assert exponent < 0.5


def test_thickness_goes_as_one_over_the_speed(shared_data):
    speed, thickness = table(shared_data / 'hvof_wc17co_thickness_speed.csv')[:, :2].T
    slope, _ = np.polyfit(np.log(speed), np.log(thickness), 1)
    assert slope == pytest.approx(-1.0, abs=0.05)
