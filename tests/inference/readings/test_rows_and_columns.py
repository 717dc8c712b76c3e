"""Rows and columns found among the places of readings."""

import numpy as np
import pytest

from booth import panel, path_of, serpentine
from paint_deposition.inference.readings.rows_and_columns import columns_or_rows
from paint_deposition.motion.path import SprayPath


def grid(columns_m, rows_m, stray_m=0.0) -> np.ndarray:
    """(N, 3) places on the booth's panel, columns one after the other."""
    x, z = (values.ravel() for values in np.meshgrid(columns_m, rows_m, indexing='ij'))
    stray = np.random.default_rng(3).uniform(-stray_m, stray_m, (2, len(x)))
    return np.stack([x + stray[0], np.zeros(len(x)), z + stray[1]], axis=1)


@pytest.fixture(scope='module')
def level() -> SprayPath:
    return path_of(serpentine())


@pytest.mark.parametrize('stray_m', [0.0, 0.01])
def test_a_grid_is_read_across_the_passes(level, stray_m):
    places = grid([-0.3, 0.0, 0.2], [-0.3, -0.2, -0.1, 0.0, 0.1], stray_m)
    labels = columns_or_rows(panel(), level, places)
    assert labels.tolist() == ['column 1'] * 5 + ['column 2'] * 5 + ['column 3'] * 5


def test_rows_serve_where_there_are_no_columns(level):
    x = np.linspace(-0.4, 0.4, 9)
    places = np.concatenate([grid(x, [0.2]), grid(x + 0.043, [-0.1])])
    labels = columns_or_rows(panel(), level, places)
    assert labels.tolist() == ['row 1'] * 9 + ['row 2'] * 9


def test_one_line_is_one_group(level):
    labels = columns_or_rows(panel(), level, grid([0.1], np.linspace(-0.4, 0.4, 12), 0.004))
    assert set(labels) == {'column 1'}


@pytest.mark.parametrize('seed', range(20))
def test_scattered_places_have_no_lines(level, seed):
    scattered = np.random.default_rng(seed).uniform(-0.4, 0.4, (40, 3)) * [1.0, 0.0, 1.0]
    assert not any(columns_or_rows(panel(), level, scattered))


def test_a_few_strays_belong_to_no_line(level):
    places = grid([-0.3, 0.3], np.linspace(-0.4, 0.4, 8))
    labels = columns_or_rows(panel(), level, np.vstack([places, [[0.05, 0.0, 0.33]]]))
    assert labels.tolist() == ['column 1'] * 8 + ['column 2'] * 8 + ['']
