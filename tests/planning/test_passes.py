"""Planned passes and the motion along them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from paint_deposition.motion.path_builder import spray_path
from paint_deposition.planning.passes import (
    PassStyle,
    plan_pass,
    plan_passes,
    planned_moves,
    trajectory_of,
)
from paint_deposition.planning.surface_map import SurfaceMap, pass_axes
from planning.test_surface_map import sheet

STYLE = PassStyle(0.25, 0.3, acceleration_m_per_s2=2.0, overspray_m=0.2)
LINES_M = np.array([0.3, 0.0, -0.3])


@pytest.fixture(scope='module')
def bowed():
    surface = sheet(lambda x, z: 0.3 * x**2 + 0.2 * z**2)
    return SurfaceMap(surface, pass_axes(surface), 0.1)


@pytest.fixture(scope='module')
def motion(bowed):
    return trajectory_of(plan_passes(bowed, LINES_M, STYLE), 'part')


def test_pass_keeps_standoff_and_is_square_to_the_surface(bowed):
    planned = plan_pass(bowed, 0.1, STYLE)
    tool_z = planned.rotations[:, :, 2]
    on_surface = planned.positions_m + STYLE.standoff_m * tool_z
    u, v, height = ((on_surface - bowed.origin_m) @ bowed.axes.T).T
    np.testing.assert_allclose(v, 0.1, atol=1e-9)
    np.testing.assert_allclose(height, bowed.height_m(u, v), atol=1e-9)
    np.testing.assert_allclose(tool_z, -bowed.normals(u, v), atol=1e-9)
    identity = planned.rotations.transpose(0, 2, 1) @ planned.rotations
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-9)
    assert np.allclose(np.linalg.det(planned.rotations), 1.0)


def test_gun_is_on_from_before_the_part_to_behind_it(bowed):
    planned = plan_pass(bowed, 0.0, STYLE)
    path, _ = spray_path(trajectory_of((planned,)))
    # Where the gun's axis meets the surface: the TCP leans out over the bow.
    aimed_at = path.position_m + STYLE.standoff_m * path.rotation[:, :, 2]
    on = ((aimed_at[path.flow > 0.0] - bowed.origin_m) @ bowed.axes.T)[:, 0]
    assert on.min() == pytest.approx(-0.5 - STYLE.overspray_m, abs=0.02)
    assert on.max() == pytest.approx(0.5 + STYLE.overspray_m, abs=0.02)


def test_speed_is_even_while_spraying_and_acceleration_kept(motion):
    seconds = np.diff(motion.stamps_ns) * 1e-9
    speed = np.linalg.norm(np.diff(motion.positions_m, axis=0), axis=1) / seconds
    assert speed.max() < STYLE.speed_m_per_s * 1.001
    steps = np.abs(np.diff(speed)) / seconds[1:]
    assert np.quantile(steps, 0.999) < STYLE.acceleration_m_per_s2 * 1.02
    path, _ = spray_path(motion)
    on = path.speed_m_per_s[path.flow > 0.0]
    np.testing.assert_allclose(on, STYLE.speed_m_per_s, rtol=2e-3)
    assert np.median(seconds) == pytest.approx(0.004, abs=1e-5)
    assert seconds.min() > 0.0


def test_serpentine_alternates_and_keeps_the_tool_as_it_is(bowed, motion):
    path, _ = spray_path(motion)
    on = path.select(path.flow > 0.0)
    ways = [on.velocity_m_per_s[on.spray_pass == k].mean(axis=0) for k in range(3)]
    assert ways[0] @ ways[1] < 0.0 < ways[0] @ ways[2]
    tool_x = [on.rotation[on.spray_pass == k].mean(axis=0)[:, 0] for k in range(3)]
    assert tool_x[0] @ tool_x[1] > 0.9
    one_way = PassStyle(0.25, 0.3, overspray_m=0.2, one_way=True)
    path, _ = spray_path(trajectory_of(plan_passes(bowed, LINES_M, one_way)))
    on = path.select(path.flow > 0.0)
    ways = [on.velocity_m_per_s[on.spray_pass == k].mean(axis=0) for k in range(3)]
    assert min(ways[0] @ ways[1], ways[0] @ ways[2]) > 0.0
    assert motion.trigger_flow.tolist() == [1.0, 0.0] * 3


def test_travel_direction_in_the_tool_frame_is_the_angle_asked_for(bowed):
    style = PassStyle(0.25, 0.3, travel_rad=0.7)
    planned = plan_pass(bowed, 0.0, style)
    ahead = np.gradient(planned.positions_m, axis=0)[100]
    ahead /= np.linalg.norm(ahead)
    x, y, _ = planned.rotations[100].T @ ahead
    assert np.arctan2(y, x) == pytest.approx(0.7, abs=1e-3)


def test_moves_of_the_robot_follow_the_same_way(bowed):
    passes = plan_passes(bowed, LINES_M, STYLE)
    moves = planned_moves(passes)
    assert not moves[0].spraying
    switches = np.diff([move.spraying for move in moves])
    assert np.count_nonzero(switches) == 2 * len(passes)
    every = np.concatenate([planned.positions_m for planned in passes])
    for move in moves:
        assert np.linalg.norm(every - move.position_m, axis=1).min() < 0.006
        assert np.linalg.norm(move.quaternion_xyzw) == pytest.approx(1.0)
    start = Rotation.from_quat(moves[0].quaternion_xyzw).as_matrix()
    np.testing.assert_allclose(start, passes[0].rotations[0], atol=1e-9)
