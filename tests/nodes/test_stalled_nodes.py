"""What a cell has to bear: a node that stalls."""

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from paint_msgs.msg import PoseProgress, ThicknessStats

from nodes.cell import Robot, two_passes, write_panel
from nodes.processes import NodeProcess
from paint_deposition.files.motion_files import read_recording
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.topics import TRUST_TOPIC

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
    assert np.array_equal(read_recording(tmp_path / 'run').stamps_ns, MOTION.stamps_ns)


def test_a_film_is_in_doubt_while_its_recorder_is_stalled(
    simulator, robot, ros_domain, wait_until, onlooker, tmp_path
):
    """And once a pose was refused, until the next part."""
    node, trust = simulator(), onlooker({TRUST_TOPIC: (DiagnosticStatus, topics.LATCHED)})

    def says(level: bytes, words: str) -> bool:
        return trust.shows(TRUST_TOPIC, lambda s: s.level == level and words in s.message)

    with NodeProcess(
        tmp_path / 'rec', 'run_recorder', output_directory=tmp_path, name='run'
    ) as recorder:
        source = robot(node)
        wait_until(lambda: source.has_subscribers(2), what='both')
        source.send(MOTION, slice(0, 100))
        wait_until(lambda: node.film.counts.received == 100)
        reports = onlooker({'atomizer/progress': (PoseProgress, topics.PROGRESS)})
        wait_until(
            lambda: reports.shows('atomizer/progress', lambda p: p.reporter == '/run_recorder'),
            what='its report',
        )
        wait_until(lambda: says(b'\x00', 'all that was sent is in the film'))
        recorder.stall()
        wait_until(lambda: says(b'\x01', '/run_recorder has stalled'))
        recorder.go_on()
        wait_until(lambda: says(b'\x00', 'all that was sent'))
    source.send(MOTION, slice(100, 102), frame_id='nowhere')
    wait_until(lambda: says(b'\x01', '2 poses refused'))
    node.reset()
    wait_until(lambda: says(b'\x00', 'all that was sent'))
