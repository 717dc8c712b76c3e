"""Rows and columns among readings; those off the part are refused with the likely cause."""

import numpy as np
import pytest

from booth import panel, path_of, serpentine
from paint_deposition.errors import ReadingsError
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.inference.readings.placement import columns_or_rows, unit_in_doubt
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.motion.path import SprayPath

# On the booth's panel, one metre by one about the origin in x-z.
PLACES_M = np.array([[-0.4, 0.0, -0.3], [0.1, 0.0, 0.2], [0.3, 0.0, 0.45], [-0.2, 0.0, 0.1]])


def placed(positions_m: np.ndarray) -> Experiment:
    readings = Readings.of(positions_m, np.full(len(positions_m), 20.0))
    return Experiment.of('panel', panel(), SprayPath.empty(), readings)


@pytest.mark.parametrize(
    ('positions_m', 'words'),
    [
        (1000.0 * PLACES_M, 'they fit in millimetres'),
        (0.001 * PLACES_M, r'all points lie on one spot: .* they fit in metres'),
        (PLACES_M / 0.0254, 'they fit in inches'),
        (np.add(PLACES_M, [2.0, 0.5, 0.0]), 'they look like positions in another frame'),
        (np.vstack([PLACES_M, [[0.0, 0.3, 0.0]]]), 'most points lie on the part'),
        (PLACES_M * 3.0, 'give positions in the mesh frame, in metres, or name their unit'),
    ],
)
def test_the_cause_is_named_with_both_boxes(positions_m, words):
    with pytest.raises(ReadingsError, match=words) as refused:
        placed(positions_m)
    assert 'the readings span' in str(refused.value)
    assert 'and the part x -0.500 to 0.500, y 0.000 to 0.000, z -0.500 to 0.500 m' in str(
        refused.value
    )


def test_a_small_cluster_of_readings_is_none_of_these():
    """Three repeats beside each other on a large part are readings, not a mistake."""
    assert len(placed(PLACES_M[0] + 0.001 * PLACES_M[:3])) == 3


@pytest.mark.parametrize(
    ('factor', 'guessed', 'words'),
    [
        (0.1, True, 'in cm, too: say unit: {position: cm}, or mm'),
        (1 / 25.4, True, 'in cm and in inch, too: say unit: {position: inch}, or mm'),
        (0.1, False, ''),
        (1.0, True, ''),
    ],
)
def test_a_guessed_unit_is_doubted_where_another_fits(factor, guessed, words):
    readings = Readings.of(factor * PLACES_M, np.full(4, 20.0), unit_is_guessed=guessed)
    doubt = unit_in_doubt(panel(), readings)
    assert words in doubt
    assert bool(doubt) == bool(words)


def test_how_far_points_were_moved_is_measured_along_the_normal():
    off = placed(PLACES_M + np.outer([-0.001, 0.002, 0.003, 0.0], [0.0, 1.0, 0.0]))
    assert off.off_surface_m == pytest.approx([0.001, 0.002, 0.003, 0.0], abs=1e-9)
    assert off.understood.endswith('by 1.5 mm (median), 3.0 mm at most')


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


@pytest.mark.parametrize('seed', range(5))
def test_scattered_places_have_no_lines(level, seed):
    scattered = np.random.default_rng(seed).uniform(-0.4, 0.4, (40, 3)) * [1.0, 0.0, 1.0]
    assert not any(columns_or_rows(panel(), level, scattered))


def test_a_few_strays_belong_to_no_line(level):
    places = grid([-0.3, 0.3], np.linspace(-0.4, 0.4, 8))
    labels = columns_or_rows(panel(), level, np.vstack([places, [[0.05, 0.0, 0.33]]]))
    assert labels.tolist() == ['column 1'] * 8 + ['column 2'] * 8 + ['']
