"""One integrator for streams and recordings: the same sub-steps however the poses came."""

from dataclasses import fields

import numpy as np
import pytest

import scenes
from paint_deposition.errors import RecordingError
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import PathBuilder, spray_path
from paint_deposition.motion.trajectory import Trajectory

TIMES_S = np.arange(0.0, 4.0, 0.02)
TRIGGER = {
    'trigger_stamps_ns': scenes.stamps_ns([0.0, 0.5037, 1.9, 2.4, 3.3]),
    'trigger_flow': np.array([0.0, 1.0, 0.0, 0.7, 0.0]),
}


def add_rows(builder, trajectory, rows):
    columns = trajectory.stamps_ns, trajectory.positions_m, trajectory.quaternions_xyzw
    builder.add_poses(*(column[rows] for column in columns))


def streamed(trajectory, sizes, whole_strokes=False, lag_ns=100_000_000):
    """The path of poses that come in batches of these sizes, in turns, with their triggers."""
    builder = PathBuilder(whole_strokes=whole_strokes)
    triggers = list(zip(trajectory.trigger_stamps_ns, trajectory.trigger_flow, strict=True))
    pieces = []
    start, turn = 0, 0
    while start < len(trajectory):
        rows = slice(start, start + sizes[turn % len(sizes)])
        start, turn = rows.stop, turn + 1
        add_rows(builder, trajectory, rows)
        newest = trajectory.stamps_ns[rows][-1]
        while triggers and triggers[0][0] <= newest:
            builder.add_trigger(*triggers.pop(0))
        pieces.append(builder.take(newest - lag_ns))
    pieces.append(builder.take(finish=True))
    return SprayPath.joined(pieces), builder.counts


def to_and_fro(times_s=TIMES_S):
    """Two passes there and back with the gun off at the turn."""
    t = times_s[:, np.newaxis]
    x = np.where(t < 2.0, 0.3 * t, 1.2 - 0.3 * t)
    positions = np.hstack([x, 0.01 * np.sin(3.0 * t), 0.25 + 0.0 * t])
    return Trajectory(
        scenes.stamps_ns(times_s), positions, np.tile(scenes.LOOKING_DOWN, (len(t), 1)), **TRIGGER
    )


@pytest.mark.parametrize('sizes', [[1], [7], [60, 2, 33], [1, 1, 50]])
@pytest.mark.parametrize('whole_strokes', [False, True])
def test_batches_do_not_matter_to_the_last_bit(sizes, whole_strokes):
    trajectory = to_and_fro(TIMES_S[(TIMES_S < 1.0) | (TIMES_S > 1.4)])
    expected, counts = spray_path(trajectory, whole_strokes=whole_strokes)
    path, streamed_counts = streamed(trajectory, sizes, whole_strokes)
    for column in fields(SprayPath):
        assert np.array_equal(getattr(path, column.name), getattr(expected, column.name))
    assert streamed_counts == counts


def test_the_trigger_cuts_within_a_segment():
    path, _ = spray_path(to_and_fro())
    on_s = (1.9 - 0.5037) + 0.7 * (3.3 - 2.4)
    assert path.spraying_time_s == pytest.approx(on_s, rel=1e-12)
    sprayed = path.stamp_ns[path.flow > 0.0]
    assert sprayed[0] >= scenes.stamps_ns(0.5037)
    assert set(path.flow) == {0.0, 0.7, 1.0}


def test_a_gap_is_gun_off():
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
    names = ('stamps_ns', 'positions_m', 'quaternions_xyzw')
    twice = Trajectory(*(np.concatenate(2 * [getattr(once, n)]) for n in names), **TRIGGER)
    single, _ = spray_path(once)
    path, counts = spray_path(twice, whole_strokes=whole_strokes)
    assert (counts.restarts, counts.rejected, counts.gaps) == (1, 0, 0)
    for name in ('stamp_ns', 'dwell_s', 'flow', 'position_m'):
        column = getattr(single, name)
        assert np.array_equal(getattr(path, name), np.concatenate([column, column]))


def test_a_live_stream_that_begins_again_follows_its_new_triggers():
    once = to_and_fro()
    builder = PathBuilder()
    pieces = []
    for _ in range(2):
        for stamp, flow in zip(TRIGGER['trigger_stamps_ns'], TRIGGER['trigger_flow'], strict=True):
            builder.add_trigger(stamp, flow)
        for row in range(0, len(once), 10):
            add_rows(builder, once, slice(row, row + 10))
            if row:  # the first poses of a stream that begins again are only waiting yet
                pieces.append(builder.take())
    pieces.append(builder.take(finish=True))
    sprayed = SprayPath.joined(pieces).spraying_time_s
    assert sprayed == pytest.approx(2.0 * spray_path(once)[0].spraying_time_s, rel=1e-12)
    assert builder.counts.restarts == 1


def test_a_late_trigger_is_counted_and_holds_from_there_on():
    trajectory = scenes.straight_pass(TIMES_S)
    builder = PathBuilder()
    builder.add_trigger(scenes.stamps_ns(0.0), 1.0)
    add_rows(builder, trajectory, slice(0, 101))
    assert builder.take().spraying_time_s == pytest.approx(2.0)
    builder.add_trigger(scenes.stamps_ns(1.9), 0.0)
    add_rows(builder, trajectory, slice(101, None))
    assert builder.take(finish=True).spraying_time_s == 0.0
    assert builder.counts.late_triggers == 1


@pytest.mark.parametrize('count', [0, 1])
def test_too_few_poses_paint_nothing(count):
    path, counts = spray_path(
        Trajectory(np.arange(count), np.zeros((count, 3)), np.eye(4)[:count])
    )
    assert (len(path), path.rotation.shape, counts.received) == (0, (0, 3, 3), count)


@pytest.mark.parametrize('gap_s', [np.nan, np.inf, 0.0])
def test_a_gap_that_is_no_time_is_refused(gap_s):
    with pytest.raises(RecordingError, match='give seconds above 0'):
        PathBuilder(max_pose_gap_s=gap_s)
