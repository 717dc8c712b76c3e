"""What is seen: lines of sight and rays, and the sides of a part."""

import numpy as np
import pytest
from trimesh.creation import box
from trimesh.transformations import translation_matrix
from trimesh.util import concatenate

from paint_deposition.part.points import across_axis, downhill_axis
from paint_deposition.part.surface import Surface, facing, toward_the_guns
from paint_deposition.part.visibility import sees
from surfaces import ball, flat, fold, refined, triangulated


@pytest.mark.parametrize('offset_m', [np.zeros(3), np.array([40.0, -25.0, 3.0])])
def test_all_of_an_open_surface_is_seen_wherever_it_is(offset_m):
    vertices, faces = triangulated(ball(0.5), 0.02, jitter=0.3)
    surface = Surface.from_triangles(vertices + offset_m, faces, 0.02)
    eyes = np.array([[0.0, -0.3, 0.0], [0.3, -0.4, 0.2]]) + offset_m
    seen = sees(surface.obstacle, eyes[:, None], surface.vertices_m)
    assert seen.shape == (2, len(surface.vertices_m))
    assert seen.all()


def test_the_shadow_of_a_bar_ends_where_geometry_says():
    wall = box((1.0, 0.01, 1.0), transform=translation_matrix([0.0, 0.005, 0.0]))
    bar = box((2.0, 0.02, 0.1), transform=translation_matrix([0.0, -0.2, 0.0]))
    both = concatenate([wall, bar])
    surface = Surface.from_triangles(both.vertices, np.asarray(both.faces), 0.05)
    z = np.linspace(-0.4, 0.4, 801)
    line = np.stack([0 * z, 0 * z, z], axis=1)
    seen = sees(surface.obstacle, [0.0, -0.4, 0.0], line)
    # The bar's front corners, 0.19 m before the eye, cast the edge onto the wall 0.4 m before it.
    edge_m = 0.05 * 0.4 / 0.19
    clear = np.abs(np.abs(z) - edge_m) > 2e-3
    np.testing.assert_array_equal(seen[clear], (np.abs(z) > edge_m)[clear])


def test_sky_view_factor_of_a_plane_and_of_convex_surface_is_one():
    np.testing.assert_array_equal(refined(flat, 0.05).points().sky_view_factor, 1.0)
    np.testing.assert_allclose(refined(ball(0.4), 0.01).points().sky_view_factor, 1.0, atol=2e-3)


@pytest.mark.parametrize(('opening_deg', 'share'), [(60.0, 0.5), (90.0, 0.2), (140.0, 0.9)])
def test_sky_view_factor_in_a_groove(opening_deg, share):
    half = np.radians(opening_deg) / 2
    slant_m, length_m = 0.1, 3.0
    depth_m = slant_m * np.sin(half)
    groove = refined(
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


def crossings(surface, start, way):
    """Where a ray crosses the plane of each triangle, inf beside the triangle or behind."""
    a, b, c = surface.vertices_m[surface.faces].transpose(1, 0, 2)
    columns = np.stack([b - a, c - a, np.broadcast_to(-way, a.shape)], axis=2)
    one, other, along = np.linalg.solve(columns, (start - a)[:, :, np.newaxis])[:, :, 0].T
    return np.where(
        (np.minimum(one, other) >= 0) & (one + other <= 1) & (along >= 0), along, np.inf
    )


def test_the_first_of_all_triangles_that_a_ray_crosses():
    waves = refined(lambda x, z: 0.05 * np.sin(20 * x) * np.cos(15 * z), 0.02, 0.05, jitter=0.3)
    rng = np.random.default_rng(3)
    starts, ways = rng.uniform(-0.15, 0.15, (300, 3)), rng.normal(size=(300, 3))
    met = waves.first_faces(starts, ways)
    for start, way, face in zip(starts, ways, met, strict=True):
        along = crossings(waves, start, way)
        assert face == (np.argmin(along) if np.isfinite(along.min()) else -1)
    assert 0.1 < np.mean(met >= 0) < 0.9


X, Y, Z = np.eye(3)


@pytest.mark.parametrize(
    ('outward', 'across', 'downhill'),
    [
        (-Y, X, -Z),  # stands before a gun that looks along y
        (X, Y, -Z),
        (np.sqrt(0.5) * (Z - Y), X, -np.sqrt(0.5) * (Y + Z)),  # leans back
        (Z, X, -Y),  # lies flat
        (-Z, X, Y),  # hangs overhead
    ],
)
def test_across_is_to_the_right_of_the_gun_and_level(outward, across, downhill):
    np.testing.assert_allclose(across_axis(outward, -Z), across, atol=1e-12)
    np.testing.assert_allclose(downhill_axis(outward, -Z), downhill, atol=1e-12)
    np.testing.assert_allclose(across_axis(X, -X), Y, atol=1e-12)  # flat, where x is vertical


EYES = np.array([[0.0, -0.25, 0.0], [0.1, -0.25, 0.1], [-0.1, -0.25, 0.0], [3.0, -0.25, 0.0]])
AHEAD = np.tile([0.0, 1.0, 0.0], (4, 1))


def test_a_part_sprayed_from_behind_is_turned_and_says_so():
    surface = refined(ball(0.5), 0.05)
    assert toward_the_guns(surface, [(EYES, AHEAD)]) is surface
    turned = toward_the_guns(surface, [(EYES * [1, -3, 1], -AHEAD)])
    np.testing.assert_array_equal(turned.normals, -surface.normals)
    np.testing.assert_allclose(turned.points().curvature_per_m, -surface.points().curvature_per_m)
    assert facing(turned, EYES * [1, -3, 1], -AHEAD)[:2] == (3, 0)
    assert turned.notes == (
        '3 of 3 poses look at the back of the mesh: its triangles were turned round',
    )
