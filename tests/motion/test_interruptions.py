"""Recordings of a spraying gun that break off or begin again: where, and what hangs on it."""

from dataclasses import replace

import numpy as np
import pytest

import scenes
from paint_deposition.errors import RecordingError
from paint_deposition.motion.interruptions import checked_path, interruptions
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import Trajectory

TIMES_S = np.arange(0.0, 10.0, 0.02)
WHOLE = scenes.straight_pass(TIMES_S)


def lines_of(trajectory: Trajectory, max_pose_gap_s: float = 0.25) -> list[str]:
    return list(interruptions(spray_path(trajectory, max_pose_gap_s)[0], max_pose_gap_s))


def rows(*chosen: np.ndarray, **trigger) -> Trajectory:
    row = np.concatenate([np.flatnonzero(each) for each in chosen])
    columns = ('stamps_ns', 'positions_m', 'quaternions_xyzw')
    return Trajectory(*(getattr(WHOLE, name)[row] for name in columns), **trigger)


def test_a_gap_while_the_gun_sprays_is_named_with_its_place_and_paint():
    seen = (TIMES_S < 4.01) | (TIMES_S > 6.39)
    (line,) = lines_of(rows(seen))
    assert line.startswith('a gap in the poses while the gun sprayed, 2.40 s in all')
    assert '2.40 s from (-0.12, 0.00, 0.25) m to (0.17, 0.00, 0.25) m: taken as gun off' in line
    assert '31.7 % more paint was sprayed than is computed' in line
    assert lines_of(rows(seen), max_pose_gap_s=2.5) == []
    closed = {
        'trigger_stamps_ns': scenes.stamps_ns([0.0, 3.9]),
        'trigger_flow': np.array([1.0, 0]),
    }
    assert lines_of(rows(seen, **closed)) == []
    assert lines_of(WHOLE) == []


def test_a_log_that_is_in_the_file_twice_is_told_from_another_run():
    whole = TIMES_S >= 0.0
    (line,) = lines_of(rows(whole, whole))
    assert 'start again at (-0.60, 0.00, 0.25) m: a second coat, 50.0 % of the paint' in line
    assert 'the same poses come again, as if the log were in the file twice' in line
    (line,) = lines_of(rows(whole, TIMES_S < 5.0, TIMES_S < 0.0))
    assert '33.3 % of the paint' in line
    (line,) = lines_of(rows(TIMES_S > 5.0, TIMES_S < 5.0))
    assert 'another run follows in the file' in line


def test_milliseconds_that_are_taken_for_seconds_are_suggested():
    slow = replace(WHOLE, stamps_ns=1000 * (WHOLE.stamps_ns - WHOLE.stamps_ns[0]))
    with pytest.raises(RecordingError, match=r'they are 20 s apart: if these are milliseconds'):
        checked_path(slow, 0.25)
