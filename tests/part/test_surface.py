"""The surface: where points lie on it, its derivatives and its edges."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trimesh.creation import box, icosphere

from paint_deposition.part.points import across_axis, angles_rad, downhill_axis
from paint_deposition.part.surface import Surface
from surfaces import ball, cylinder, flat, fold, refined, triangulated


def test_agrees_with_every_triangle_tried():
    surface = refined(lambda x, z: 0.05 * np.sin(20 * x) * np.cos(15 * z), 0.03, jitter=0.3)
    points = np.random.default_rng(1).uniform([-0.3, -0.2, -0.3], [0.3, 0.2, 0.3], (40, 3))
    *_, found = surface.locate(points)
    from trimesh.triangles import closest_point

    corners = surface.vertices_m[surface.faces]
    for point, distance in zip(points, found, strict=True):
        nearest = closest_point(corners, np.tile(point, (len(corners), 1)))
        assert distance == pytest.approx(np.linalg.norm(nearest - point, axis=1).min())


def test_the_side_that_the_normal_agrees_with_wins_and_one_that_none_does_shows_in_the_angle():
    plate = box((0.4, 0.002, 0.4))
    surface = Surface.from_triangles(plate.vertices, np.asarray(plate.faces), 0.02)
    just_inside_the_front = np.array([[0.03, -0.0006, 0.02]])
    front = surface.at(just_inside_the_front, normals=[[0.0, -1.0, 0.0]])
    back = surface.at(just_inside_the_front, normals=[[0.1, 1.0, 0.0]])
    np.testing.assert_allclose(front.positions_m, [[0.03, -0.001, 0.02]], atol=1e-12)
    np.testing.assert_allclose(back.positions_m, [[0.03, 0.001, 0.02]], atol=1e-12)
    np.testing.assert_allclose(back.normals, [[0.0, 1.0, 0.0]], atol=1e-12)
    beside = np.array([[0.0, 1.0, 0.0]])
    _, outward, distance_m = refined(flat, 0.05).locate(0.01 * beside, normals=beside)
    assert (*angles_rad(outward, beside), *distance_m) == pytest.approx((np.pi, 0.01))


def test_a_standing_part_has_z_up_and_a_lying_one_y():
    vertices, faces = triangulated(flat, 0.1)
    standing = Surface.from_triangles(vertices, faces, 0.05)
    lying = Surface.from_triangles(vertices[:, [0, 2, 1]], faces, 0.05)
    told = Surface.from_triangles(vertices, faces, 0.05, down=[0.0, 3.0, 0.0])
    np.testing.assert_array_equal(standing.down, [0, 0, -1])
    np.testing.assert_array_equal(lying.down, [0, -1, 0])
    np.testing.assert_array_equal(told.down, [0, 1, 0])
    assert (standing.notes, told.notes) == ((), ())
    assert 'gravity is taken along -y' in lying.notes[0]


def hood(lean_deg, height_m=0.9):
    """A crowned hood in car coordinates, x to the rear, z up; it falls toward the front."""
    vertices, faces = triangulated(lambda x, z: 0.3 * (x**2 + 0.5 * z**2), 0.05, half_width_m=0.6)
    lying = vertices @ np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0]], dtype=float)
    turn = Rotation.from_euler('y', -lean_deg, degrees=True)
    return Surface.from_triangles(turn.apply(lying) + height_m * np.eye(3)[2], faces, 0.05)


def test_a_hood_lies_in_the_booth_and_its_front_is_below():
    surface = hood(8.0)
    assert surface.outward[2] > 0.98
    np.testing.assert_array_equal(surface.down, [0, 0, -1])
    assert 'as a hood or a roof does: gravity is taken along -z' in surface.notes[0]
    # From above, with the front below, the right side of the picture is that of -y.
    across = across_axis(surface.outward, surface.down)
    np.testing.assert_allclose(across, [0, -1, 0], atol=1e-4)
    assert downhill_axis(surface.outward, surface.down)[0] < -0.98


def test_readings_selections_and_other_processes_see_the_covariates_of_the_vertices():
    surface = refined(cylinder(-0.3), 0.04, 0.03)
    points, some = surface.points(), slice(None, None, 20)
    covariates = 'curvature_per_m', 'edge_distance_m', 'sky_view_factor', 'height_fraction'
    at = surface.at(points.positions_m[some], points.normals[some])
    for name in covariates:
        np.testing.assert_allclose(getattr(at, name), getattr(points, name)[some], atol=1e-6)
    chosen = points.select(points.positions_m[:, 2] > 0.1)
    rows = np.flatnonzero(points.positions_m[:, 2] > 0.1)
    for name in ('positions_m', 'normals', 'area_m2', *covariates):
        np.testing.assert_array_equal(getattr(chosen, name), getattr(points, name)[rows])
    again = pickle.loads(pickle.dumps(surface)).points()
    copied = pickle.loads(pickle.dumps(points))
    np.testing.assert_array_equal(copied.sky_view_factor, points.sky_view_factor)
    np.testing.assert_array_equal(again.curvature_per_m, points.curvature_per_m)


def test_another_refinement_place_or_winding_is_another_mesh():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    part, same = (Surface.from_triangles(corners, faces, 0.2) for _ in range(2))
    others = [
        Surface.from_triangles(corners, faces, 0.1),
        Surface.from_triangles(corners + 1e-9, faces, 0.2),
        replace(part, faces=part.faces[:, ::-1]),
    ]
    assert same.mesh_id == part.mesh_id
    assert len({surface.mesh_id for surface in (part, *others)}) == 4


@pytest.mark.parametrize(
    ('spacing_m', 'jitter', 'rms_deg'), [(0.01, 0.0, 0.001), (0.04, 0.35, 0.02), (0.1, 0.35, 0.2)]
)
def test_the_normals_of_a_ball_are_right_up_to_its_rim(spacing_m, jitter, rms_deg):
    surface = refined(ball(0.8), spacing_m, half_width_m=0.4, jitter=jitter)
    exact = surface.vertices_m - np.array([0.0, 0.8, 0.0])  # from its centre
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    off = np.degrees(np.linalg.norm(np.cross(surface.normals, exact), axis=1))
    assert np.sqrt(np.mean(off**2)) < rms_deg
    assert off.max() < 5 * rms_deg


def test_a_plane_has_exact_normals_and_a_box_keeps_its_edges_sharp():
    surface = refined(flat, 0.05, jitter=0.35)
    np.testing.assert_allclose(surface.normals, np.tile([0.0, -1, 0], (len(surface.normals), 1)))
    body = box((0.3, 0.2, 0.1))
    surface = Surface.from_triangles(body.vertices, np.asarray(body.faces), 0.02)
    assert surface.area_m2 == pytest.approx(body.area)
    np.testing.assert_allclose(np.abs(surface.normals).max(axis=1), 1.0)
    outward = np.einsum('ij,ij->i', surface.normals, surface.vertices_m)
    assert (outward > 0.0).all()


@pytest.mark.parametrize(
    ('radius_m', 'spacing_m', 'jitter'), [(0.25, 0.01, 0.0), (2.0, 0.02, 0.3), (-0.3, 0.02, 0.3)]
)
def test_the_curvature_of_a_cylinder(radius_m, spacing_m, jitter):
    points = refined(cylinder(radius_m), spacing_m, jitter=jitter).points()
    # Away from the rim by 40 mm.
    inside = np.abs(points.positions_m[:, [0, 2]]).max(axis=1) < 0.16
    np.testing.assert_allclose(points.curvature_per_m[inside], -1.0 / radius_m, rtol=0.02)


@pytest.mark.parametrize('radius_m', [0.4, -0.5])
def test_the_curvature_of_a_ball(radius_m):
    points = refined(ball(radius_m), 0.012, jitter=0.2).points()
    np.testing.assert_allclose(points.curvature_per_m, -2.0 / radius_m, rtol=0.02)


def test_a_sharp_ridge_shows_smoothed_and_holds_its_turn():
    lean = np.radians(25)
    surface = refined(fold(lean), 0.01)
    z = np.linspace(-0.08, 0.08, 401)
    across = surface.at(np.stack([0 * z, np.abs(z) * np.tan(lean), z], axis=1))
    assert across.curvature_per_m.min() < -10.0
    assert abs(across.curvature_per_m[[0, -1]]).max() < 1e-6
    turn = np.trapezoid(across.curvature_per_m, z / np.cos(lean))
    assert turn == pytest.approx(-2.0 * lean, rel=0.25)


def test_triangulation_does_not_show():
    def wave(x, z):
        return 0.01 * np.sin(12.0 * z) + x**2

    places = np.random.default_rng(3).uniform(-0.15, 0.15, (200, 2))
    places = np.stack([places[:, 0], wave(*places.T), places[:, 1]], axis=1)
    fine = refined(wave, 0.008).at(places).curvature_per_m
    other = refined(wave, 0.019, jitter=0.3).at(places).curvature_per_m
    assert np.ptp(fine) > 2.0
    assert np.sqrt(np.mean((fine - other) ** 2)) < 0.06


def linear(points_m):
    return points_m @ np.array([3.0, -2.0, 5.0]) + 1.0


def test_the_slope_is_exact_for_linear_fields_on_a_standing_plane_and_none_on_a_level_one():
    points = refined(flat, 0.03, jitter=0.3).points()
    np.testing.assert_allclose(points.slope_per_m @ linear(points.positions_m), -5.0)
    vertices, faces = triangulated(flat, 0.05)
    lying = vertices[:, [0, 2, 1]] * [1, 1, -1]
    points = Surface.from_triangles(lying, faces, 0.02, down=[0, 0, -1]).points()
    np.testing.assert_allclose(points.slope_per_m @ linear(points.positions_m), 0.0, atol=1e-9)


def test_readings_get_the_slope_from_their_neighbours_and_a_one_sided_one_on_the_rim():
    surface = refined(cylinder(0.5), 0.01)
    readings = np.array([[0.0, 0.0, 0.02], [0.05, 0.01, -0.1], [-0.1, 0.0, 0.1]])
    points = surface.at(readings, stencil_m=0.006)
    assert len(points) == 9
    field = np.sin(12.0 * points.positions_m[:, 2])
    slope = points.slope_per_m @ field
    z = points.positions_m[:3, 2]
    tilt = np.sqrt(1.0 - (z / 0.5) ** 2)
    np.testing.assert_allclose(slope[:3], -12.0 * np.cos(12.0 * z) * tilt**2, rtol=0.01)
    np.testing.assert_array_equal(slope[3:], 0.0)
    rim = np.array([[0.0, 0.0, 0.2], [0.0, 0.0, -0.2]])
    points = refined(flat, 0.05).at(rim, stencil_m=0.006)
    slope = points.slope_per_m @ linear(points.positions_m)
    np.testing.assert_allclose(slope[:2], -5.0)


def test_a_sheet_has_its_rim_a_ball_none_and_a_closed_plate_ends_where_it_folds_back():
    points = refined(flat, 0.05, jitter=0.3).points()
    expected = 0.2 - np.abs(points.positions_m[:, [0, 2]]).max(axis=1)
    np.testing.assert_allclose(points.edge_distance_m, expected, atol=1e-9)
    ball = icosphere(subdivisions=3, radius=0.2)
    surface = Surface.from_triangles(ball.vertices, np.asarray(ball.faces), 0.05)
    assert np.isinf(surface.points().edge_distance_m).all()
    plate = box((0.4, 0.003, 0.4))
    surface = Surface.from_triangles(plate.vertices, np.asarray(plate.faces), 0.02)
    middle = surface.at([[0.05, -0.0015, 0.0]], normals=[[0.0, -1.0, 0.0]])
    assert middle.edge_distance_m[0] == pytest.approx(0.15)


@pytest.mark.parametrize('gap_m', [0.0, 1e-4])
def test_a_seam_between_patches_triangulated_apart_is_no_edge(gap_m):
    one, one_faces = triangulated(flat, 0.05, half_width_m=0.2)
    other, other_faces = triangulated(flat, 0.03, half_width_m=0.2)
    other = other + np.array([0.4 + gap_m, 0.0, 0.0])
    faces = np.concatenate([one_faces, other_faces + len(one)])
    surface = Surface.from_triangles(np.concatenate([one, other]), faces, 0.02)
    near_seam = surface.at([[0.19, 0.0, 0.0], [0.21, 0.0, 0.05]])
    np.testing.assert_allclose(near_seam.edge_distance_m, [0.2, 0.15], atol=1e-3)
