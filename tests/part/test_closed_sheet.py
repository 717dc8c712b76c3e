"""A sheet drawn as a solid, with thickness, inner surface and rim, is the same part to the gun."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface, toward_the_guns
from surfaces import hemmed, on_grid, solid, triangulated

pytestmark = pytest.mark.slow

STANDOFF_M = 0.25
SIDES = {'-y': 0.0, '+x': 90.0, '+y': 180.0, '-x': 270.0, 'askew': 205.0}
WIDTH_M, HEIGHT_M = 0.6, 0.5


def door_depth(x, z):
    """A crowned door with a convex line of 24 degrees, in 8 facets, 0.1 m above the middle."""
    lean = np.radians(12.0)
    soft = 0.02
    line = np.tan(lean) * soft * np.logaddexp((z - 0.1) / soft, (0.1 - z) / soft)
    return 0.15 * x**2 + 0.1 * z**2 + line


@cache
def parts(side: str, thickness_m: float) -> tuple[Surface, Surface]:
    """The outer surface alone and the solid, both seen by the gun; see ``solid``."""
    open_sheet = triangulated(door_depth, 0.015, 0.5 * WIDTH_M, 0.5 * HEIGHT_M, jitter=0.2)
    turn = Rotation.from_euler('z', SIDES[side], degrees=True)
    looking = turn.apply([0.0, 1.0, 0.0])
    x, z = (w.ravel() for w in np.meshgrid([-0.4, -0.2, 0.0, 0.2], [-0.2, 0.0, 0.2]))
    eyes = turn.apply(np.stack([x, np.full_like(x, -STANDOFF_M), z], axis=1))
    seen = []
    for vertices, faces in (open_sheet, solid(*open_sheet, thickness_m)):
        surface = Surface.from_triangles(turn.apply(vertices), faces, 0.03)
        seen.append(toward_the_guns(surface, [(eyes, np.tile(looking, (len(eyes), 1)))]))
    return seen[0], seen[1]


def on_both(sheet: Surface, shell: Surface) -> tuple[SurfacePoints, SurfacePoints]:
    """The middles of the sheet's triangles, up to the rim, on the sheet and on the solid."""
    alone = sheet.at(sheet.vertices_m[sheet.faces].mean(axis=1))
    return alone, shell.at(alone.positions_m, alone.normals)


def assert_same(there: SurfacePoints, alone: SurfacePoints) -> None:
    """Far from the edge that of the inner surface can be a little nearer than one's own."""
    np.testing.assert_allclose(there.normals, alone.normals, atol=1e-9)
    np.testing.assert_allclose(there.curvature_per_m, alone.curvature_per_m, atol=1e-6)
    near = alone.edge_distance_m < 0.05
    np.testing.assert_allclose(there.edge_distance_m[near], alone.edge_distance_m[near], atol=1e-9)
    assert (there.edge_distance_m[~near] > 0.05).all()


@pytest.mark.parametrize(
    ('side', 'thickness_m'),
    [('-y', 0.012), ('+x', 0.012), ('+y', 0.003), ('-x', 0.04), ('askew', 0.003)],
)
def test_the_outer_surface_of_the_solid_is_the_sheet(side, thickness_m):
    sheet, shell = parts(side, thickness_m)
    alone, there = on_both(sheet, shell)
    np.testing.assert_allclose(there.positions_m, alone.positions_m, atol=1e-9)
    assert np.ptp(alone.curvature_per_m) > 5.0
    assert_same(there, alone)


@pytest.mark.parametrize(('tilt_deg', 'poses'), [(-40.0, 7), (0.0, 1), (40.0, 400)])
def test_any_motion_in_front_tells_the_same_side_to_the_last_bit(tilt_deg, poses):
    _, shell = parts('+x', 0.012)
    rng = np.random.default_rng(poses)
    eyes = np.stack([np.full(poses, 0.2), *rng.uniform(-0.05, 0.05, (2, poses))], axis=1)
    tilts = np.stack([np.zeros(poses), *rng.normal(0.0, 3.0, (2, poses))], axis=1)
    tilts[:, 2] += tilt_deg
    axes = Rotation.from_euler('xyz', tilts, degrees=True).apply([-1.0, 0.0, 0.0])
    unseen = Surface(**{name: getattr(shell, name) for name in (
        'vertices_m', 'faces', 'normals', 'vertex_areas_m2', 'down', 'rim_m')})  # fmt: skip
    told = toward_the_guns(unseen, [(eyes, axes)])
    np.testing.assert_array_equal(told.outward, shell.outward)
    assert toward_the_guns(shell, [(eyes, axes)]) is shell


def test_readings_without_normals_lie_on_the_side_that_the_gun_paints():
    sheet, shell = parts('+x', 0.003)
    rng = np.random.default_rng(2)
    inner = np.flatnonzero(sheet.points().edge_distance_m > 0.01)
    some = sheet.at(sheet.vertices_m[rng.choice(inner, 100)])
    inside = sheet.outward * -rng.uniform(0.0016, 0.004, (100, 1))
    place = shell.at(some.positions_m + inside)
    assert (place.normals @ shell.outward > 0.8).all()
    assert np.linalg.norm(place.positions_m - some.positions_m, axis=1).max() < 0.002


@pytest.mark.parametrize(('thickness_m', 'facets'), [(0.002, 6), (0.003, 2), (0.012, 8)])
def test_a_round_hem_is_an_edge_and_no_curvature(thickness_m, facets):
    vertices, faces = triangulated(lambda x, z: 0.15 * x**2 + 0.1 * z**2, 0.015, jitter=0.2)
    sheet = Surface.from_triangles(vertices, faces, 0.03)
    shell = Surface.from_triangles(*hemmed(vertices, faces, thickness_m, facets), 0.03)
    alone, there = on_both(sheet, shell)
    assert_same(there, alone)


@pytest.mark.parametrize(('turn_deg', 'radius_m'), [(20.0, 0.03), (40.0, 0.003), (40.0, 0.01)])
def test_a_rounded_line_across_the_door_is_no_hem(turn_deg, radius_m):
    lean = np.radians(0.5 * turn_deg)
    half_m = radius_m * np.sin(lean)
    x = np.linspace(-0.2, 0.2, 5)
    z = np.concatenate([np.linspace(-0.2, -half_m, 8), np.linspace(-half_m, half_m, 9)[1:-1],
                        np.linspace(half_m, 0.2, 8)])  # fmt: skip
    within = np.minimum(np.abs(z), half_m)
    y = radius_m - np.sqrt(radius_m**2 - within**2) + (np.abs(z) - within) * np.tan(lean)
    grid = np.stack(np.broadcast_arrays(x[:, np.newaxis], y, z), axis=2)
    surface = Surface.from_triangles(*on_grid(grid), 0.02)
    middle = surface.at([[0.0, 0.0, 0.0]])
    assert middle.edge_distance_m[0] == pytest.approx(0.2, abs=1e-6)
    assert middle.curvature_per_m[0] < -np.radians(turn_deg) / 0.06
