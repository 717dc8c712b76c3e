"""The integral: the film does not depend on how the path was sampled, cut or placed."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import paint_deposition as pd
import scenes
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints
from scenes import lying_plane, stamps_ns, straight_pass, weaving

MODEL = pd.DepositionModel()


def painted(points, motion, model=MODEL, precision='double'):
    return scenes.painted(points, motion, model, precision)


def largest_error(film, expected):
    return np.abs(film - expected).max() / expected.max()


# The weaving way at 0.3 m/s with a tool that sways, as a robot's log may show it.
DURATION_S = 4.0


def sampled_evenly(period_s):
    return weaving(np.linspace(0.0, DURATION_S, round(DURATION_S / period_s) + 1))


def sampled_unevenly():
    """Intervals from 1 to 24 ms; now and then the last pose comes again under a new stamp."""
    rng = np.random.default_rng(11)
    times = np.cumsum(rng.uniform(0.001, 0.024, 1000))
    times = np.concatenate([[0.0], times[times < DURATION_S], [DURATION_S]])
    log = weaving(times)
    early = np.append(np.diff(times, prepend=-1.0)[1:-1] < 0.004, False)
    again = 1 + np.flatnonzero(early & (rng.random(len(times) - 1) < 0.3))
    positions, quaternions = log.positions_m.copy(), log.quaternions_xyzw.copy()
    positions[again], quaternions[again] = positions[again - 1], quaternions[again - 1]
    assert len(again) > 5
    return pd.Trajectory(log.stamps_ns, positions, quaternions)


@pytest.fixture(scope='module')
def exact():
    """The film of the weaving way, integrated 80 times finer, and where."""
    points = lying_plane(0.6, 25)
    path, _ = spray_path(sampled_evenly(0.0005), max_step_m=0.0001)
    return points, painted(points, path).film_um


@pytest.mark.parametrize(
    ('trajectory', 'limit'),
    [(sampled_evenly(0.02), 1e-3), (sampled_evenly(0.001), 1e-4), (sampled_unevenly(), 1e-3)],
    ids=['50 Hz', '1 kHz', '1 to 24 ms with repeats'],
)
@pytest.mark.parametrize('precision', ['single', 'double'])
def test_the_film_does_not_depend_on_the_sampling(trajectory, limit, precision, exact):
    points, expected = exact
    path, _ = spray_path(trajectory, max_step_m=MODEL.max_step_m)
    assert largest_error(painted(points, path, precision=precision).film_um, expected) < limit


@pytest.mark.parametrize(
    'planar',
    [
        PlanarPattern(),
        PlanarPattern(r_m=0.05, sigma1_m=0.02, sigma2_m=0.03),
        PlanarPattern(r_m=0.1, sigma1_m=0.04, sigma2_m=0.2, K3=1.0, K2=0.0),
    ],
)
@pytest.mark.parametrize('standoff_m', [0.25, 0.4])
def test_sub_steps_are_fine_enough(planar, standoff_m):
    """One segment of a whole pass with the gun opening and closing on it, cut by itself."""
    model = pd.DepositionModel(planar=planar)
    trigger = {
        'trigger_stamps_ns': stamps_ns([0.0, 0.6101, 1.4]),
        'trigger_flow': np.array([0.0, 1.0, 0.0]),
    }
    pass_ = straight_pass([0.0, 2.0], (-0.3, 0, standoff_m), (0.3, 0, standoff_m), **trigger)
    coarse, fine = (
        spray_path(pass_, 5.0, step)[0] for step in (model.max_step_m, model.max_step_m / 40)
    )
    # The middle row lies on the line that the axis draws, where eq. (1) jumps at the centre.
    points = lying_plane(0.4, 31)
    expected = painted(points, fine, model).film_um
    assert largest_error(painted(points, coarse, model).film_um, expected) < 1e-3


def test_the_film_is_in_proportion_to_flow_k1_and_time():
    points, path = lying_plane(count=21), spray_path(straight_pass(np.arange(0.0, 2.0, 0.02)))[0]
    plain = painted(points, path).film_um
    less = painted(points, path.with_(flow=0.37 * path.flow)).film_um
    assert largest_error(less, 0.37 * plain) < 1e-12
    more = pd.DepositionModel(planar=PlanarPattern(K1_cm3_per_s=3 * MODEL.planar.K1_cm3_per_s))
    assert largest_error(painted(points, path, more).film_um, 3.0 * plain) < 1e-12
    slow = painted(points, straight_pass(np.linspace(0.0, 4.0, 401))).film_um
    fast = painted(points, straight_pass(np.linspace(0.0, 2.0, 401))).film_um
    assert largest_error(slow, 2.0 * fast) < 1e-12


def test_moving_part_and_gun_together_changes_nothing():
    points = lying_plane(count=25)
    log = weaving(np.arange(0.0, 2.0, 0.02))
    turn, shift = Rotation.from_euler('xyz', [0.5, -1.2, 2.8]), np.array([4.0, -3.0, 1.5])
    moved = SurfacePoints(turn.apply(points.positions_m) + shift, turn.apply(points.normals))
    moved_log = pd.Trajectory(
        log.stamps_ns,
        turn.apply(log.positions_m) + shift,
        (turn * Rotation.from_quat(log.quaternions_xyzw)).as_quat(),
    )
    still = painted(points, log).film_um
    assert largest_error(painted(moved, moved_log).film_um, still) < 1e-9
    single = painted(moved, moved_log, precision='single').film_um
    assert largest_error(single, still) < 2e-6
