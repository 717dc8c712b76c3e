"""Passes, strokes and interruptions of whole motions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import scenes
from paint_deposition.errors import RecordingError
from paint_deposition.motion.path_builder import checked_path, interruptions, spray_path
from paint_deposition.motion.trajectory import Trajectory

SPEED_M_PER_S = 0.5
LENGTH_M = 1.2
PASSES = 4


def resampled(corners_m, spacing_m):
    """(N, 2) points at even steps along a polyline up to its end, and the distance along it."""
    corners_m = np.array(corners_m, dtype=float)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners_m, axis=0), axis=1)))
    at = np.append(np.arange(0.0, along[-1], spacing_m), along[-1])
    return np.stack([np.interp(at, along, corners_m[:, k]) for k in (0, 1)], axis=1), at


def level(at_s, xy, noise_m=0.0, seed=3, **trigger):
    """Poses 0.25 m above places (N, 2) at these times, the gun looking down."""
    positions = np.column_stack([xy, np.full(len(xy), 0.25)])
    positions += np.random.default_rng(seed).normal(0.0, noise_m, positions.shape)
    quaternions = np.tile(scenes.LOOKING_DOWN, (len(xy), 1))
    return Trajectory(scenes.stamps_ns(at_s), positions, quaternions, **trigger)


def turn_points(kind, radius_m):
    """From one pass to the next, up by `rise`: points right of the pass's end, and the rise."""
    arc = np.linspace(0.0, np.pi, 181)[1:-1]
    if kind == 'semicircle':
        return radius_m * np.stack([np.sin(arc), 1.0 - np.cos(arc)], axis=1), 2.0 * radius_m
    if kind == 'corner':
        return np.empty((0, 2)), radius_m
    # A link of 0.3 m whose corners are cut.
    points = radius_m * np.stack([np.sin(arc), 1.0 - np.cos(arc)], axis=1)
    points[len(arc) // 2 :, 1] += 0.3 - 2.0 * radius_m
    return points, 0.3


def raster(kind, radius_m, gun, noise_m, period_s):
    """To and fro in x-y; the gun is off in the turns, always on, or without trigger."""
    points, rise_m = turn_points(kind, radius_m)
    corners = []
    for k in range(PASSES):
        base = np.array([0.0, k * rise_m])
        turn = np.add(points, [LENGTH_M, 0.0]) if k < PASSES - 1 else np.empty((0, 2))
        leg = np.vstack([[[0.0, 0.0], [LENGTH_M, 0.0]], turn])
        corners.append((leg if k % 2 == 0 else leg * [-1, 1] + [LENGTH_M, 0.0]) + base)
    xy, at_m = resampled(np.vstack(corners), SPEED_M_PER_S * period_s)
    stamps = scenes.stamps_ns(at_m / SPEED_M_PER_S)
    trigger = {}
    if gun == 'off in turns':
        on = (xy[:, 0] > 0.0) & (xy[:, 0] < LENGTH_M)
        change = np.flatnonzero(np.diff(np.append(False, on)))
        trigger = {'trigger_stamps_ns': stamps[change], 'trigger_flow': on[change].astype(float)}
    elif gun == 'on':
        trigger = {'trigger_stamps_ns': stamps[:1], 'trigger_flow': np.ones(1)}
    return level(at_m / SPEED_M_PER_S, xy, noise_m, **trigger)


@pytest.mark.parametrize(
    ('gun', 'period_s', 'noise_m'),
    [
        ('off in turns', 0.004, 2e-4), ('on', 0.004, 2e-4), ('no trigger', 0.004, 2e-4),
        ('on', 0.001, 2e-5), ('on', 0.03, 2e-4),
    ],
)  # fmt: skip
@pytest.mark.parametrize(
    ('kind', 'size_m'),
    [
        ('corner', 0.05), ('corner', 0.3), ('semicircle', 0.05), ('semicircle', 0.15),
        ('semicircle', 0.29), ('zone', 0.01), ('zone', 0.05), ('zone', 0.14),
    ],
)  # fmt: skip
def test_every_row_of_a_raster_is_a_pass_at_any_rate(kind, size_m, gun, period_s, noise_m):
    """Four passes; every row has its own number from 0.1 m behind the turn to the next."""
    path, _ = spray_path(raster(kind, size_m, gun, noise_m, period_s))
    assert path.spray_pass.max() == PASSES - 1
    middle = (path.flow > 0.0) & (np.abs(path.position_m[:, 0] - 0.5 * LENGTH_M) < 0.5)
    y = path.position_m[middle, 1]
    rows = np.round((PASSES - 1) * (y - y.min()) / np.ptp(y)).astype(int)
    assert np.array_equal(path.spray_pass[middle], rows)


def arc_pass(radius_m, sweep_rad, followed, noise_m=2e-4):
    """There and back over a crowned part: an arc in x-z, the gun square to it or kept upright."""
    angle = np.arange(-0.5 * sweep_rad, 0.5 * sweep_rad, 0.15 * 0.01 / radius_m)
    angle = np.concatenate([angle, angle[::-1]])
    y = np.repeat([0.0, 0.3], len(angle) // 2)
    positions = radius_m * np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])
    positions[:, 1] = y
    link = np.linspace(positions[len(angle) // 2 - 1], positions[len(angle) // 2], 200)[1:-1]
    half = len(angle) // 2
    positions = np.vstack([positions[:half], link, positions[half:]])
    angle = np.concatenate([angle[:half], np.full(len(link), angle[half]), angle[half:]])
    positions += np.random.default_rng(4).normal(0.0, noise_m, positions.shape)
    tilt = Rotation.from_euler('y', angle if followed else 0.0 * angle)
    quaternions = (tilt * Rotation.from_quat(scenes.LOOKING_DOWN)).as_quat()
    return Trajectory(scenes.stamps_ns(0.01 * np.arange(len(angle))), positions, quaternions)


@pytest.mark.parametrize(
    ('radius_m', 'sweep_rad', 'followed'),
    [(3.0, 0.5, False), (1.2, 0.9, False), (1.2, 0.9, True), (0.25, 2.0, True)],
)
def test_a_pass_along_a_crowned_part_is_one(radius_m, sweep_rad, followed):
    path, _ = spray_path(arc_pass(radius_m, sweep_rad, followed))
    assert path.spray_pass.max() == 1
    for number, y in enumerate((0.0, 0.3)):
        rows = np.abs(path.position_m[:, 1] - y) < 0.002
        beyond = np.flatnonzero(rows)[20:]
        assert set(path.spray_pass[beyond]) == {number}
        assert len(set(path.stroke[beyond])) == 1


def test_a_gun_that_is_tilted_on_a_straight_pass_or_trembles_at_rest_does_not_turn():
    x = np.arange(0.0, 1.2, 0.003)
    straight = level(x / 0.3, np.column_stack([x, 0.0 * x]))
    tilt = Rotation.from_euler('y', 2.0 * (x / 1.2 - 0.5))
    quaternions = (tilt * Rotation.from_quat(straight.quaternions_xyzw)).as_quat()
    path, _ = spray_path(replace(straight, quaternions_xyzw=quaternions))
    assert path.stroke.max() == 0
    assert path.spray_pass.max() == 0
    times = np.arange(0.0, 3.0, 0.01)
    still = level(times, np.zeros((len(times), 2)), noise_m=2e-4, seed=5)
    assert spray_path(still)[0].stroke[-1] == 0


@pytest.mark.parametrize(('shift_m', 'passes'), [(0.0, 1), (0.2, 2)])
def test_a_gun_that_opens_again_on_another_track_begins_a_pass(shift_m, passes):
    """Off at 0.5 m, up by the shift at 45 degrees at most, on again 0.3 m farther."""
    xy, at_m = resampled([(0.0, 0.0), (0.5, 0.0), (0.8, shift_m), (1.5, shift_m)], 0.003)
    changes = scenes.stamps_ns(np.array([0.0, 0.5, 0.5 + np.hypot(0.3, shift_m)]) / 0.3)
    trigger = {'trigger_stamps_ns': changes, 'trigger_flow': np.array([1.0, 0.0, 1.0])}
    path, _ = spray_path(level(at_m / 0.3, xy, **trigger))
    assert path.stroke.max() == 0
    assert path.spray_pass.max() == passes - 1


@pytest.mark.parametrize('angle_deg', [65.0, 90.0, 180.0])
@pytest.mark.parametrize('noise_m', [0.0, 2e-4])
def test_a_turn_is_placed_where_the_path_turns(angle_deg, noise_m):
    angle = np.radians(angle_deg)
    for run_m in (0.5, 0.504, 0.507, 0.511):
        end = (run_m + 0.5 * np.cos(angle), 0.5 * np.sin(angle))
        xy, at_m = resampled([(0.0, 0.0), (run_m, 0.0), end], 0.002)
        path, _ = spray_path(level(at_m / 0.5, xy, noise_m, seed=6))
        assert path.stroke.max() == 1
        nearest_m = np.minimum(path.from_turn_m, path.to_turn_m)
        at_s = (path.stamp_ns - scenes.START_NS) * 1e-9
        near = np.abs(0.5 * at_s - run_m) < 0.05
        wanted_m = np.abs(0.5 * at_s - run_m)[near]
        # A turn is told to half the travel between poses that are followed, 4 mm.
        assert np.abs(nearest_m[near] - wanted_m).max() < (0.00201 if noise_m == 0.0 else 0.004)


SPEED = 0.3


def route(corners, **trigger):
    """Poses every 10 ms along straight legs at an even speed."""
    xy, at_m = resampled(corners, 0.01 * SPEED)
    return level(at_m / SPEED, xy, **trigger)


# Three passes of 1.2 m, 0.3 m apart, with links between them.
SERPENTINE = [(0, 0), (1.2, 0), (1.2, 0.3), (0, 0.3), (0, 0.6), (1.2, 0.6)]
ON_OFF_S = [1.0, 3.0, 6.0, 8.0, 11.0, 13.0]  # 0.6 m in the middle of each pass


def sprayed_serpentine():
    stamps, on_off = scenes.stamps_ns(ON_OFF_S), np.tile([1.0, 0.0], 3)
    return route(SERPENTINE, trigger_stamps_ns=stamps, trigger_flow=on_off)


def test_times_to_the_trigger_are_those_of_the_clock():
    path, _ = spray_path(sprayed_serpentine())
    time_s = (path.stamp_ns - scenes.START_NS) * 1e-9
    on, off = np.array(ON_OFF_S[0::2]), np.array(ON_OFF_S[1::2])
    last_on = np.searchsorted(on, time_s) - 1
    last_off = np.searchsorted(off, time_s) - 1
    was_on, was_off = last_on >= 0, last_off >= 0
    since_on = np.where(was_on, time_s - on[last_on], np.inf)
    since_off = np.where(was_off, time_s - off[last_off], np.inf)
    assert np.allclose(path.since_on_s, since_on, atol=2e-9)
    assert np.allclose(path.since_off_s, since_off, atol=2e-9)
    spraying = path.flow > 0.0
    remaining = off[np.searchsorted(off, time_s[spraying])] - time_s[spraying]
    assert np.allclose(path.until_off_s[spraying], remaining, atol=2e-9)
    # Look ahead ends with the stroke: in the run-out behind a pass nothing opens any more.
    run_out = ~spraying & (path.stroke == 0) & was_off
    assert np.all(path.until_on_s[run_out] == np.inf)
    run_in = (time_s < on[0]) & (path.stroke == 0)
    assert np.allclose(path.until_on_s[run_in], (on[0] - time_s)[run_in], atol=2e-9)


def test_distances_to_turns_add_up_to_the_leg():
    path, _ = spray_path(route(SERPENTINE))
    travelled_m = np.cumsum(path.dwell_s * path.speed_m_per_s)
    for stroke, (begin_m, end_m) in enumerate([(0, 1.2), (1.2, 1.5), (1.5, 2.7), (2.7, 3.0)]):
        # The new stroke shows some centimetres behind the turn; up to there it is the old one.
        rows = (path.stroke == stroke) & (travelled_m < end_m)
        late = (travelled_m > begin_m + 0.04) & (travelled_m < end_m)
        assert np.all(path.stroke[late] == stroke)
        to_m, from_m = path.to_turn_m[rows], path.from_turn_m[rows]
        assert np.allclose(to_m + from_m, end_m - begin_m, atol=0.001)
        assert np.ptp(to_m + from_m) < 1e-9
    row = np.argmin(np.abs(path.position_m[path.stroke == 0, 0] - 0.3))
    assert path.from_turn_m[row] == pytest.approx(0.3, abs=0.005)


def test_strokes_do_not_depend_on_where_the_part_stands():
    path, _ = spray_path(sprayed_serpentine())
    moved = sprayed_serpentine()
    turn = Rotation.from_euler('xyz', [0.4, -1.0, 2.2])
    moved = replace(
        moved, positions_m=turn.apply(moved.positions_m) + np.array([3.0, -2.0, 1.0]),
        quaternions_xyzw=(turn * Rotation.from_quat(moved.quaternions_xyzw)).as_quat(),
    )  # fmt: skip
    turned, _ = spray_path(moved)
    assert np.array_equal(turned.stroke, path.stroke)
    assert np.array_equal(turned.spray_pass, path.spray_pass)
    assert np.allclose(turned.from_turn_m, path.from_turn_m, atol=1e-9)


TIMES_S = np.arange(0.0, 10.0, 0.02)
WHOLE = scenes.straight_pass(TIMES_S)


def lines_of(trajectory: Trajectory, max_pose_gap_s: float = 0.25) -> list[str]:
    return list(interruptions(spray_path(trajectory, max_pose_gap_s)[0], max_pose_gap_s))


def rows(*chosen: np.ndarray, **trigger) -> Trajectory:
    row = np.concatenate([np.flatnonzero(each) for each in chosen])
    return scenes.rows_of(WHOLE, row, **trigger)


def test_a_gap_while_the_gun_sprays_is_named_with_its_place_and_paint():
    seen = (TIMES_S < 4.01) | (TIMES_S > 6.39)
    (line,) = lines_of(rows(seen))
    assert line.startswith('a gap in the poses while the gun sprayed, 2.40 s in all')
    assert '2.40 s from (-0.12, 0.00, 0.25) m to (0.17, 0.00, 0.25) m: taken as gun off' in line
    assert '31.7 % more paint was sprayed than is computed' in line
    changes, flow = scenes.stamps_ns([0.0, 3.9]), np.array([1.0, 0])
    closed = rows(seen, trigger_stamps_ns=changes, trigger_flow=flow)
    assert lines_of(closed) == lines_of(rows(seen), max_pose_gap_s=2.5) == lines_of(WHOLE) == []


def test_a_log_that_is_in_the_file_twice_is_told_from_another_run():
    whole = TIMES_S >= 0.0
    (line,) = lines_of(rows(whole, whole))
    assert 'start again at (-0.60, 0.00, 0.25) m: a second coat, 50.0 % of the paint' in line
    assert 'the same poses come again, as if the log were in the file twice' in line
    (line,) = lines_of(rows(whole, TIMES_S < 5.0, TIMES_S < 0.0))
    assert '33.3 % of the paint' in line
    (line,) = lines_of(rows(TIMES_S > 5.0, TIMES_S < 5.0))
    assert 'another run follows in the file' in line


def test_stamps_that_are_rounded_or_milliseconds_taken_for_seconds_are_told():
    rounded = replace(WHOLE, stamps_ns=WHOLE.stamps_ns // 10**8 * 10**8)
    (line,) = checked_path(rounded, 0.25)[2]
    assert line.startswith('400 of 500 poses dropped, for they repeat the stamp before them')
    assert checked_path(WHOLE, 0.25)[2] == ()
    slow = replace(WHOLE, stamps_ns=1000 * (WHOLE.stamps_ns - WHOLE.stamps_ns[0]))
    with pytest.raises(RecordingError, match=r'they are 20 s apart: if these are milliseconds'):
        checked_path(slow, 0.25)
