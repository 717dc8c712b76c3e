"""Refinement changes the triangles, not the part."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from paint_deposition.part.edges import coarse_faces, matched_half_edges
from paint_deposition.part.refinement import face_areas_m2, refine
from paint_deposition.part.surface import Surface
from surfaces import ball, on_grid, triangulated


@pytest.mark.parametrize('max_edge_length_m', [0.05, 0.02, 0.007])
def test_area_is_kept_and_edges_are_short(max_edge_length_m):
    vertices, faces = triangulated(ball(0.5), 0.06, jitter=0.3)
    surface = Surface.from_triangles(vertices, faces, max_edge_length_m)
    assert surface.area_m2 == pytest.approx(face_areas_m2(vertices, faces).sum(), rel=1e-12)
    assert surface.longest_edge_m <= max_edge_length_m


@pytest.mark.parametrize('seed', range(4))
def test_slivers_and_all_stay_one_surface(seed):
    rng = np.random.default_rng(seed)
    flat = rng.random((60, 2)) * [1.0, 0.05 + rng.random()]
    flat[:20, 1] *= 0.01
    vertices = np.column_stack([flat, np.zeros(60)])
    faces = upward(vertices, Delaunay(flat).simplices)
    fine, _, refined = refine(vertices, np.tile([0.0, 0, 1], (60, 1)), faces, 0.03)
    assert sides_m(fine, refined).max() <= 0.03
    np.testing.assert_array_equal(upward(fine, refined), refined)
    assert face_areas_m2(fine, refined).sum() == pytest.approx(
        face_areas_m2(vertices, faces).sum(), rel=1e-12
    )
    assert rim_length_m(fine, refined) == pytest.approx(rim_length_m(vertices, faces), rel=1e-12)
    assert not len(matched_half_edges(refined)[1])


def test_a_sliver_is_cut_into_pieces_as_wide_as_itself():
    vertices = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0.016]])
    fine, _, faces = refine(vertices, np.tile([0.0, -1, 0], (3, 1)), np.array([[0, 1, 2]]), 0.02)
    assert face_areas_m2(fine, faces).sum() == pytest.approx(0.008)
    assert sides_m(fine, faces).max() <= 0.02
    assert len(faces) < 170


def sides_m(vertices, faces):
    """(F, 3) lengths of the sides."""
    corners = vertices[faces]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)


def upward(vertices, faces):
    """The triangles with an area, wound to look up z."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    doubled = np.cross(b - a, c - a)[:, 2]
    faces = np.where(doubled[:, None] > 0, faces, faces[:, ::-1])
    return faces[np.abs(doubled) > 1e-9]


def rim_length_m(vertices, faces):
    """Length of the edges that only one triangle has."""
    *_, single = matched_half_edges(faces)
    ends = vertices[np.roll(faces, -1, axis=1).ravel()[single]]
    return np.linalg.norm(vertices[faces.ravel()[single]] - ends, axis=1).sum()


def test_a_picture_has_triangles_as_large_as_its_cells_and_joins_no_patches():
    line = np.linspace(0.0, 1.0, 201)
    x, y = np.meshgrid(line, line, indexing='ij')
    level, over = on_grid(np.stack([x, y, 0.0 * x], axis=2))
    # Two sheets that meet at x = 0 without a common vertex, as at a crease.
    vertices = np.concatenate([level, level * [-1.0, 1.0, 1.0]])
    faces = np.concatenate([over, over[:, ::-1] + len(level)])
    coarse = coarse_faces(vertices, faces, 0.02)
    assert len(coarse) < len(faces) / 10
    assert face_areas_m2(vertices, coarse).sum() == pytest.approx(2.0, rel=0.03)
    assert ((coarse < len(level)).all(axis=1) | (coarse >= len(level)).all(axis=1)).all()
