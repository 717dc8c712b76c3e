"""A part painted by a given programme is painted as by the shop's own."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from .bench import Bench
from .draw import draw_jobs
from .gauge import scatter
from .programme import Painted, motion_of

pytestmark = pytest.mark.slow

PARCELS = 300_000


def test_the_same_motion_lays_the_same_film():
    """The shop's own motion as one would get it from a bag."""
    pattern, (job,) = draw_jobs(5, [], ('door',), 0.05, 'outside')
    spots, motion = scatter(job.part, 40, np.random.default_rng(1), 0.02), job.motion
    given = motion_of(
        motion.time_s, motion.tcp_m, Rotation.from_matrix(motion.turn).as_quat(),
        motion.trigger_s, motion.trigger_on,
    )  # fmt: skip
    expected = Bench(9, job, pattern, PARCELS).readings([], *spots)[0]
    painted = Painted('door', job.part, pattern, [], given, 9, PARCELS)
    np.testing.assert_allclose(painted.film_um(*spots), expected, rtol=1e-9)
