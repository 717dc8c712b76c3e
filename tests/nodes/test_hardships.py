"""What a cell has to bear: a node that stalls, a folder that cannot be written, a cut network."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest

pytest.importorskip('rclpy')

from paint_msgs.msg import ThicknessStats
from paint_msgs.srv import SaveFilm

from nodes.cell import Robot, two_passes, write_panel
from nodes.processes import NodeProcess
from paint_deposition.files.recordings.bags import read_trajectory
from paint_deposition.nodes.runtime import topics

POSES = 1500
MOTION = two_passes(poses=POSES, trigger=False)
STATS = {'thickness/stats': (ThicknessStats, topics.LATCHED)}
COARSE = {'max_edge_length_m': 0.05}


@pytest.fixture
def read_only(tmp_path):
    """A folder on a file system that cannot be written, by root neither."""
    folder = tmp_path / 'read_only'
    folder.mkdir()
    mount = ['mount', '-t', 'tmpfs', '-o', 'ro,size=1m', 'tmpfs', str(folder)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip('a read-only file system can be mounted by root alone')
    yield folder
    subprocess.run(['umount', '-l', str(folder)], check=True)


def test_a_simulator_that_stalls_for_seconds_loses_nothing(
    ros_domain, ros_context, spin, wait_until, onlooker, tmp_path
):
    """Stopped as by a debugger or a swapping machine, while a recorder goes on beside it."""
    mesh = write_panel(tmp_path / 'panel.stl')
    robot, viewer = Robot(ros_context), onlooker(STATS)
    spin(robot)
    with (
        NodeProcess(tmp_path / 'sim', 'deposition_simulator', mesh_file=mesh, **COARSE) as sim,
        NodeProcess(
            tmp_path / 'rec', 'run_recorder', output_directory=tmp_path, name='run'
        ) as recorder,
    ):
        wait_until(lambda: robot.has_listeners(2), what='both')
        robot.send(MOTION, slice(0, 300))
        wait_until(lambda: viewer.newest('thickness/stats'), what='statistics')
        sim.stall()
        # More than a second of the middleware's own patience, less than the queues hold.
        robot.send(MOTION, slice(300, POSES))
        sim.go_on()

        def all_painted() -> bool:
            return viewer.newest('thickness/stats').poses_received == POSES

        wait_until(all_painted, what='all poses painted')
        assert viewer.newest('thickness/stats').poses_rejected == 0
        recorder.terminate()
        assert recorder.wait() == 0, recorder.err
    assert np.array_equal(read_trajectory(tmp_path / 'run').stamps_ns, MOTION.stamps_ns)


def test_a_folder_that_cannot_be_written_is_told_in_a_line(
    ros_domain, simulator, onlooker, call, read_only, tmp_path
):
    with NodeProcess(tmp_path / 'rec', 'run_recorder', output_directory=read_only) as recorder:
        assert recorder.wait() == 2
        (line,) = recorder.err.splitlines()
        assert line.startswith(f'error: cannot create {read_only}/run_')
        assert line.endswith('Read-only file system')
    simulator(output_directory=str(read_only))
    request = SaveFilm.Request(name='film')
    saved = call(onlooker({}), SaveFilm, '/deposition_simulator/save_film', request)
    assert not saved.success
    assert 'Read-only file system' in saved.message
    assert '\n' not in saved.message
