"""Normals, curvature and slope of the surface, whatever its triangulation."""

import numpy as np
import pytest
from trimesh.creation import box

from paint_deposition.part.surface import Surface


def normals_off_rad(surface, exact):
    """Angle between the surface's normals and the exact ones at its vertices."""
    wanted = exact(surface.vertices_m)
    return np.linalg.norm(np.cross(surface.normals, wanted), axis=1)


def ball_normals(radius_m):
    """Outward normals of a ball whose foremost point is the origin."""

    def exact(points):
        way = points - np.array([0.0, radius_m, 0.0])
        return way / np.linalg.norm(way, axis=1, keepdims=True)

    return exact


def test_a_plane_is_exact(make_surface, flat):
    surface = make_surface(flat, 0.05, jitter=0.35)
    np.testing.assert_allclose(surface.normals, np.tile([0.0, -1, 0], (len(surface.normals), 1)))


@pytest.mark.parametrize(
    ('spacing_m', 'jitter', 'rms_deg'), [(0.01, 0.0, 0.001), (0.04, 0.35, 0.02), (0.1, 0.35, 0.2)]
)
def test_a_ball_up_to_the_rim(make_surface, ball, spacing_m, jitter, rms_deg):
    surface = make_surface(ball(0.8), spacing_m, half_width_m=0.4, jitter=jitter)
    off = np.degrees(normals_off_rad(surface, ball_normals(0.8)))
    assert np.sqrt(np.mean(off**2)) < rms_deg
    assert off.max() < 5 * rms_deg


def test_a_box_keeps_its_edges_sharp():
    body = box((0.3, 0.2, 0.1))
    surface = Surface.from_triangles(body.vertices, np.asarray(body.faces), 0.02)
    assert surface.area_m2 == pytest.approx(body.area)
    np.testing.assert_allclose(np.abs(surface.normals).max(axis=1), 1.0)
    outward = np.einsum('ij,ij->i', surface.normals, surface.vertices_m)
    assert (outward > 0.0).all()


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


def linear(points_m):
    return points_m @ np.array([3.0, -2.0, 5.0]) + 1.0


def test_exact_for_linear_fields_on_a_standing_plane(make_surface, flat):
    points = make_surface(flat, 0.03, jitter=0.3).points()
    np.testing.assert_allclose(points.slope_per_m @ linear(points.positions_m), -5.0)


def test_level_surface_has_none(triangles, flat):
    vertices, faces = triangles(flat, 0.05)
    lying = vertices[:, [0, 2, 1]] * [1, 1, -1]
    points = Surface.from_triangles(lying, faces, 0.02, down=[0, 0, -1]).points()
    np.testing.assert_allclose(points.slope_per_m @ linear(points.positions_m), 0.0, atol=1e-9)


def test_readings_get_the_slope_from_their_neighbours(make_surface, cylinder):
    surface = make_surface(cylinder(0.5), 0.01)
    readings = np.array([[0.0, 0.0, 0.02], [0.05, 0.01, -0.1], [-0.1, 0.0, 0.1]])
    points = surface.at(readings, stencil_m=0.006)
    assert len(points) == 9
    field = np.sin(12.0 * points.positions_m[:, 2])
    slope = points.slope_per_m @ field
    z = points.positions_m[:3, 2]
    tilt = np.sqrt(1.0 - (z / 0.5) ** 2)
    np.testing.assert_allclose(slope[:3], -12.0 * np.cos(12.0 * z) * tilt**2, rtol=0.01)
    np.testing.assert_array_equal(slope[3:], 0.0)


@pytest.mark.parametrize('z_m', [0.2, -0.2])
def test_readings_on_the_rim_get_the_one_sided_slope(make_surface, flat, z_m):
    points = make_surface(flat, 0.05).at(np.array([[0.0, 0.0, z_m]]), stencil_m=0.006)
    assert (points.slope_per_m @ linear(points.positions_m))[0] == pytest.approx(-5.0)
