"""Figures of a stream of poses: poses that never came, impossible steps, the speed now."""

import numpy as np
import pytest

from paint_deposition.motion.stream_quality import Intervals, Jumps, SpeedNow

PERIOD_NS = 4_000_000
STAMPS_NS = 1_760_000_000_000_000_000 + PERIOD_NS * np.arange(500)


def along(speeds: np.ndarray) -> np.ndarray:
    """Places on a line that is driven at these speeds between the stamps."""
    way = np.concatenate([[0.0], np.cumsum(0.004 * speeds)])
    return np.stack([0.6 * way, 0.8 * way, np.zeros(len(way))], axis=1)


PASS_M = along(np.ones(499))


def intervals_of(stamps, batch=50) -> Intervals:
    intervals = Intervals()
    for start in range(0, len(stamps), batch):
        intervals.add(np.asarray(stamps[start : start + batch], dtype=np.int64))
    return intervals


def test_steps_back_and_repeats_are_no_intervals_and_another_rhythm_is_learnt():
    found = intervals_of([0, 10, 20, 20, 5, 15, 25])
    assert (found.long, found.longest_ns) == (0, 10)
    found = intervals_of(np.concatenate([np.arange(0, 1000, 10), np.arange(1000, 30_000, 20)]))
    assert found.typical_ns == 20
    assert 1 <= found.long <= 250


def test_what_robots_do_is_no_jump():
    jumps = Jumps()
    jumps.add(STAMPS_NS, PASS_M)
    # Stamps that tremble, a gap with a long way in it, a stream that begins again elsewhere.
    jumps.add(STAMPS_NS[-1:] + 100_000, PASS_M[-1:] + 0.004)
    jumps.add(STAMPS_NS[-1:] + 2_000_000_000, PASS_M[-1:] + 2.0)
    jumps.add(STAMPS_NS[:1], PASS_M[:1])
    assert (jumps.count, jumps.fastest_m_per_s) == (0, 0.0)


@pytest.mark.parametrize('batch', [1, 12, 500])
def test_the_speed_is_that_of_the_last_fifth_of_a_second(batch):
    positions = along(np.where(np.arange(499) < 300, 0.5, 0.2))
    speed = SpeedNow()
    assert np.isnan(speed.m_per_s)
    for start in range(0, 324, batch):
        rows = slice(start, min(start + batch, 324))
        speed.add(STAMPS_NS[rows], positions[rows])
    # 27 steps at the first speed, 23 at the second.
    assert speed.m_per_s == pytest.approx((27 * 0.5 + 23 * 0.2) / 50, rel=1e-9)
    # Another stream begins anew.
    speed.add(STAMPS_NS[:2], along(np.full(1, 0.3)))
    assert speed.m_per_s == pytest.approx(0.3, rel=1e-9)
