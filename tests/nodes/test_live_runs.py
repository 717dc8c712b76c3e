"""Nodes as processes, as in a cell: a bag is replayed, painted and saved; one of them stalls."""

import numpy as np
import pytest
from paint_msgs.msg import PoseProgress
from paint_msgs.srv import SaveFilm
from rcl_interfaces.srv import SetParameters
from std_srvs.srv import Trigger

from nodes.cell import parameters, saved_um, two_passes, write_own_model
from nodes.processes import NodeProcess, recorder_process, simulator_process
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.nodes import topics
from paint_deposition.nodes.topics import TRUST_TOPIC, header
from scenes import painted

EDGE_M = 0.03
COARSE = {'max_edge_length_m': EDGE_M}
POSES = 1500
MOTION = two_passes(poses=POSES, trigger=False)
STATS, PROGRESS = 'thickness/stats', 'atomizer/progress'
# Several processes start one after the other, on a busy machine in half a minute each.
pytestmark = pytest.mark.timeout(600)


def test_a_replay_waits_for_who_is_still_loading(ros_domain, call, onlooker, wait_until, tmp_path):
    """The recorder is there at once, the simulator seconds later; both get every pose."""
    bag = write_pose_bag(tmp_path / 'motion', two_passes(poses=300))
    replay = {'bag': bag, 'state_topic': '/atomizer/state', 'wait_for_subscribers': 2}
    statistics = onlooker(STATS)
    with (
        NodeProcess(tmp_path / 'player', 'bag_player', **replay) as player,
        recorder_process(tmp_path) as recorder,
        simulator_process(tmp_path, output_directory=tmp_path, **COARSE) as simulator,
    ):
        assert player.wait(300.0) == 0, player.err
        wait_until(lambda: statistics.shows(STATS, lambda m: m.poses_received == 300), 'all poses')
        saved = call(statistics, SaveFilm, '/deposition_simulator/save_film', name='film')
        assert saved.success, saved.message
        assert call(statistics, Trigger, '/run_recorder/stop').success
        assert recorder.wait() == 0, recorder.err
        simulator.interrupt_as_launch_does()
        assert simulator.wait() == 0, simulator.err
    assert len(read_recording(tmp_path / 'run')) == 300
    live_um = saved_um(tmp_path / 'film.csv')
    surface = read_mesh(tmp_path / 'panel.stl', 1.0, EDGE_M)
    motion = read_recording(bag, None, '/atomizer/state')
    expected_um = painted(surface.points(), motion, None, 'double', surface).film_um
    assert expected_um.max() > 1.0
    assert np.abs(live_um - expected_um).max() < 1e-6 * expected_um.max()


def test_ctrl_c_while_a_film_is_saved_lets_it_be_saved(asked, onlooker, wait_until, tmp_path):
    films = tmp_path / 'films'
    fine = {'max_edge_length_m': 0.004, 'output_directory': films}
    with simulator_process(tmp_path, **fine) as simulator:
        asked(onlooker(), SaveFilm, '/deposition_simulator/save_film', name='film')
        wait_until(lambda: films.is_dir() and any(films.iterdir()), what='the first file')
        simulator.interrupt_as_launch_does()
        assert simulator.wait() == 0, simulator.err
        assert 'Traceback' not in simulator.err
    assert {path.name for path in films.iterdir()} == {'film.ply', 'film.csv', 'film.json'}


def test_ctrl_c_while_a_model_is_prepared_ends_it(onlooker, call, tmp_path):
    """The trial of this effect would never end."""
    own = write_own_model(tmp_path)
    with simulator_process(tmp_path, allow_user_effects=True) as simulator:
        (change,) = (p.to_parameter_msg() for p in parameters(model_file=str(own)))
        service = SetParameters, '/deposition_simulator/set_parameters'
        answer = call(onlooker(), *service, parameters=[change])
        assert answer.results[0].successful, answer.results[0].reason
        simulator.interrupt_as_launch_does()
        assert simulator.wait() == 0, simulator.err


def test_a_stall_loses_nothing(robot, wait_until, onlooker, tmp_path):
    """Stopped as by a debugger or a swapping machine, while a recorder goes on beside it."""
    source, viewer = robot(), onlooker(STATS)
    with simulator_process(tmp_path, **COARSE) as sim, recorder_process(tmp_path) as recorder:
        wait_until(lambda: source.has_subscribers(2), what='both')
        source.send(MOTION, slice(0, 300))
        wait_until(lambda: viewer.newest(STATS), what='statistics')
        sim.stall()
        # More than a second of the middleware's own patience, less than the queues hold.
        source.send(MOTION, slice(300, POSES))
        sim.go_on()
        wait_until(lambda: viewer.newest(STATS).poses_received == POSES, what='all poses painted')
        assert viewer.newest(STATS).poses_rejected == 0
        recorder.interrupt_as_launch_does()
        assert recorder.wait() == 0, recorder.err
        assert 'file complete: ' in recorder.err.splitlines()[-1]
    assert np.array_equal(read_recording(tmp_path / 'run').stamps_ns, MOTION.stamps_ns)


def test_a_film_may_be_in_doubt(simulator, robot, ros_domain, wait_until, onlooker, tmp_path):
    """And once a pose was refused, until the next part."""
    node, trust = simulator(), onlooker(TRUST_TOPIC)

    def says(level: bytes, words: str) -> bool:
        return trust.shows(TRUST_TOPIC, lambda s: s.level == level and words in s.message)

    with recorder_process(tmp_path) as recorder:
        source = robot(node)
        wait_until(lambda: source.has_subscribers(2), what='both')
        source.send(MOTION, slice(0, 100))
        wait_until(lambda: node.film.counts.received == 100)
        reports, of_it = onlooker(PROGRESS), lambda report: report.reporter == '/run_recorder'
        wait_until(lambda: reports.shows(PROGRESS, of_it), what='its report')
        wait_until(lambda: says(b'\x00', 'all that was sent is in the film'))
        recorder.stall()
        wait_until(lambda: says(b'\x01', '/run_recorder has stalled'))
        recorder.go_on()
        wait_until(lambda: says(b'\x00', 'all that was sent'))
        # One that has not heard the robot yet is not behind it.
        silent = source.create_publisher(PoseProgress, PROGRESS, topics.PROGRESS)
        wait_until(lambda: silent.get_subscription_count() == 2)
        behind = header('', int(MOTION.stamps_ns[99]) - 3_000_000_000)
        silent.publish(PoseProgress(header=behind, reporter='/robot'))
        wait_until(lambda: says(b'\x01', '/robot is 3 s behind'))
        silent.publish(PoseProgress(reporter='/robot'))
        wait_until(lambda: says(b'\x00', 'all that was sent'))
        source.destroy_publisher(silent)
    source.send(MOTION, slice(100, 102), frame_id='nowhere')
    wait_until(lambda: says(b'\x01', '2 poses refused'))
    node.reset()
    wait_until(lambda: says(b'\x00', 'all that was sent'))
