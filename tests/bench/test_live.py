"""The age of a pose: from when it is sent to statistics that know it."""

import numpy as np
from benchmarks.live import ages_s

MS = 1_000_000


def test_a_pose_is_as_old_as_the_first_statistics_that_know_it():
    stamps = MS * np.array([0, 100, 200, 300])
    # Stamp of the newest pose in the statistics, and when they arrived.
    arrived = [(50 * MS, 60 * MS), (200 * MS, 230 * MS), (200 * MS, 400 * MS)]
    np.testing.assert_allclose(ages_s(stamps, arrived), [0.06, 0.13, 0.03, np.inf])
