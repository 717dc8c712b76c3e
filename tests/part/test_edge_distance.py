"""Distance to free edges, and what counts as one."""

import numpy as np
import pytest
from trimesh.creation import box, icosphere

from paint_deposition.part.surface import Surface


def test_a_sheet_has_its_rim(make_surface, flat):
    points = make_surface(flat, 0.05, jitter=0.3).points()
    expected = 0.2 - np.abs(points.positions_m[:, [0, 2]]).max(axis=1)
    np.testing.assert_allclose(points.edge_distance_m, expected, atol=1e-9)


def test_a_ball_has_none():
    ball = icosphere(subdivisions=3, radius=0.2)
    surface = Surface.from_triangles(ball.vertices, np.asarray(ball.faces), 0.05)
    assert np.isinf(surface.points().edge_distance_m).all()


def test_a_closed_plate_ends_where_it_folds_back():
    plate = box((0.4, 0.003, 0.4))
    surface = Surface.from_triangles(plate.vertices, np.asarray(plate.faces), 0.02)
    middle = surface.at([[0.05, -0.0015, 0.0]], normals=[[0.0, -1.0, 0.0]])
    assert middle.edge_distance_m[0] == pytest.approx(0.15)


@pytest.mark.parametrize('gap_m', [0.0, 1e-4])
def test_a_seam_between_patches_triangulated_apart_is_no_edge(triangles, flat, gap_m):
    one, one_faces = triangles(flat, 0.05, half_width_m=0.2)
    other, other_faces = triangles(flat, 0.03, half_width_m=0.2)
    other = other + np.array([0.4 + gap_m, 0.0, 0.0])
    faces = np.concatenate([one_faces, other_faces + len(one)])
    surface = Surface.from_triangles(np.concatenate([one, other]), faces, 0.02)
    near_seam = surface.at([[0.19, 0.0, 0.0], [0.21, 0.0, 0.05]])
    np.testing.assert_allclose(near_seam.edge_distance_m, [0.2, 0.15], atol=1e-3)
