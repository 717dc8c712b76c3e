"""Steps that no robot makes."""

import numpy as np
import pytest

from paint_deposition.motion.stream_figures import Jumps

# A gun at 1 m/s and 250 Hz.
STAMPS_NS = 4_000_000 * np.arange(100)
PASS_M = np.stack([0.004 * np.arange(100), np.zeros(100), np.zeros(100)], axis=1)


def test_two_guns_on_one_topic_jump_at_every_pose():
    jumps = Jumps()
    two = PASS_M + np.where(np.arange(100) % 2, 1.0, 0.0)[:, None] * [0.0, 1.0, 0.0]
    for rows in (slice(0, 30), slice(30, 100)):  # also between two batches
        jumps.add(STAMPS_NS[rows], two[rows])
    assert jumps.count == 99
    assert jumps.fastest_m_per_s == pytest.approx(250.0, rel=1e-4)


def test_what_robots_do_is_no_jump():
    jumps = Jumps()
    jumps.add(STAMPS_NS, PASS_M)
    # Stamps that tremble, a gap with a long way in it, a stream that begins again elsewhere.
    jumps.add(STAMPS_NS[-1:] + 100_000, PASS_M[-1:] + 0.004)
    jumps.add(STAMPS_NS[-1:] + 2_000_000_000, PASS_M[-1:] + 2.0)
    jumps.add(STAMPS_NS[:1], PASS_M[:1])
    assert (jumps.count, jumps.fastest_m_per_s) == (0, 0.0)
