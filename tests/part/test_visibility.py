"""Lines of sight against shapes whose shadows are known."""

import numpy as np
import pytest
from trimesh.creation import box
from trimesh.util import concatenate

from paint_deposition.part.surface import Surface


@pytest.mark.parametrize('offset_m', [np.zeros(3), np.array([40.0, -25.0, 3.0])])
def test_all_of_an_open_surface_is_seen_wherever_it_is(triangles, ball, offset_m):
    vertices, faces = triangles(ball(0.5), 0.02, jitter=0.3)
    surface = Surface.from_triangles(vertices + offset_m, faces, 0.02)
    eyes = np.array([[0.0, -0.3, 0.0], [0.3, -0.4, 0.2]]) + offset_m
    seen = surface.occluder.sees(eyes[:, None], surface.vertices_m)
    assert seen.shape == (2, len(surface.vertices_m))
    assert seen.all()


def test_the_shadow_of_a_bar_ends_where_geometry_says():
    wall = box((1.0, 0.01, 1.0), transform=translation(y=0.005))
    bar = box((2.0, 0.02, 0.1), transform=translation(y=-0.2))
    both = concatenate([wall, bar])
    surface = Surface.from_triangles(both.vertices, np.asarray(both.faces), 0.05)
    z = np.linspace(-0.4, 0.4, 801)
    line = np.stack([0 * z, 0 * z, z], axis=1)
    seen = surface.occluder.sees([0.0, -0.4, 0.0], line)
    # The bar's front corners, 0.19 m before the eye, cast the edge onto the wall 0.4 m before it.
    edge_m = 0.05 * 0.4 / 0.19
    clear = np.abs(np.abs(z) - edge_m) > 2e-3
    np.testing.assert_array_equal(seen[clear], (np.abs(z) > edge_m)[clear])


def test_sky_view_factor_of_a_plane_and_of_convex_surface_is_one(make_surface, flat, ball):
    np.testing.assert_array_equal(make_surface(flat, 0.05).points().sky_view_factor, 1.0)
    np.testing.assert_allclose(
        make_surface(ball(0.4), 0.01).points().sky_view_factor, 1.0, atol=2e-3
    )


@pytest.mark.parametrize(('opening_deg', 'share'), [(60.0, 0.5), (90.0, 0.2), (140.0, 0.9)])
def test_sky_view_factor_in_a_groove(make_surface, fold, opening_deg, share):
    half = np.radians(opening_deg) / 2
    slant_m, length_m = 0.1, 3.0
    depth_m = slant_m * np.sin(half)
    groove = make_surface(
        fold(half - np.pi / 2), 0.1, 0.1, half_width_m=length_m, half_height_m=depth_m
    )
    s = share * slant_m
    point = np.array([[0.0, -s * np.cos(half), s * np.sin(half)]])
    # The other wall hides what lies between this wall and its own lip: (1 - sin) / 2, with the
    # sine of the lip's angle from the normal here.
    to_lip = np.array([-slant_m * np.cos(half), -slant_m * np.sin(half)]) - point[0, 1:]
    sine = to_lip @ [np.cos(half), -np.sin(half)] / np.linalg.norm(to_lip)
    hidden = 0.5 * (1.0 - sine)
    assert groove.at(point).sky_view_factor[0] == pytest.approx(1.0 - hidden, abs=0.02)


def translation(y: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[1, 3] = y
    return matrix
