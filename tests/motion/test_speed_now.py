"""The speed of the TCP as poses come."""

import numpy as np
import pytest

from paint_deposition.motion.stream_figures import SpeedNow

STAMPS = 1_760_000_000_000_000_000 + 4_000_000 * np.arange(500)


def along(speeds: np.ndarray) -> np.ndarray:
    """Places on a line that is driven at these speeds between the stamps."""
    way = np.concatenate([[0.0], np.cumsum(0.004 * speeds)])
    return np.stack([0.6 * way, 0.8 * way, np.zeros(len(way))], axis=1)


@pytest.mark.parametrize('batch', [1, 12, 500])
def test_it_is_that_of_the_last_fifth_of_a_second(batch):
    positions = along(np.where(np.arange(499) < 300, 0.5, 0.2))
    speed = SpeedNow()
    assert np.isnan(speed.m_per_s)
    for start in range(0, 324, batch):
        rows = slice(start, min(start + batch, 324))
        speed.add(STAMPS[rows], positions[rows])
    # 27 steps at the first speed, 23 at the second.
    assert speed.m_per_s == pytest.approx((27 * 0.5 + 23 * 0.2) / 50, rel=1e-9)
    speed.add(STAMPS[324:], positions[324:])
    assert speed.m_per_s == pytest.approx(0.2, rel=1e-9)


def test_another_stream_begins_anew():
    speed = SpeedNow()
    speed.add(STAMPS, along(np.full(499, 0.5)))
    speed.add(STAMPS[:2], along(np.full(1, 0.3)))
    assert speed.m_per_s == pytest.approx(0.3, rel=1e-9)
    speed.add(STAMPS[1:2], np.zeros((1, 3)))
    assert np.isnan(speed.m_per_s)
