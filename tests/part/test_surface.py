"""Where points lie on the surface, and which way is down."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trimesh.creation import box

from paint_deposition.part.orientation import across_axis, downhill_axis
from paint_deposition.part.surface import Surface


def thin_plate(thickness_m=0.002):
    plate = box((0.4, thickness_m, 0.4))
    return Surface.from_triangles(plate.vertices, np.asarray(plate.faces), 0.02)


def test_agrees_with_every_triangle_tried(make_surface):
    surface = make_surface(lambda x, z: 0.05 * np.sin(20 * x) * np.cos(15 * z), 0.03, jitter=0.3)
    points = np.random.default_rng(1).uniform([-0.3, -0.2, -0.3], [0.3, 0.2, 0.3], (40, 3))
    found = surface.locate(points).distance_m
    from trimesh.triangles import closest_point

    corners = surface.vertices_m[surface.faces]
    for point, distance in zip(points, found, strict=True):
        nearest = closest_point(corners, np.tile(point, (len(corners), 1)))
        assert distance == pytest.approx(np.linalg.norm(nearest - point, axis=1).min())


def test_the_side_that_the_normal_agrees_with_wins():
    surface = thin_plate()
    just_inside_the_front = np.array([[0.03, -0.0006, 0.02]])
    front = surface.at(just_inside_the_front, normals=[[0.0, -1.0, 0.0]])
    back = surface.at(just_inside_the_front, normals=[[0.1, 1.0, 0.0]])
    np.testing.assert_allclose(front.positions_m, [[0.03, -0.001, 0.02]], atol=1e-12)
    np.testing.assert_allclose(back.positions_m, [[0.03, 0.001, 0.02]], atol=1e-12)
    np.testing.assert_allclose(back.normals, [[0.0, 1.0, 0.0]], atol=1e-12)


def test_a_normal_that_nothing_agrees_with_shows_in_the_angle(make_surface, flat):
    place = make_surface(flat, 0.05).locate([[0.0, 0.01, 0.0]], normals=[[0.0, 1.0, 0.0]])
    assert place.angle_rad[0] == pytest.approx(np.pi)
    assert place.distance_m[0] == pytest.approx(0.01)


def test_a_standing_part_has_z_up_and_a_lying_one_y(triangles, flat):
    vertices, faces = triangles(flat, 0.1)
    standing = Surface.from_triangles(vertices, faces, 0.05)
    lying = Surface.from_triangles(vertices[:, [0, 2, 1]], faces, 0.05)
    told = Surface.from_triangles(vertices, faces, 0.05, down=[0.0, 3.0, 0.0])
    np.testing.assert_array_equal(standing.down, [0, 0, -1])
    np.testing.assert_array_equal(lying.down, [0, -1, 0])
    np.testing.assert_array_equal(told.down, [0, 1, 0])
    assert (standing.notes, told.notes) == ((), ())
    assert 'gravity is taken along -y' in lying.notes[0]


def hood(triangles, lean_deg, height_m=0.9):
    """A crowned hood in car coordinates, x to the rear, z up; it falls toward the front."""
    vertices, faces = triangles(lambda x, z: 0.3 * (x**2 + 0.5 * z**2), 0.05, half_width_m=0.6)
    lying = vertices @ np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0]], dtype=float)
    turn = Rotation.from_euler('y', -lean_deg, degrees=True)
    return Surface.from_triangles(turn.apply(lying) + height_m * np.eye(3)[2], faces, 0.05)


def test_a_hood_lies_in_the_booth_and_its_front_is_below(triangles):
    surface = hood(triangles, 8.0)
    assert surface.outward[2] > 0.98
    np.testing.assert_array_equal(surface.down, [0, 0, -1])
    assert 'as a hood or a roof does: gravity is taken along -z' in surface.notes[0]
    # From above, with the front below, the right side of the picture is that of -y.
    across = across_axis(surface.outward, surface.down)
    np.testing.assert_allclose(across, [0, -1, 0], atol=1e-4)
    assert downhill_axis(surface.outward, surface.down)[0] < -0.98


def test_readings_see_the_covariates_of_the_vertices_they_lie_on(make_surface, cylinder):
    surface = make_surface(cylinder(-0.3), 0.04, 0.03)
    points, some = surface.points(), slice(None, None, 20)
    at = surface.at(points.positions_m[some], points.normals[some])
    for name in ('curvature_per_m', 'edge_distance_m', 'sky_view_factor', 'height_fraction'):
        np.testing.assert_allclose(getattr(at, name), getattr(points, name)[some], atol=1e-6)


def test_a_selection_keeps_what_belongs_to_its_points(make_surface, cylinder):
    points = make_surface(cylinder(-0.3), 0.05).points()
    chosen = points.select(points.positions_m[:, 2] > 0.1)
    rows = np.flatnonzero(points.positions_m[:, 2] > 0.1)
    for name in ('positions_m', 'normals', 'area_m2', 'curvature_per_m', 'sky_view_factor',
                 'edge_distance_m', 'height_fraction'):  # fmt: skip
        np.testing.assert_array_equal(getattr(chosen, name), getattr(points, name)[rows])


def test_surface_and_points_go_to_other_processes(make_surface, cylinder):
    surface = make_surface(cylinder(0.5), 0.05)
    points = surface.points()
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
