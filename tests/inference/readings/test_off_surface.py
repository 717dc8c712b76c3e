"""Readings that do not lie on the part: the likely cause, and both bounding boxes."""

import numpy as np
import pytest

from booth import panel
from paint_deposition.errors import ReadingsError
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.inference.readings.placement import unit_in_doubt
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
