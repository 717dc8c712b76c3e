"""Residuals in figures and spread over the skin."""

import numpy as np
import pytest

from paint_deposition.inference.residuals import Residuals, spreading
from paint_deposition.part.surface import Surface


def _residuals(predicted, measured, sigma=1.0):
    predicted, measured = np.array(predicted, float), np.array(measured, float)
    return Residuals(
        np.zeros((len(predicted), 3)),
        predicted,
        measured - predicted,
        np.full(len(predicted), sigma),
    )


def test_figures_by_hand():
    found = _residuals([0.0, 10.0, 20.0], [4.0, 12.0, 17.0], sigma=2.0)
    assert found.bias_um == pytest.approx(1.0)
    assert found.rmse_um == pytest.approx(np.sqrt((16 + 4 + 9) / 3))
    assert found.rmse_painted_um == pytest.approx(np.sqrt((4 + 9) / 2))
    assert found.chi_square_per_reading == pytest.approx(29 / 3 / 4)
    assert found.worst == 0
    assert found.painted.tolist() == [False, True, True]


def test_noise_alone_has_a_chi_square_of_one():
    noise = np.random.default_rng(3).normal(scale=0.7, size=4000)
    found = _residuals(np.full(4000, 20.0), 20.0 + noise, sigma=0.7)
    assert found.chi_square_per_reading == pytest.approx(1.0, abs=0.07)


def test_without_paint_nothing_is_off_where_painted():
    assert _residuals([0.0, 0.0], [5.0, 5.0]).rmse_painted_um == 0.0


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
    matrix = spreading(
        plate.vertices_m, plate.normals, points, np.tile([0.0, -1.0, 0.0], (2, 1)), 0.2
    )
    reached = np.diff(matrix.indptr) > 0
    front = plate.normals[:, 1] < 0
    distance = np.linalg.norm(plate.vertices_m[:, None] - points, axis=2).min(axis=1)
    assert np.array_equal(reached, front & (distance < 0.2))
    assert np.allclose((matrix @ [7.0, 7.0])[reached], 7.0)


def test_a_vertex_on_a_point_takes_its_value(plate):
    front = np.flatnonzero(plate.normals[:, 1] < 0)
    rows = front[[40, 41]]
    matrix = spreading(
        plate.vertices_m, plate.normals, plate.vertices_m[rows], plate.normals[rows], 0.2
    )
    values = matrix @ np.array([-3.0, 5.0])
    assert values[rows] == pytest.approx([-3.0, 5.0], abs=0.05)
    # Between them, between.
    reached = np.diff(matrix.indptr) > 0
    assert values[reached].min() >= -3.0
    assert values[reached].max() <= 5.0
