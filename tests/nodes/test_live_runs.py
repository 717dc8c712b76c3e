"""Nodes as processes, as in a cell: a bag is replayed, painted and saved; one of them stalls."""

import numpy as np
import pytest
from paint_msgs.msg import PoseProgress
from paint_msgs.srv import SaveFilm
from rcl_interfaces.srv import SetParameters
from std_srvs.srv import Trigger

from nodes.cell import parameters, saved_um, two_passes, write_own_model
from nodes.processes import NodeProcess, recorder_process, simulator_process
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.nodes import topics
from paint_deposition.nodes.topics import TRUST_TOPIC, header

COARSE = {'max_edge_length_m': 0.03}
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
    assert saved_um(tmp_path / 'film.csv').max() > 1.0


def test_ctrl_c_lets_a_film_be_saved(asked, call, onlooker, wait_until, tmp_path):
    """And ends the trial of an effect, which would never end."""
    films, user = tmp_path / 'films', onlooker()
    fine = {'max_edge_length_m': 0.004, 'output_directory': films, 'allow_user_effects': True}
    with simulator_process(tmp_path, **fine) as simulator:
        own = parameters(model_file=str(write_own_model(tmp_path)))[0].to_parameter_msg()
        service = SetParameters, '/deposition_simulator/set_parameters'
        answer = call(user, *service, parameters=[own])
        assert answer.results[0].successful, answer.results[0].reason
        asked(user, SaveFilm, '/deposition_simulator/save_film', name='film')
        wait_until(lambda: films.is_dir() and any(films.iterdir()), what='the first file')
        simulator.interrupt_as_launch_does()
        assert simulator.wait() == 0, simulator.err
        assert 'Traceback' not in simulator.err
    assert {path.name for path in films.iterdir()} == {'film.ply', 'film.csv', 'film.json'}


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
