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


def test_passes_go_from_standstill_to_standstill():
    """Two passes of 1 m with the gun open in the middle of each, and a link between them."""
    time = np.linspace(0.0, 5.0, 1001)
    along = np.interp(time, [0.0, 2.0, 2.2, 2.8, 3.0, 5.0], [0.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    across = np.interp(time, [0.0, 2.2, 2.8, 5.0], [0.0, 0.0, 0.3, 0.3])
    tcp = np.stack([along, across, np.zeros_like(time)], axis=1)
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    motion = motion_of(
        time, tcp, turn, np.array([0.5, 1.5, 3.5, 4.5]), np.array([True, False, True, False])
    )
    assert set(motion.pass_number[time < 1.9]) == {0}
    assert set(motion.pass_number[time > 3.1]) == {1}
    assert set(motion.pass_number[(time > 2.3) & (time < 2.7)]) == {-1}
    middle = np.searchsorted(time, 1.0)
    assert motion.reversal_m[middle] == pytest.approx(0.5, abs=0.02)
