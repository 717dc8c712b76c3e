"""Recordings and streams of poses: what they lack, what is dropped, and their figures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paint_deposition.errors import RecordingError
from paint_deposition.motion.pose_stream import (
    NO_POSES,
    MotionLog,
    PoseBatch,
    PoseScreen,
    TriggerChange,
    newest_poses,
)
from paint_deposition.motion.stream_quality import StreamSteps
from paint_deposition.motion.trajectory import Trajectory, relative_flow

GAP_NS = 250
UNIT = (0.0, 0.0, 0.0, 1.0)


def batch(stamps, quaternions=None, positions=None):
    count = len(stamps)
    return PoseBatch(
        np.array(stamps, dtype=np.int64),
        np.zeros((count, 3)) if positions is None else np.array(positions, dtype=float),
        np.tile(UNIT, (count, 1)) if quaternions is None else np.array(quaternions, dtype=float),
    )


def followed(stamps, batches=1):
    """Stamps followed, one list a stream, and the counts."""
    screen = PoseScreen(GAP_NS)
    streams = [[]]
    for rows in np.array_split(np.array(stamps, dtype=np.int64), batches):
        first, *others = screen.take(batch(rows))
        streams[-1] += first.stamps_ns.tolist()
        streams += [stream.stamps_ns.tolist() for stream in others]
    screen.finish()
    return streams, screen.counts


def test_repeated_and_backward_stamps_are_dropped_and_a_few_stragglers_are_no_restart():
    """Poses that came by a slower way must not be painted twice."""
    streams, counts = followed([0, 10, 10, 20, 15, 30, 30, 30, 40, 5, 50])
    assert streams == [[0, 10, 20, 30, 40, 50]]
    assert (counts.received, counts.repeated_stamps, counts.backward_stamps) == (11, 3, 2)
    assert (counts.rejected, counts.restarts) == (5, 0)
    streams, counts = followed([0, 20, 40, 60, 10, 30, 50, 80, 100])
    assert streams == [[0, 20, 40, 60, 80, 100]]
    assert (counts.backward_stamps, counts.restarts) == (3, 0)


def test_a_lasting_run_from_an_earlier_time_is_a_restart_of_which_nothing_is_lost():
    again = list(range(0, 500, 20))
    streams, counts = followed([*range(1000, 1100, 20), *again])
    assert streams == [list(range(1000, 1100, 20)), again]
    assert (counts.restarts, counts.rejected) == (1, 0)


def test_what_is_no_pose_is_dropped_and_quaternions_are_brought_to_unit_length():
    good = [UNIT, (0, 0, 0, 1.009), (0, 0, 0, 0.991)]
    quaternions = [*good, (0, 0, 0, 1.02), (0, 0, 0, 0), (0, 0, np.inf, 1), UNIT, UNIT]
    positions = np.zeros((8, 3))
    positions[6, 2], positions[7, 1] = np.nan, -1e30
    screen = PoseScreen(GAP_NS)
    (kept,) = screen.take(batch(np.arange(8), quaternions, positions))
    assert kept.stamps_ns.tolist() == [0, 1, 2]
    assert np.array_equal(np.linalg.norm(kept.quaternions_xyzw, axis=1), np.ones(3))
    assert (screen.counts.not_finite, screen.counts.not_unit_quaternions) == (3, 2)


STEPS = st.sampled_from([20, 20, 20, 20, 0, -20, -50, 300, -5000])


@given(steps=st.lists(STEPS, max_size=80), batches=st.integers(1, 20))
def test_batches_do_not_matter(steps, batches):
    stamps = 10_000 + np.cumsum(np.array([0, *steps]))
    streams, counts = followed(stamps, batches)
    assert (streams, counts) == followed(stamps)
    assert all(np.all(np.diff(stream) > 0) for stream in streams)
    assert len(streams) == counts.restarts + 1
    assert sum(map(len, streams)) + counts.rejected == counts.received == len(stamps)


def _poses(first, count) -> PoseBatch:
    """No two numbers of these poses are equal."""
    stamps = np.arange(first, first + count)
    of_each = stamps[:, None]
    return PoseBatch(stamps, of_each + np.arange(3) / 3, -of_each - np.arange(4) / 5)


def _in_words(events) -> list:
    """Poses by their stamps, wherever their batches end, and the changes between them."""
    told = []
    for event in events:
        told += [event] if isinstance(event, TriggerChange) else event.stamps_ns.tolist()
    return told


@pytest.mark.parametrize('sizes', [(9000,), (13,) * 692 + (4,), (4096, 1, 4095, 808)])
def test_poses_of_any_batches_come_back_to_the_last_bit(sizes):
    log = MotionLog()
    for first, size in zip(np.cumsum([0, *sizes]), sizes, strict=False):
        log.add(_poses(first, size))
    batches = list(log.events())
    assert max(map(len, batches)) <= 256
    for name, column in vars(_poses(0, 9000)).items():
        assert np.array_equal(np.concatenate([vars(batch)[name] for batch in batches]), column)


def test_who_has_followed_a_part_gets_the_rest():
    events = [_poses(0, 5), TriggerChange(5, 1.0), _poses(5, 5000), TriggerChange(9000, 0.0)]
    log, follower = MotionLog(), MotionLog()
    for event in events:
        log.add(event)
    for event in log.events():
        rest = _in_words(log.events(follower.poses, follower.changes))
        assert rest == _in_words(log.events())[follower.poses + follower.changes :]
        follower.add(event)
    assert not list(log.events(follower.poses, follower.changes))
    log.add(_poses(10_000, 3))
    assert _in_words(log.events(follower.poses, follower.changes)) == [10_000, 10_001, 10_002]


PERIOD_NS = 4_000_000
STAMPS_NS = 1_760_000_000_000_000_000 + PERIOD_NS * np.arange(500)


def along(speeds: np.ndarray) -> np.ndarray:
    """Places on a line that is driven at these speeds between the stamps."""
    way = np.concatenate([[0.0], np.cumsum(0.004 * speeds)])
    return np.stack([0.6 * way, 0.8 * way, np.zeros(len(way))], axis=1)


PASS_M = along(np.ones(499))


def intervals_of(stamps, batch=50) -> StreamSteps:
    steps = StreamSteps()
    for start in range(0, len(stamps), batch):
        steps.add_stamps(np.asarray(stamps[start : start + batch], dtype=np.int64))
    return steps


def test_steps_back_and_repeats_are_no_intervals_and_another_rhythm_is_learnt():
    found = intervals_of([0, 10, 20, 20, 5, 15, 25])
    assert (found.long, found.longest_ns) == (0, 10)
    found = intervals_of(np.concatenate([np.arange(0, 1000, 10), np.arange(1000, 30_000, 20)]))
    assert found.typical_ns == 20
    assert 1 <= found.long <= 250


def test_what_robots_do_is_no_jump():
    steps = StreamSteps()
    steps.add_places(STAMPS_NS, PASS_M)
    # Stamps that tremble, a gap with a long way in it, a stream that begins again elsewhere.
    steps.add_places(STAMPS_NS[-1:] + 100_000, PASS_M[-1:] + 0.004)
    steps.add_places(STAMPS_NS[-1:] + 2_000_000_000, PASS_M[-1:] + 2.0)
    steps.add_places(STAMPS_NS[:1], PASS_M[:1])
    assert (steps.jumps, steps.fastest_m_per_s) == (0, 0.0)


@pytest.mark.parametrize('size', [1, 12, 500])
def test_the_speed_is_that_of_the_last_fifth_of_a_second(size):
    positions = along(np.where(np.arange(499) < 300, 0.5, 0.2))
    poses, newest = batch(STAMPS_NS, positions=positions), NO_POSES
    assert np.isnan(newest.speed_m_per_s)
    for start in range(0, 324, size):
        newest = newest_poses(newest, poses.select(slice(start, min(start + size, 324))))
    # 27 steps at the first speed, 23 at the second.
    assert newest.speed_m_per_s == pytest.approx((27 * 0.5 + 23 * 0.2) / 50, rel=1e-9)
    again = batch(STAMPS_NS[:2], positions=along(np.full(1, 0.3)))
    assert newest_poses(newest, again).speed_m_per_s == pytest.approx(0.3, rel=1e-9)


def test_shapes_must_match_and_flows_be_possible():
    stamps = np.arange(3, dtype=np.int64)
    with pytest.raises(RecordingError, match=r'3 stamps .*positions \(2, 3\)'):
        Trajectory(stamps, np.zeros((2, 3)), np.zeros((3, 4)))
    with pytest.raises(RecordingError, match='2 trigger stamps go with 1 flow'):
        Trajectory(stamps, np.zeros((3, 3)), np.zeros((3, 4)), '', np.arange(2), np.array([1.0]))
    assert relative_flow(False, 0.9) == 0.0
    assert relative_flow(True) == 1.0
    assert relative_flow(True, 0.9) == 0.9
    for wrong in (-0.1, float('inf')):
        with pytest.raises(RecordingError, match='flow is'):
            relative_flow(True, wrong)
