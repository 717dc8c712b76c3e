"""The slope operator is the derivative along gravity's component in the surface."""

import numpy as np
import pytest

from paint_deposition.part.surface import Surface


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
