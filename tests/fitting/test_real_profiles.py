"""The model's equations beside profiles that were really measured."""

import numpy as np
import pytest

from fitting.real_profiles import LANE_SPACING_FT, aicc, inclined, spot, table, transect
from paint_deposition.model.uniformity import ParallelPasses


def test_eq3_follows_a_moving_sprinkler_but_one_gaussian_would_do(shared_data):
    measured = transect(shared_data)
    residual = measured.three.residual_um
    peak = measured.depth_in.max()
    assert measured.three.rmse_um < 0.06 * peak
    simple = measured.depth_in - measured.one_in
    assert np.sqrt(np.mean(simple**2)) < 0.1 * peak
    # Eight parameters on sixteen stations: the criterion for few data prefers two.
    assert aicc(simple, 2) < aicc(residual, 8) - 10.0


def test_overlapped_lanes_are_as_uneven_as_the_transect_itself(shared_data):
    measured = transect(shared_data)
    x = np.arange(-112.0, 112.0, 1.0)
    lanes = [
        np.interp(x + LANE_SPACING_FT * k, measured.station_ft, measured.depth_in, 0.0, 0.0)
        for k in range(-2, 3)
    ]
    total = np.sum(lanes, axis=0)
    predicted = ParallelPasses.one_way(measured.three.collapse).sigma_n(LANE_SPACING_FT)
    assert predicted == pytest.approx(total.std() / total.mean(), abs=0.01)
    assert 0.10 < predicted < 0.13


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
