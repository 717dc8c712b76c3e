"""A simulator that ends in a run and is started again has the whole film in the end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('rclpy')

from paint_msgs.msg import ThicknessStats
from paint_msgs.srv import ChangePart
from std_srvs.srv import Trigger

from nodes.cell import Robot, offline_um, two_passes, write_panel
from nodes.processes import NodeProcess
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.nodes.runtime import topics

POSES = 900
MOTION = two_passes(poses=POSES)
ENDED_AT, AGAIN_AT = 350, 500
STATS = {'thickness/stats': (ThicknessStats, topics.LATCHED)}


def test_it_catches_up_from_the_running_recording(
    ros_domain, ros_context, spin, simulator, wait_until, onlooker, painted, tmp_path
):
    robot, viewer = Robot(ros_context), onlooker(STATS)
    spin(robot)
    mesh = write_panel(tmp_path / 'panel.stl')
    recorder = NodeProcess(tmp_path / 'rec', 'run_recorder', output_directory=tmp_path, name='run')
    with recorder:
        first = NodeProcess(
            tmp_path / 'sim', 'deposition_simulator', mesh_file=mesh, max_edge_length_m=0.05
        )
        with first:
            wait_until(lambda: robot.has_listeners(2), what='both')
            robot.send(MOTION, slice(0, ENDED_AT))
            wait_until(lambda: viewer.newest('thickness/stats'), what='statistics')
            first.terminate()
            first.wait()
        wait_until(lambda: not robot.has_listeners(2), what='the recorder alone')
        # The gun paints on meanwhile.
        robot.send(MOTION, slice(ENDED_AT, AGAIN_AT))
        node = simulator(catch_up=str(tmp_path / 'run'), pose_queue_depth=2000)
        wait_until(lambda: robot.is_heard_by(node) and robot.has_listeners(2), what='both')
        robot.send(MOTION, slice(AGAIN_AT, POSES))
        film, expected = painted(node, POSES), offline_um(node, MOTION)
    assert expected.max() > 5.0
    assert node.film.counts.rejected == 0
    assert np.array_equal(film, expected)


def test_a_recording_that_is_not_there_is_told_and_the_live_poses_are_painted(
    simulator, robot, painted, tmp_path, capfd
):
    node = simulator(catch_up=str(tmp_path / 'nowhere'))
    robot(node).send(MOTION)
    film, expected = painted(node, POSES), offline_um(node, MOTION)
    assert np.array_equal(film, expected)
    assert f'not caught up: {tmp_path}/nowhere does not exist' in capfd.readouterr().err


def poses_of(motion: Trajectory, rows: slice) -> Trajectory:
    """Some of the poses, and the trigger as far as they go."""
    stamps = motion.stamps_ns[rows]
    sent = motion.trigger_stamps_ns <= stamps[-1]
    return replace(
        motion,
        stamps_ns=stamps,
        positions_m=motion.positions_m[rows],
        quaternions_xyzw=motion.quaternions_xyzw[rows],
        trigger_stamps_ns=motion.trigger_stamps_ns[sent],
        trigger_flow=motion.trigger_flow[sent],
    )


def test_another_part_does_not_come_while_the_film_is_caught_up(
    simulator, robot, painted, call, onlooker, tmp_path
):
    """The answer says so; the film is whole, and then the next part may come."""
    run = write_pose_bag(tmp_path / 'run', poses_of(MOTION, slice(0, AGAIN_AT)))
    node = simulator(catch_up=str(run), pose_queue_depth=2000)
    operator, cell = onlooker({}), robot(node)

    def change() -> ChangePart.Response:
        request = ChangePart.Request(serial='next')
        return call(operator, ChangePart, '/deposition_simulator/change_part', request)

    refused = change()
    assert not refused.success
    assert refused.message.startswith(f'the film is being caught up from {run}: ask again')
    cell.send(MOTION, slice(AGAIN_AT, POSES))
    assert np.array_equal(painted(node, POSES), offline_um(node, MOTION))
    assert change().success
    assert node.film.counts.received == 0


def test_a_reset_gives_up_what_was_to_be_caught_up(
    simulator, robot, painted, call, onlooker, tmp_path, capfd
):
    motion = two_passes(poses=POSES, trigger=False)
    run = write_pose_bag(tmp_path / 'run', poses_of(motion, slice(0, AGAIN_AT)))
    node = simulator(catch_up=str(run), pose_queue_depth=2000)
    cell = robot(node)
    assert call(onlooker({}), Trigger, '/deposition_simulator/reset', Trigger.Request()).success
    assert f'not caught up from {run}: it was reset' in capfd.readouterr().err
    rest = poses_of(motion, slice(AGAIN_AT, POSES))
    cell.send(rest)
    assert np.array_equal(painted(node, len(rest)), offline_um(node, rest))


def test_only_the_motion_of_a_recording_is_copied(tmp_path):
    run = write_pose_bag(tmp_path / 'run', MOTION)
    copied = recover(run, tmp_path / 'copy', topics=['/atomizer/pose'])
    assert copied.counts == {'/atomizer/pose': POSES}
