"""The managed nodes under a lifecycle manager, over real DDS."""

import os
import threading

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from paint_msgs.srv import SaveFilm
from std_srvs.srv import Trigger

from nodes.cell import offline_um, parameters, two_passes, write_panel
from paint_deposition.files.motion_files import read_recording
from paint_deposition.nodes.managed_node import ManagedNode
from paint_deposition.nodes.node import OK
from scenes import rows_of

MOTION = two_passes()
EVENTS = '/deposition_simulator/transition_event'
POSES, STATE = 'deposition_simulator: poses', 'deposition_simulator: state'


@pytest.fixture
def viewer(onlooker):
    return onlooker()


@pytest.fixture
def manager(viewer, call):
    """`manager(node)(transition)`: whether it succeeded, and the state of the node after it."""

    def manager(node):
        ask = lambda kind, of, **fields: call(viewer, kind, f'{node.NAME}/{of}', **fields)  # noqa: E731

        def change(label: str) -> tuple[bool, str]:
            answer = ask(ChangeState, 'change_state', transition=Transition(label=label))
            return answer.success, ask(GetState, 'get_state').current_state.label

        return change

    return manager


def test_a_simulator_goes_through_its_states(simulator, robot, manager, onlooker, call, painted,
                                             wait_until):  # fmt: skip
    """Poses that it receives while it is inactive are counted and not painted."""
    node = simulator(autostart=False)
    managed = manager(node)
    events = onlooker(EVENTS)
    assert not node.count_subscribers('atomizer/pose')
    assert managed('activate') == (False, 'unconfigured')
    assert managed('configure') == (True, 'inactive')
    source = robot(node)
    source.send(MOTION, slice(0, 300))
    told = '300 poses came and were not painted'
    wait_until(lambda: events.reports(POSES, told, b'\x01'))
    assert managed('activate') == (True, 'active')
    source.send(MOTION, slice(300, 600))
    film = painted(node, 300)
    wait_until(lambda: events.reports(POSES, 'painting', b'\x00'))
    assert events.value(POSES, 'poses not painted while inactive') == '300'
    assert managed('deactivate') == (True, 'inactive')
    assert call(events, SaveFilm, '/deposition_simulator/save_film', name='held').success
    assert managed('activate') == (True, 'active')
    assert np.array_equal(node.film.snapshot().film_um, film)
    # The states count that came before.
    assert np.array_equal(film, offline_um(node, rows_of(MOTION, slice(300, None))))
    assert managed('deactivate') == (True, 'inactive')
    assert managed('cleanup') == (True, 'unconfigured')
    wait_until(lambda: not source.pose_publisher.get_subscription_count())
    assert managed('configure') == (True, 'inactive')
    assert node.film.counts.received == 0
    assert managed('shutdown') == (True, 'finalized')
    states = [event.goal_state.label for event in events.all(EVENTS)]
    assert states[-2:] == ['shuttingdown', 'finalized']


@pytest.mark.parametrize('guns', [[], ['left', 'right']])
def test_what_callbacks_replace_stays_until_cleanup(
    simulator, manager, robot, painted, onlooker, wait_until, guns
):
    """Subscriptions match a robot that comes later; rate and pose of the part are set anew."""
    node = simulator(atomizers=guns)
    managed = manager(node)
    robots = [robot(reliable=False, namespace=gun) for gun in guns or ['']]
    # A best-effort robot is heard once the subscription has been replaced.
    wait_until(lambda: all(source.has_subscribers(1) for source in robots))
    placed = {'part_parent_frame': 'cell', 'part_pose': [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]}
    for change in parameters(publish_rate_hz=25.0, **placed):
        assert node.set_parameters_atomically([change]).successful
    for rows in (slice(0, 300), slice(300, 600)):
        assert managed('deactivate') == (True, 'inactive')
        assert managed('activate') == (True, 'active')
        for source in robots:
            source.send(MOTION, rows, frame_id='cell')
        painted(node, len(robots) * rows.stop)
    viewer, sent = onlooker('thickness/stats', 'part_pose'), len(robots) * 600
    wait_until(lambda: viewer.shows('thickness/stats', lambda s: s.poses_received == sent))
    wait_until(lambda: viewer.newest('part_pose'), what='the latched pose of the part')
    assert managed('deactivate') == (True, 'inactive')
    assert managed('cleanup') == (True, 'unconfigured')
    wait_until(lambda: not any(source.has_subscribers(1) for source in robots))


def test_a_shutdown_waits_for_an_answer(simulator, manager, viewer, asked, wait_until):
    """It cannot be refused, as another step is; the node paints no more meanwhile."""
    node, disk = simulator(), threading.Event()
    managed = manager(node)
    node._saving.submit(disk.wait, 10.0)
    saved = asked(viewer, SaveFilm, '/deposition_simulator/save_film', name='held')
    wait_until(lambda: node.awaiting, what='the request')
    assert managed('deactivate') == (False, 'active')
    assert node.tasks['state']() == (OK, 'active', {})
    assert managed('shutdown') == (True, 'finalized')
    assert not node.active
    disk.set()
    wait_until(lambda: saved.done() and not node.configured, what='the answer and the end')
    assert saved.result().success


def test_what_it_reads_may_change_unconfigured(simulator, manager, viewer, wait_until, tmp_path):
    """A part that cannot be read leaves it unconfigured, and it says so."""
    (tmp_path / 'late.stl').write_text('no mesh')
    other = str(write_panel(tmp_path / 'other.stl'))
    node = simulator(autostart=False, mesh_file=str(tmp_path / 'late.stl'))
    managed = manager(node)
    assert managed('configure') == (False, 'unconfigured')

    def told(**values) -> str:
        return node.set_parameters_atomically(parameters(**values)).reason

    wait_until(lambda: viewer.reports(STATE, 'late.stl', b'\x02'))
    assert told(mesh_file=other, max_edge_length_m=0.2, atomizers=['left', 'right']) == ''
    assert 'not all zero' in told(down=[0.0, 0.0, 0.0])
    assert managed('configure') == (True, 'inactive')
    wait_until(lambda: viewer.reports(STATE, 'inactive', b'\x00'))
    assert (node.mesh_file, node.gun_names) == (other, ['left', 'right'])
    refused = 'max_edge_length_m cannot change while the node is configured: the film so far lies'
    assert told(max_edge_length_m=0.1).startswith(refused)
    assert 'while the node runs: remote nodes must not choose' in told(output_directory='/tmp')
    managed('cleanup')
    assert told(max_edge_length_m=0.1) == ''
    assert 'while the node runs: remote nodes must not choose' in told(output_directory='/tmp')


class Faulty(ManagedNode):
    """Its work fails in a way that nobody foresaw."""

    NAME = 'faulty'

    def _configure(self):
        self.create_publisher(PoseStamped, 'poses', 10)
        return {}

    def _activate(self) -> None:
        raise ZeroDivisionError('by nothing')


def test_an_unforeseen_error_ends_unconfigured(start, ros_context, manager, viewer, wait_until):
    node = start(Faulty, autostart=False)
    managed = manager(node)
    publishers = len(list(node.publishers))
    assert managed('configure') == (True, 'inactive')
    assert managed('activate') == (False, 'unconfigured')
    assert len(list(node.publishers)) == publishers
    wait_until(lambda: viewer.reports('faulty: state', 'ZeroDivisionError: by nothing', b'\x02'))
    # One that is destroyed has no services, whoever holds on to it.
    service = '/faulty/change_state'
    assert viewer.count_services(service) == 1
    node.destroy_node()
    wait_until(lambda: viewer.count_services(service) == 0, what='its end', timeout_s=5.0)
    with pytest.raises(ZeroDivisionError):
        Faulty(context=ros_context)


def test_each_activation_is_a_whole_run(record, robot, manager, call, wait_until, tmp_path):
    recorder = record(autostart=False)
    managed = manager(recorder)
    source = robot()
    assert managed('configure') == (True, 'inactive')
    assert not list(tmp_path.iterdir())
    # What comes once, before there is a run, stays in force.
    wait_until(source.state_publisher.get_subscription_count, what='the subscription')
    source.send_state(MOTION.stamps_ns[0] - 1, 0.5)
    wait_until(lambda: recorder.recorded['/atomizer/state'].messages, what='the state')
    # A run that is there is not overwritten.
    (tmp_path / 'run').mkdir()
    assert managed('activate') == (False, 'inactive')
    assert not list((tmp_path / 'run').iterdir())
    (tmp_path / 'run').rmdir()
    for rows in (slice(0, 150), slice(300, 600)):
        assert managed('activate') == (True, 'active')
        wait_until(lambda: source.pose_publisher.get_subscription_count() == 1)
        source.send(MOTION, rows)
        assert managed('deactivate') == (True, 'inactive')
        run = recorder.run.folder
        assert (run / 'metadata.yaml').is_file()
        recorded = read_recording(run, None, None)
        assert np.array_equal(recorded.stamps_ns, MOTION.stamps_ns[rows])
        wait_until(lambda: not source.pose_publisher.get_subscription_count())
    assert len(list(tmp_path.glob('run*'))) == 2
    first = read_recording(tmp_path / 'run', None, '/atomizer/state')
    assert first.trigger_flow.tolist() == [0.5, 1.0]
    assert call(source, Trigger, '/run_recorder/stop').success
    assert managed('shutdown') == (True, 'finalized')
    wait_until(recorder.finished.done, what='the end of the process', timeout_s=5.0)


@pytest.mark.parametrize('kind', ['simulator', 'record'])
def test_repeated_cycles_leave_nothing_behind(request, manager, kind):
    node = request.getfixturevalue(kind)(autostart=False)
    managed = manager(node)

    def entities() -> list[int]:
        kinds = (node.publishers, node.subscriptions, node.services, node.timers)
        return [len(list(kind)) for kind in kinds]

    at_first = entities()
    found = []
    for _ in range(3):
        for transition in ('configure', 'activate', 'deactivate', 'cleanup'):
            assert managed(transition)[0]
        assert entities() == at_first
        found.append((threading.active_count(), len(os.listdir('/proc/self/fd'))))
    # The first cycle opens what stays open, shared by all nodes.
    assert all(now <= before for now, before in zip(found[-1], found[1], strict=True)), found
