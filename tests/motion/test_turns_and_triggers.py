"""Strokes and passes of whole motions, and the distances to turns and trigger changes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import scenes
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import Trajectory

SPEED = 0.3


def route(corners, **trigger):
    """Poses every 10 ms along straight legs at an even speed."""
    corners = np.array(corners, dtype=float)
    legs = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(legs)])
    at = np.append(np.arange(0.0, along[-1], 0.01 * SPEED), along[-1])
    xy = np.stack([np.interp(at, along, corners[:, axis]) for axis in range(2)], axis=1)
    positions = np.hstack([xy, np.full((len(at), 1), 0.25)])
    quaternions = np.tile(scenes.LOOKING_DOWN, (len(at), 1))
    return Trajectory(scenes.stamps_ns(at / SPEED), positions, quaternions, **trigger)


# Three passes of 1.2 m, 0.3 m apart, with links between them.
SERPENTINE = [(0, 0), (1.2, 0), (1.2, 0.3), (0, 0.3), (0, 0.6), (1.2, 0.6)]
ON_OFF_S = [1.0, 3.0, 6.0, 8.0, 11.0, 13.0]  # 0.6 m in the middle of each pass


def sprayed_serpentine():
    on_off = np.tile([1.0, 0.0], 3)
    stamps = scenes.stamps_ns(ON_OFF_S)
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
        assert np.all(
            path.stroke[(travelled_m > begin_m + 0.04) & (travelled_m < end_m)] == stroke
        )
        to_m, from_m = path.to_turn_m[rows], path.from_turn_m[rows]
        assert np.allclose(to_m + from_m, end_m - begin_m, atol=0.001)
        assert np.ptp(to_m + from_m) < 1e-9
    # 0.3 m into the first pass.
    row = np.argmin(np.abs(path.position_m[path.stroke == 0, 0] - 0.3))
    assert path.from_turn_m[row] == pytest.approx(0.3, abs=0.005)


def test_trembling_at_rest_is_no_turn():
    rng = np.random.default_rng(5)
    times = np.arange(0.0, 3.0, 0.01)
    still = rng.normal(0.0, 2e-4, (len(times), 3)) + np.array([0.0, 0.0, 0.25])
    trajectory = Trajectory(
        scenes.stamps_ns(times), still, np.tile(scenes.LOOKING_DOWN, (len(times), 1))
    )
    assert spray_path(trajectory)[0].stroke[-1] == 0


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
