"""Rows and columns among readings; those off the part are refused with the likely cause."""

import numpy as np
import pytest

import paint_deposition as pd
from booth import panel, path_of, serpentine
from paint_deposition.errors import ReadingsError
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.inference.readings.placement import columns_or_rows, unit_in_doubt
from paint_deposition.motion.path import SprayPath

# On the booth's panel, one metre by one about the origin in x-z.
PLACES_M = np.array([[-0.4, 0.0, -0.3], [0.1, 0.0, 0.2], [0.3, 0.0, 0.45], [-0.2, 0.0, 0.1]])


def placed(positions_m: np.ndarray) -> Experiment:
    readings = pd.Readings.of(positions_m, np.full(len(positions_m), 20.0))
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
    readings = pd.Readings.of(factor * PLACES_M, np.full(4, 20.0), unit_is_guessed=guessed)
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


X, Z = np.linspace(-0.4, 0.4, 9), np.linspace(-0.4, 0.4, 8)


@pytest.mark.parametrize(
    ('places', 'lines'),
    [
        *((grid([-0.3, 0.0, 0.2], Z[:5], stray_m), [(f'column {k}', 5) for k in (1, 2, 3)])
          for stray_m in (0.0, 0.01)),
        # Rows serve where there are no columns.
        (np.concatenate([grid(X, [0.2]), grid(X + 0.043, [-0.1])]), [('row 1', 9), ('row 2', 9)]),
        (grid([0.1], np.linspace(-0.4, 0.4, 12), 0.004), [('column 1', 12)]),
        # A stray belongs to no line.
        (np.vstack([grid([-0.3, 0.3], Z), [[0.05, 0.0, 0.33]]]),
         [('column 1', 8), ('column 2', 8), ('', 1)]),
        *((np.random.default_rng(seed).uniform(-0.4, 0.4, (40, 3)) * [1.0, 0.0, 1.0], [('', 40)])
          for seed in range(5)),
    ],
    ids=['grid', 'by hand', 'rows', 'one line', 'stray', *5 * ['scattered']],
)  # fmt: skip
def test_a_grid_is_read_across_the_passes(places, lines):
    labels = columns_or_rows(panel(), path_of(serpentine()), places)
    assert labels.tolist() == [label for label, count in lines for _ in range(count)]
