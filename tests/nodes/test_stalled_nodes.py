"""What a cell has to bear: a node that stalls."""

import numpy as np
from paint_msgs.msg import ThicknessStats

from nodes.cell import Robot, two_passes, write_panel
from nodes.processes import NodeProcess
from paint_deposition.files.recordings.bags import read_trajectory
from paint_deposition.nodes.runtime import topics

POSES = 1500
MOTION = two_passes(poses=POSES, trigger=False)
STATS = {'thickness/stats': (ThicknessStats, topics.LATCHED)}
COARSE = {'max_edge_length_m': 0.05}


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
        wait_until(lambda: robot.has_subscribers(2), what='both')
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
        recorder.interrupt_as_launch_does()
        assert recorder.wait() == 0, recorder.err
        assert 'file complete: ' in recorder.err.splitlines()[-1]
    assert np.array_equal(read_trajectory(tmp_path / 'run').stamps_ns, MOTION.stamps_ns)
