"""A recording says what it lacks."""

import numpy as np
import pytest

from paint_deposition.errors import RecordingError
from paint_deposition.motion.trajectory import Trajectory, relative_flow


def test_shapes_must_match():
    stamps = np.arange(3, dtype=np.int64)
    with pytest.raises(RecordingError, match=r'3 stamps .*positions \(2, 3\)'):
        Trajectory(stamps, np.zeros((2, 3)), np.zeros((3, 4)))
    with pytest.raises(RecordingError, match='2 trigger stamps go with 1 flow'):
        Trajectory(stamps, np.zeros((3, 3)), np.zeros((3, 4)), '', np.arange(2), np.array([1.0]))


def test_relative_flow():
    assert relative_flow(False, 0.9) == 0.0
    assert relative_flow(True) == 1.0
    assert relative_flow(True, 0.9) == 0.9
    for wrong in (-0.1, float('inf')):
        with pytest.raises(RecordingError, match='flow is'):
            relative_flow(True, wrong)
