"""Plans that a robot drives: its joints against the arm by the product of exponentials."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from rosbags.highlevel import AnyReader
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.spatial.transform import Rotation

import paint_deposition as pd
import robot_arm
from cli.command import figures_of, ran, told_in
from paint_deposition.api.planning import read_robot
from paint_deposition.errors import PaintError
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.transforms import Rigid, at_part, moved
from paint_deposition.planning.joints import JointPace, starts
from paint_deposition.planning.part_places import PartPlaces, part_places
from paint_deposition.planning.plan import driven, plan
from paint_deposition.planning.programme import Programme
from paint_deposition.planning.requests import PlanRequest
from scenes import painted, rows_of
from surfaces import sheet

pytestmark = pytest.mark.slow

ROUND = pd.DepositionModel(
    planar=PlanarPattern(K1_cm3_per_s=1.0, K3=0.0, r_m=0.05, sigma1_m=0.03, sigma2_m=0.04)
)
# The part lies on its back: the gun looks along its +y, which is down.
LYING = (Rotation.from_euler('z', np.pi) * Rotation.from_euler('x', -np.pi / 2)).as_quat()
PART_POSE = [0.9, 0.0, 0.5, *LYING]


@pytest.fixture(scope='module')
def cell():
    return read_robot(robot_arm.URDF, PART_POSE)


@pytest.fixture(scope='module')
def planned():
    flat = sheet(lambda x, z: 0.0 * x, half_m=0.15)
    return plan(flat, ROUND, PlanRequest(speed_m_per_s=0.2), 'part')


@pytest.fixture(scope='module')
def on_robot(planned, cell):
    return driven(planned, cell)


def test_the_tip_moves_as_its_jacobian_says(cell):
    joints = np.random.default_rng(2).uniform(-1.0, 1.0, (5, 6))
    position, axes, jacobian = cell.arm.jacobians(joints)
    expected, turns = robot_arm.tip_poses(joints)
    np.testing.assert_allclose(position, expected, atol=1e-12)
    np.testing.assert_allclose(axes, Rotation.from_quat(turns).as_matrix(), atol=1e-12)
    step = 1e-6
    for j in range(6):
        ahead, turned = robot_arm.tip_poses(joints + step * np.eye(6)[j])
        np.testing.assert_allclose((ahead - expected) / step, jacobian[:, :3, j], atol=1e-5)
        turn = (Rotation.from_quat(turned) * Rotation.from_quat(turns).inv()).as_rotvec()
        np.testing.assert_allclose(turn / step, jacobian[:, 3:, j], atol=1e-5)


def test_the_joints_lay_the_film_of_the_plan_within_their_limits(planned, on_robot):
    drive = on_robot.drive
    path = CubicHermiteSpline(drive.seconds, drive.joints, drive.speeds)
    every_ms = np.arange(0.0, drive.seconds[-1], 1e-3)
    arm = drive.arm
    assert (np.abs(path(every_ms, 1)) <= arm.fastest).all()
    # A Hermite spline rings by some per cent where the acceleration jumps.
    assert (np.abs(path(every_ms, 2)) <= 1.05 * arm.fastest / 0.25).all()
    assert ((path(every_ms) >= arm.lower) & (path(every_ms) <= arm.upper)).all()
    in_base = replace(
        drive.trajectory, stamps_ns=np.round(1e9 + 1e9 * every_ms[::4]).astype(np.int64),
        trigger_stamps_ns=drive.trajectory.trigger_stamps_ns
        - drive.trajectory.stamps_ns[0] + 10**9,
        **dict(zip(('positions_m', 'quaternions_xyzw'), robot_arm.tip_poses(path(every_ms[::4])),
                   strict=True)),
    )  # fmt: skip
    motion = at_part(in_base, PART_POSE, 'part')
    film_um = painted(planned.surface.points(), motion, ROUND).film_um
    assert np.abs(film_um - on_robot.film_um).max() < 1e-3 * on_robot.film_um.max()


def test_a_slow_joint_slows_its_passes_each_as_a_whole(planned, cell, on_robot):
    assert not on_robot.drive.limits
    used = np.abs(on_robot.drive.speeds).max(axis=0)
    busiest = int(used.argmax())
    fastest = np.where(np.arange(6) == busiest, 0.1 * used, cell.arm.fastest)
    slow = replace(cell, arm=replace(cell.arm, fastest=fastest), acceleration=4.0)
    found = driven(planned, slow)
    limits = found.drive.limits
    assert limits
    told = list(limits.values())
    assert {limit['joint'] for limit in told} == {cell.arm.joints[busiest]}
    assert all(limit['of_speed'] and limit['share'] < 0.8 for limit in told)
    assert found.cycle_time_s > on_robot.cycle_time_s
    assert list(limits) == list(found.warnings)[: len(limits)]
    assert found.mean_um > 1.05 * on_robot.mean_um
    # Within a pass the speed is even: the film along its middle is as the plan's, but thicker.
    first = found.trajectory
    on, off = first.trigger_stamps_ns[2 * told[0]['number'] - 2 : 2 * told[0]['number']]
    inside = (first.stamps_ns > on + 10**8) & (first.stamps_ns < off - 10**8)
    step_m = np.linalg.norm(np.diff(first.positions_m[inside], axis=0), axis=1)
    speed = step_m / (1e-9 * np.diff(first.stamps_ns[inside]))
    assert speed.max() < 1.02 * speed.min()
    assert speed.mean() == pytest.approx(0.2 * told[0]['share'], rel=0.02)


def test_an_improvement_is_that_which_the_robot_drives(planned, cell):
    slow = replace(cell, acceleration=0.3)
    better = pd.improve(planned.surface, planned.trajectory, ROUND, robot=slow)
    assert better.drive.limits
    assert 'bound by the joints' in better.warnings[-1]
    clock = Programme.of(better.trajectory)
    for change in better.changes:
        seconds = np.diff(clock.seconds_at(np.array(change.place_m)))[0]
        assert change.speed_m_per_s[1] == pytest.approx(np.ptp(change.place_m) / seconds, rel=0.01)


def test_a_turn_beside_the_passes_slows_itself_only(cell):
    """A joint turns back between two passes, at 1/20 of the acceleration that this needs."""
    times_s = np.arange(0.0, 4.001, 0.02)
    turned = 0.5 * np.abs(times_s[:, np.newaxis] - 2.0) * np.eye(6)[0]
    most = np.full(6, 2.5)
    pace = JointPace(cell.arm, times_s, CubicSpline(times_s, turned), most)
    spray_pass = np.select([times_s < 1.5, times_s > 2.5], [0, 1], -1)
    shares = pace.shares(spray_pass)
    reached_s, seconds, _, speeds, over = pace.driven(shares)
    assert shares[spray_pass >= 0] == pytest.approx(1.0)
    assert pace.limits(spray_pass, shares) == {}
    assert over.max() <= 1.0
    rates = np.diff(speeds, axis=0) / np.diff(seconds)[:, np.newaxis]
    assert (np.abs(rates) <= 1.001 * most).all()
    assert reached_s[-1] < 1.3 * times_s[-1]


def test_a_motion_that_is_slowed_down_has_no_gaps(planned, cell):
    """Poses 80 ms apart are nearly a second apart at a tenth of their speed."""
    few = rows_of(planned.trajectory, slice(None, None, 20))
    slow = replace(cell, arm=replace(cell.arm, fastest=0.05 * cell.arm.fastest))
    drive = slow.drive(few, free_roll=False)
    assert drive.limits
    path, counts = spray_path(drive.trajectory)
    assert counts.gaps == 0
    travel_m = [(p.dwell_s * p.speed_m_per_s)[p.flow > 0].sum() for p in (path, planned.path)]
    assert travel_m[0] == pytest.approx(travel_m[1], rel=0.01)


def test_the_tool_rolls_where_its_pattern_is_round_only(planned, cell, on_robot):
    lopsided = pd.DepositionModel(planar=PlanarPattern(K1_cm3_per_s=1.0, K3=0.3))
    kept = driven(plan(planned.surface, lopsided, PlanRequest(speed_m_per_s=0.2), 'part'), cell)
    for one, rolls in ((on_robot, True), (kept, False)):
        plain = one.trajectory.quaternions_xyzw[0]
        roll = Rotation.from_quat(plain).as_matrix()[:, 0] @ [1.0, 0.0, 0.0]
        assert (abs(abs(roll) - 1.0) > 1e-3) == rolls


def test_a_configuration_once_chosen_is_kept(planned, cell):
    """No other is looked for, also where it is one that cannot follow to the end."""
    _, chosen = cell.allowed_speeds(planned.trajectory)
    drive = cell.drive(planned.trajectory, False, chosen)
    assert drive.joints[0] == pytest.approx(chosen[0], abs=1e-3)
    place, turn = cell.poses(planned.trajectory, np.zeros(1))
    found = starts(cell.arm, place[0], turn[0].as_matrix(), False)
    other = next(one for one in found if np.abs(one[0] - chosen[0]).max() > 1.0)
    with pytest.raises(PaintError, match='in none of 1 configurations'):
        cell.drive(planned.trajectory, False, other)


def test_what_cannot_be_driven_says_where_and_a_robot_without_speeds_is_refused(
    planned, cell, tmp_path
):
    for x_m, y_m, words in ((5.0, 0.0, 'does not reach the first pose'),
                            (1.2, 0.2, 'follows the motion to')):  # fmt: skip
        part = Rigid.of([x_m, y_m, *PART_POSE[2:]])
        with pytest.raises(PaintError, match=words):
            replace(cell, part=part).drive(planned.trajectory, free_roll=False)
    unknown = tmp_path / 'unknown.urdf'
    unknown.write_text(robot_arm.URDF.read_text().replace(' velocity="1"', '', 1))
    with pytest.raises(PaintError, match='no greatest speed of shoulder_pan'):
        read_robot(unknown, PART_POSE)
    with pytest.raises(pd.PaintError, match='give seven numbers'):
        read_robot(robot_arm.URDF, [1.0, 2.0])


def test_places_of_the_part_are_those_that_can_be_driven(planned, cell):
    found = part_places(planned.trajectory, cell, np.array([0.9, 5.0]), np.zeros(1))
    assert found.reached.tolist() == [[1.0, 0.0]]
    assert found.part_pose == pytest.approx(PART_POSE)
    assert found.speed[0, 0] > 0.5
    in_base = moved(planned.trajectory, cell.part, 'base_link')
    same = part_places(in_base, cell, np.array([0.9]), np.zeros(1))
    assert same.room == pytest.approx(found.room[:, :1])


def test_the_place_to_choose_has_good_neighbours(cell):
    """A little less room of a joint beats a place beside one that is not reached."""
    reached = np.ones((5, 5))
    reached[0, 4] = 0.4
    room = np.full((5, 5), 0.2)
    room[1, 3], room[3, 1] = 0.24, 0.22
    at = np.arange(5.0)
    found = PartPlaces(cell, at, at, reached, np.where(reached < 1.0, 0.0, 1.0), room)
    assert found.best == (3, 1)
    alone = replace(found, speed=np.where(room > 0.23, 1.0, 0.5))
    assert alone.best == (1, 3)
    assert 'not all places beside it were tried' in alone.sentence


def test_the_commands_write_what_the_robot_drives(planned, cell, tmp_path):
    flat = planned.surface
    trimesh.Trimesh(flat.vertices_m, flat.faces, process=False).export(tmp_path / 'flat.stl')
    model = tmp_path / 'round.yaml'
    pd.write_model(model, ROUND)
    part = '--mesh', tmp_path / 'flat.stl', '--max-edge-length-m', 0.05
    robot = '--urdf', robot_arm.URDF, '--tip-link', 'tool0', '--part-pose', *PART_POSE
    asked = '--model', model, '--speed', 0.2, '--frame-id', 'cell'
    done = ran('plan', *part, *asked, *robot, '-o', tmp_path / 'plan')
    assert 'driven as planned' in done.stdout
    figures = told_in(tmp_path / 'plan/plan.json')['robot']
    assert figures['joints'] == list(cell.arm.joints)
    table = np.loadtxt(tmp_path / 'plan/joints.csv', delimiter=',', skiprows=1)
    with AnyReader([tmp_path / 'plan/trajectory']) as bag:
        (message,) = [
            bag.deserialize(raw, connection.msgtype)
            for connection, _, raw in bag.messages()
            if connection.topic == '/joint_trajectory'
        ]
    np.testing.assert_allclose([p.positions for p in message.points], table[:, 1:], atol=1e-6)
    given = '--trajectory', tmp_path / 'plan/trajectory', *robot
    ran('improve', *part, *given, '--model', model, '-o', tmp_path / 'better')
    assert (tmp_path / 'better/joints.csv').exists()
    better = pd.read_recording(tmp_path / 'better/trajectory', part_pose=PART_POSE)
    assert better.read_in == 'cell'
    grid = '--x', 0.9, 1.0, '--y', 0.0, 0.05
    places = figures_of('place', *given, *grid, '-o', tmp_path / 'place', '--json')
    assert places['reached'] == [[1.0]]
