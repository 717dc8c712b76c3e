"""The smoothed surface that passes follow."""

import numpy as np
import pytest

from paint_deposition.errors import PlanError
from paint_deposition.part.surface import Surface
from paint_deposition.planning.surface_map import SurfaceMap, pass_axes


def sheet(height, half_m=0.5, count=41) -> Surface:
    """A surface y = height(x, z) that stands and looks to -y."""
    line = np.linspace(-half_m, half_m, count)
    x, z = (grid.ravel() for grid in np.meshgrid(line, line, indexing='ij'))
    i = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    faces = np.concatenate(
        [
            np.stack([i, i + count, i + 1], axis=1),
            np.stack([i + count, i + count + 1, i + 1], axis=1),
        ]
    )
    return Surface.from_triangles(np.stack([x, height(x, z), z], axis=1), faces, 0.05)


def test_axes_of_a_standing_part_seen_from_its_gun():
    surface = sheet(lambda x, z: 0.0 * x)
    level = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]]
    np.testing.assert_allclose(pass_axes(surface), level, atol=1e-9)
    vertical = [[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    np.testing.assert_allclose(pass_axes(surface, 'vertical'), vertical, atol=1e-9)


def test_a_plane_keeps_its_place_and_normal_to_its_edges():
    surface = sheet(lambda x, z: 0.2 * x - 0.1 * z)
    surface_map = SurfaceMap(surface, pass_axes(surface, outward=(0.0, -1.0, 0.0)), 0.1)
    u, v = (grid.ravel() for grid in np.meshgrid(*2 * [np.linspace(-0.45, 0.45, 15)]))
    places = surface_map.places_m(u, v)
    deviation = places[:, 1] - (0.2 * places[:, 0] - 0.1 * places[:, 2])
    assert np.abs(deviation).max() < 1.5e-3
    expected = np.array([0.2, -1.0, -0.1]) / np.linalg.norm([0.2, -1.0, -0.1])
    cosine = surface_map.normals(u, v) @ expected
    assert np.degrees(np.arccos(cosine.clip(-1, 1))).max() < 1.0


def test_what_is_finer_than_the_radius_is_smoothed_away_and_what_is_wider_kept():
    ripple = sheet(lambda x, z: 0.004 * np.sin(2.0 * np.pi * x / 0.06), count=121)
    bow = sheet(lambda x, z: 0.5 * x**2)
    u = np.linspace(-0.35, 0.35, 200)
    flat = SurfaceMap(ripple, pass_axes(ripple, outward=(0.0, -1.0, 0.0)), 0.15).height_m(
        u, 0.0 * u
    )
    assert np.ptp(flat) < 0.0015
    surface_map = SurfaceMap(bow, pass_axes(bow), 0.15)
    height = surface_map.height_m(u, 0.0 * u)
    # Curved by 1/m toward the gun's far side; a Gaussian of half the radius lowers it evenly.
    assert height[0] - height[100] == pytest.approx(-0.5 * 0.35**2, rel=0.05)


def test_hidden_and_averted_surface_is_not_painted():
    front, back = sheet(lambda x, z: 0.0 * x), sheet(lambda x, z: 0.0 * x + 0.2, half_m=0.2)
    both = Surface.from_triangles(
        np.concatenate([front.vertices_m, back.vertices_m]),
        np.concatenate([front.faces, back.faces + len(front.vertices_m)]),
        0.1,
    )
    surface_map = SurfaceMap(both, pass_axes(both), 0.1)
    y = both.vertices_m[:, 1]
    assert surface_map.painted[y < 0.1].all()
    assert not surface_map.painted[y > 0.1].any()


def test_ends_of_a_slanted_part_follow_the_pass():
    surface = sheet(lambda x, z: 0.0 * x)
    cut = surface.faces[surface.vertices_m[surface.faces].mean(axis=1) @ [1.0, 0.0, 1.0] < 0.0]
    part = Surface.from_triangles(surface.vertices_m, cut, 0.05)
    surface_map = SurfaceMap(part, pass_axes(part), 0.05)
    low, high = (np.ptp(surface_map.extent_near_m(z, 0.01)) for z in (0.4, -0.3))
    assert low > high + 0.4


def test_impossible_parts_are_refused():
    surface = sheet(lambda x, z: 0.0 * x)
    with pytest.raises(PlanError, match='no surface faces the gun'):
        SurfaceMap(surface, pass_axes(surface, outward=(0.0, 1.0, 0.0)), 0.1)
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
             [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip
    with pytest.raises(PlanError, match='closed'):
        pass_axes(Surface.from_triangles(box, np.array(faces), 0.5))
