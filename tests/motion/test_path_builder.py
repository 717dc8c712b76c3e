"""One integrator for streams and recordings, and the sub-steps into which it cuts segments."""

from dataclasses import fields
from itertools import accumulate
from operator import mul

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

import scenes
from paint_deposition.errors import RecordingError
from paint_deposition.motion import path
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import PathBuilder, spray_path
from paint_deposition.motion.trajectory import Trajectory

TIMES_S = np.arange(0.0, 4.0, 0.02)
CHANGES_NS = scenes.stamps_ns([0.0, 0.5037, 1.9, 2.4, 3.3])
TRIGGER = {'trigger_stamps_ns': CHANGES_NS, 'trigger_flow': np.array([0.0, 1.0, 0.0, 0.7, 0.0])}


def to_and_fro(times_s=TIMES_S):
    """Two passes there and back with the gun off at the turn."""
    t = times_s[:, np.newaxis]
    x = np.where(t < 2.0, 0.3 * t, 1.2 - 0.3 * t)
    positions = np.hstack([x, 0.01 * np.sin(3.0 * t), 0.25 + 0.0 * t])
    quaternions = np.tile(scenes.LOOKING_DOWN, (len(t), 1))
    return Trajectory(scenes.stamps_ns(times_s), positions, quaternions, **TRIGGER)


@pytest.mark.parametrize('sizes', [[1], [7], [60, 2, 33], [1, 1, 50]])
@pytest.mark.parametrize('whole_strokes', [False, True])
def test_batches_do_not_matter_to_the_last_bit(sizes, whole_strokes):
    trajectory = to_and_fro(TIMES_S[(TIMES_S < 1.0) | (TIMES_S > 1.4)])
    expected, counts = spray_path(trajectory, whole_strokes=whole_strokes)
    pieces, streamed_counts = scenes.streamed(trajectory, sizes, whole_strokes)
    path = SprayPath.joined(pieces)
    for column in fields(SprayPath):
        assert np.array_equal(getattr(path, column.name), getattr(expected, column.name))
    assert streamed_counts == counts


def test_the_trigger_cuts_within_a_segment_and_a_gap_is_gun_off():
    path, _ = spray_path(to_and_fro())
    on_s = (1.9 - 0.5037) + 0.7 * (3.3 - 2.4)
    assert path.spraying_time_s == pytest.approx(on_s, rel=1e-12)
    sprayed = path.stamp_ns[path.flow > 0.0]
    assert sprayed[0] >= scenes.stamps_ns(0.5037)
    assert set(path.flow) == {0.0, 0.7, 1.0}
    times = np.concatenate([np.arange(0.0, 1.0, 0.02), np.arange(1.3, 2.0, 0.02)])
    path, counts = spray_path(scenes.straight_pass(times))
    assert counts.gaps == 1
    assert counts.longest_gap_ns == pytest.approx(0.32e9, rel=1e-9)
    assert path.spraying_time_s == pytest.approx(0.98 + 0.68, rel=1e-12)
    within = path.stamp_ns - scenes.stamps_ns(0.0)
    assert not np.any((within > 0.98e9) & (within < 1.3e9))


@pytest.mark.parametrize('whole_strokes', [False, True])
def test_a_stream_that_begins_again_is_painted_again(whole_strokes):
    once = to_and_fro()
    twice = scenes.rows_of(once, np.tile(np.arange(len(once)), 2))
    single, _ = spray_path(once)
    path, counts = spray_path(twice, whole_strokes=whole_strokes)
    assert (counts.restarts, counts.rejected, counts.gaps) == (1, 0, 0)
    for name in ('stamp_ns', 'dwell_s', 'flow', 'position_m'):
        column = getattr(single, name)
        assert np.array_equal(getattr(path, name), np.concatenate([column, column]))


@given(
    flows=st.dictionaries(st.integers(0, 199), st.sampled_from([0.0, 0.5, 1.0]), min_size=1),
    order=st.randoms(use_true_random=False),
    sizes=st.lists(st.integers(1, 90), min_size=1),
)
def test_neither_order_nor_what_is_forgotten_of_the_changes_matters(flows, order, sizes):
    """Flows from rows of the motion on, told in any order before poses in any batches."""
    motion, shuffled = scenes.straight_pass(TIMES_S), list(flows.items())
    order.shuffle(shuffled)
    builder = PathBuilder()
    for row, flow in shuffled:
        builder.add_trigger(motion.stamps_ns[row], flow)
    pieces = []
    for end, size in zip(np.cumsum([*sizes, 200]), [*sizes, 200], strict=True):
        builder.add_poses(scenes.poses(motion, slice(end - size, end)))
        pieces.append(builder.take())
    path = SprayPath.joined([*pieces, builder.take(finish=True)])
    begun = np.searchsorted(sorted(flows), np.searchsorted(motion.stamps_ns, path.stamp_ns) - 1,
                            side='right')  # fmt: skip
    expected = np.append(0.0, [flows[row] for row in sorted(flows)])[begun]
    assert np.array_equal(path.flow, expected)


@pytest.mark.parametrize('count', [0, 1])
def test_too_few_poses_paint_nothing(count):
    few = Trajectory(np.arange(count), np.zeros((count, 3)), np.eye(4)[:count])
    path, counts = spray_path(few)
    assert (len(path), path.rotation.shape, counts.received) == (0, (0, 3, 3), count)


def test_a_gap_that_is_no_time_is_refused():
    for gap_s in (np.nan, np.inf, 0.0):
        with pytest.raises(RecordingError, match='give seconds above 0'):
            PathBuilder(max_pose_gap_s=gap_s)


GAP_NS = 250_000_000
STEP_M = 0.008


def split(stamps_ns, positions, quaternions, cuts_ns=(), max_step_m=STEP_M):
    stamps_ns, cuts_ns = np.asarray(stamps_ns, np.int64), np.asarray(cuts_ns, np.int64)
    positions, quaternions = np.asarray(positions, float), np.asarray(quaternions, float)
    return path.split_segments(stamps_ns, positions, quaternions, cuts_ns, GAP_NS, max_step_m)


def random_motion(seed, count=12):
    rng = np.random.default_rng(seed)
    stamps = np.cumsum(rng.integers(1_300_000, 24_000_000, count))
    positions = np.cumsum(rng.normal(0.0, 0.01, (count, 3)), axis=0)
    steps = Rotation.from_rotvec(rng.normal(0.0, 0.05, (count, 3)))
    turned = [*accumulate(steps, mul, initial=Rotation.random(rng=seed))][1:]
    quaternions = np.array([turn.as_quat() * rng.choice([-1.0, 1.0]) for turn in turned])
    return stamps, positions, quaternions


@pytest.mark.parametrize('angle_rad', [0.0, 1e-9, 1e-6, 1e-3, 0.7, 3.0, np.pi])
@pytest.mark.parametrize('t', [0.0, 0.25, 1.0])
def test_slerp_turns_evenly_the_short_way(angle_rad, t):
    axis = np.array([0.36, -0.48, 0.8])
    start = Rotation.from_euler('xyz', [0.3, -1.1, 2.0])
    end = Rotation.from_rotvec(angle_rad * axis) * start
    expected = Rotation.from_rotvec(t * angle_rad * axis) * start
    for sign in (1.0, -1.0):
        got = Rotation.from_quat(path.slerp(start.as_quat(), sign * end.as_quat(), t))
        if angle_rad != np.pi:  # both ways round are as short
            assert (got.inv() * expected).magnitude() < 1e-9
        assert (got.inv() * start).magnitude() == pytest.approx(t * angle_rad, abs=1e-7)


@given(seed=st.integers(0, 2**32 - 1), cuts=st.lists(st.floats(-0.2, 1.2), max_size=5))
def test_time_and_way_are_kept(seed, cuts):
    stamps, positions, quaternions = random_motion(seed)
    span = stamps[-1] - stamps[0]
    cuts_ns = np.unique(stamps[0] + np.round(np.array(cuts) * span).astype(np.int64))
    found = split(stamps, positions, quaternions, cuts_ns)
    stamp, dwell, position, rotation, velocity, after_gap = found
    assert dwell.sum() == pytest.approx(span * 1e-9, rel=1e-12)
    assert np.all(dwell > 0.0)
    assert np.all(np.diff(stamp) > 0)
    assert not after_gap.any()
    # Stamps are middles: weighted by the dwell their mean is the middle of the whole.
    off_middle_ns = (stamp - stamps[0]) @ dwell / dwell.sum() - 0.5 * span
    assert abs(off_middle_ns) < 1.0
    # Velocity times dwell, put end to end, is the way from the first pose to the last.
    way = (velocity * dwell[:, np.newaxis]).sum(axis=0)
    assert np.allclose(way, positions[-1] - positions[0], rtol=0, atol=1e-12)
    # Sub-steps are stamped to the nanosecond: on the straight line, evenly turned.
    at = stamp * 1e-9
    for axis in range(3):
        expected = np.interp(at, stamps * 1e-9, positions[:, axis])
        assert np.allclose(position[:, axis], expected, rtol=0, atol=1e-7)
    expected = Slerp(stamps * 1e-9, Rotation.from_quat(quaternions))(at)
    off = expected.inv() * Rotation.from_matrix(rotation)
    assert off.magnitude().max() < 1e-6


@given(seed=st.integers(0, 2**32 - 1), max_step_m=st.floats(0.001, 0.02))
def test_no_sub_step_goes_further_than_allowed(seed, max_step_m):
    _, dwell, _, rotation, velocity, _ = split(*random_motion(seed), max_step_m=max_step_m)
    travel = dwell * np.linalg.norm(velocity, axis=1)
    assert travel.max() <= max_step_m * (1 + 1e-9)
    turned = Rotation.from_matrix(rotation[:-1]).inv() * Rotation.from_matrix(rotation[1:])
    # Middles of neighbours may be one sub-step apart in all.
    assert (turned.magnitude() * path.LEVER_M).max() <= max_step_m * (1 + 1e-6)


@pytest.mark.parametrize('away_m', [1e3, 1e30, 1e300])
def test_a_pose_beyond_all_measure_costs_no_memory(away_m):
    positions = np.array([[0, 0, 0], [away_m, 0, 0], [0.001, 0, 0]])
    stamp, dwell, *_ = split([0, 10, 20], positions, np.tile([0, 0, 0, 1.0], (3, 1)))
    assert len(stamp) == 2 * path.MOST_SUB_STEPS
    assert dwell.sum() == pytest.approx(20e-9)


def followed(times_s, x_m, y_m=0.0):
    """Rows followed of poses in a plane, all looking the same way."""
    stamps = np.round(1e9 * np.asarray(times_s)).astype(np.int64)
    x_m, y_m = np.broadcast_arrays(x_m, y_m, times_s)[:2]
    positions = np.column_stack([x_m, y_m, 0.0 * x_m])
    quaternions = np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1))
    return path.thin_poses(stamps, positions, quaternions, GAP_NS, STEP_M)


@pytest.mark.parametrize('rate_hz', [20, 125, 1000])
def test_poses_are_passed_over_until_half_a_sub_step_is_travelled(rate_hz):
    times = np.arange(0.0, 2.0, 1.0 / rate_hz)
    travel = np.diff(0.3 * times[followed(times, 0.3 * times)])
    assert np.all(travel >= 0.5 * STEP_M - 1e-12)
    assert np.all(travel < 0.5 * STEP_M + 0.3 / rate_hz + 1e-12)


def test_a_gun_that_stands_still_is_followed_twenty_times_a_second_and_no_gap_arises():
    times = np.arange(0.0, 2.0, 0.004)
    assert np.allclose(np.diff(times[followed(times, 0.7)]), 0.052)
    # Each comes within the longest interval; two together would not.
    times = np.array([0.0, 0.04, 0.28, 0.32, 0.5])
    assert np.all(np.diff(times[followed(times, 0.0)]) < 1e-9 * GAP_NS)


@pytest.mark.parametrize('angle_deg', [60.0, 90.0, 180.0])
def test_the_pose_at_a_corner_is_followed(angle_deg):
    legs = 0.0015 * np.arange(1, 40)
    angle = np.radians(angle_deg)
    x = np.concatenate([legs, legs[-1] + np.cos(angle) * legs])
    y = np.concatenate([0.0 * legs, np.sin(angle) * legs])
    corner = len(legs) - 1
    assert corner in followed(0.001 * np.arange(len(x)), x, y)
