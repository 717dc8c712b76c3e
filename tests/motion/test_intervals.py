"""The rhythm of stamps, and what it says of poses that never came."""

import numpy as np
import pytest

from paint_deposition.motion.stream_figures import Intervals

PERIOD_NS = 4_000_000


def _after(stamps, batch=50) -> Intervals:
    intervals = Intervals()
    for start in range(0, len(stamps), batch):
        intervals.add(np.asarray(stamps[start : start + batch], dtype=np.int64))
    return intervals


def test_an_even_stream_has_no_long_interval():
    found = _after(PERIOD_NS * np.arange(1000))
    assert (found.long, found.longest_ns, found.typical_ns) == (0, PERIOD_NS, PERIOD_NS)


@pytest.mark.parametrize('batch', [1, 7, 1000])
@pytest.mark.parametrize('lost', [[1], [500], [10, 20, 30], [999]])
def test_each_lost_pose_of_an_even_stream_is_noticed(lost, batch):
    stamps = np.delete(PERIOD_NS * np.arange(1001), lost)
    found = _after(stamps, batch)
    # Without an interval before it, the first cannot be told from the rhythm.
    assert found.long == len([row for row in lost if row > 1])
    assert found.longest_ns == 2 * PERIOD_NS


def test_steps_back_and_repeats_are_no_intervals():
    found = _after([0, 10, 20, 20, 5, 15, 25])
    assert (found.long, found.longest_ns) == (0, 10)


def test_another_rhythm_is_learnt():
    stamps = np.concatenate([np.arange(0, 1000, 10), np.arange(1000, 30_000, 20)])
    found = _after(stamps)
    assert found.typical_ns == 20
    assert 1 <= found.long <= 250
