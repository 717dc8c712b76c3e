"""Residuals spread over the surface around the readings."""

import numpy as np
import pytest

from paint_deposition.inference.comparison.regions import (
    interpolate_over_surface,
    interpolation_matrix,
    radius_of_readings_m,
    reached,
)
from paint_deposition.part.surface import Surface


@pytest.fixture
def plate():
    """Both sides of a thin square metre."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    vertices = np.concatenate([square, square + np.array([0, 0.002, 0])])
    both = np.concatenate([faces, faces[:, ::-1] + 4])
    return Surface.from_triangles(vertices, both, 0.04)


def test_an_even_residual_is_spread_evenly_within_the_radius_on_its_side(plate):
    points = np.array([[0.3, 0, 0.5], [0.6, 0, 0.5]])
    matrix = interpolation_matrix(plate, points, np.tile([0.0, -1.0, 0.0], (2, 1)), 0.2)
    front = plate.normals[:, 1] < 0
    distance = np.linalg.norm(plate.vertices_m[:, None] - points, axis=2).min(axis=1)
    assert np.array_equal(reached(matrix), front & (distance < 0.2))
    np.testing.assert_allclose((matrix @ [7.0, 7.0])[reached(matrix)], 7.0, rtol=1e-12)


def test_neighbours_count_the_nearer_the_more(plate):
    front = np.flatnonzero(plate.normals[:, 1] < 0)
    rows = front[[40, 41]]
    positions = plate.vertices_m[rows]
    values = interpolation_matrix(plate, positions, plate.normals[rows], 0.2) @ [-3.0, 5.0]
    apart = np.linalg.norm(positions[0] - positions[1])
    weight = (1.0 - (apart / 0.2) ** 2) ** 3
    assert values[rows[0]] == pytest.approx((-3.0 + 5.0 * weight) / (1.0 + weight), abs=1e-12)
    assert values.min() >= -3.0
    assert values.max() <= 5.0


@pytest.mark.parametrize(('angle_deg', 'same_side'), [(59.0, True), (61.0, False)])
def test_surface_turned_by_more_than_60_deg_is_another_side(plate, angle_deg, same_side):
    angle = np.radians(angle_deg)
    normal = np.array([[np.sin(angle), -np.cos(angle), 0.0]])
    field = interpolate_over_surface(plate, np.array([[0.5, 0.0, 0.5]]), normal, np.array([2.0]))
    front = plate.normals[:, 1] < 0
    assert np.isfinite(field[front]).any() == same_side
    assert np.isnan(field[~front]).all()


def test_the_radius_is_from_the_spacing_unless_given(plate):
    points = np.array([[0.3, 0, 0.5], [0.34, 0, 0.5], [0.38, 0, 0.5]])
    normals = np.tile([0.0, -1.0, 0.0], (3, 1))
    assert radius_of_readings_m(points) == pytest.approx(0.072)
    given = interpolation_matrix(plate, points, normals, radius_of_readings_m(points))
    assert (interpolation_matrix(plate, points, normals) != given).nnz == 0
