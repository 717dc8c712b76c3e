"""Curvature is signed k1 + k2, positive where concave toward the gun."""

import numpy as np
import pytest


def well_inside(points, margin_m=0.04, half_width_m=0.2):
    return np.abs(points.positions_m[:, [0, 2]]).max(axis=1) < half_width_m - margin_m


@pytest.mark.parametrize(
    ('radius_m', 'spacing_m', 'jitter'), [(0.25, 0.01, 0.0), (2.0, 0.02, 0.3), (-0.3, 0.02, 0.3)]
)
def test_cylinder(make_surface, cylinder, radius_m, spacing_m, jitter):
    points = make_surface(cylinder(radius_m), spacing_m, jitter=jitter).points()
    inside = points.curvature_per_m[well_inside(points)]
    np.testing.assert_allclose(inside, -1.0 / radius_m, rtol=0.02)


@pytest.mark.parametrize('radius_m', [0.4, -0.5])
def test_ball(make_surface, ball, radius_m):
    points = make_surface(ball(radius_m), 0.012, jitter=0.2).points()
    np.testing.assert_allclose(points.curvature_per_m, -2.0 / radius_m, rtol=0.02)


def test_a_sharp_ridge_shows_smoothed_and_holds_its_turn(make_surface, fold):
    lean = np.radians(25)
    surface = make_surface(fold(lean), 0.01)
    z = np.linspace(-0.08, 0.08, 401)
    across = surface.at(np.stack([0 * z, np.abs(z) * np.tan(lean), z], axis=1))
    assert across.curvature_per_m.min() < -10.0
    assert abs(across.curvature_per_m[[0, -1]]).max() < 1e-6
    turn = np.trapezoid(across.curvature_per_m, z / np.cos(lean))
    assert turn == pytest.approx(-2.0 * lean, rel=0.25)


def test_triangulation_does_not_show(make_surface):
    def wave(x, z):
        return 0.01 * np.sin(12.0 * z) + x**2

    places = np.random.default_rng(3).uniform(-0.15, 0.15, (200, 2))
    places = np.stack([places[:, 0], wave(*places.T), places[:, 1]], axis=1)
    fine = make_surface(wave, 0.008).at(places).curvature_per_m
    other = make_surface(wave, 0.019, jitter=0.3).at(places).curvature_per_m
    assert np.ptp(fine) > 2.0
    assert np.sqrt(np.mean((fine - other) ** 2)) < 0.06
