"""Recording over real DDS: byte for byte, losses counted, through kills and full disks."""

import contextlib
import itertools
import shutil
import subprocess
import time

import numpy as np
import pytest
import yaml

pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import PoseProgress, ThicknessStats
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.time import Time
from rosbags.rosbag2 import Reader
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from files.recorded import START_NS, straight_pass
from nodes.processes import NodeProcess
from paint_deposition.errors import PaintError, RecordingError
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.bags import read_trajectory, write_pose_bag
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.files.recordings.triggers import stamp_ns
from paint_deposition.nodes.planning.index_planner import IndexPlanner
from paint_deposition.nodes.recording.run_recorder import RunRecorder
from paint_deposition.nodes.replay.bag_player import BagPlayer
from paint_deposition.nodes.runtime import qos

BEST_EFFORT = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
MODULE = 'run_recorder'


def pose(stamp_ns: int, x_m: float = 0.0, frame_id: str = 'door') -> PoseStamped:
    message = PoseStamped()
    message.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
    message.header.frame_id = frame_id
    message.pose.position.x = x_m
    message.pose.orientation.w = 1.0
    return message


@pytest.fixture
def record(ros_context, spin, tmp_path):
    """`record(**parameters)`: a recorder of the run `run`, running."""

    def record(namespace='', **parameters) -> RunRecorder:
        values = {'output_directory': str(tmp_path), 'name': 'run'} | parameters
        recorder = RunRecorder(
            context=ros_context,
            namespace=namespace,
            parameter_overrides=[Parameter(name, value=value) for name, value in values.items()],
        )
        spin(recorder)
        return recorder

    return record


@pytest.fixture
def cell(ros_context, spin):
    """A node to publish from."""
    node = Node('cell', context=ros_context)
    spin(node)
    return node


@pytest.fixture
def publisher(cell, wait_until):
    """`publisher(type, topic, profile)`: a publisher that the recorder has subscribed to."""

    def publisher(kind, topic: str, profile: QoSProfile, subscribers: int = 1):
        made = cell.create_publisher(kind, topic, profile)
        wait_until(
            lambda: made.get_subscription_count() >= subscribers, what=f'a subscriber on {topic}'
        )
        return made

    return publisher


def finish(recorder: RunRecorder) -> dict:
    """End the recording and return the information of its metadata file."""
    recorder.close()
    content = yaml.safe_load((recorder.run.folder / 'metadata.yaml').read_text())
    return content['rosbag2_bagfile_information']


def counts(information: dict) -> dict[str, int]:
    """Messages by topic, but for what the nodes say of themselves."""
    found = {
        entry['topic_metadata']['name']: entry['message_count']
        for entry in information['topics_with_message_count']
    }
    of_nodes = ('/diagnostics', '/parameter_events')
    return {name: count for name, count in found.items() if name not in of_nodes}


def offered(information: dict, topic: str) -> list[dict]:
    topics = [entry['topic_metadata'] for entry in information['topics_with_message_count']]
    return next(entry for entry in topics if entry['name'] == topic)['offered_qos_profiles']


def messages(path) -> list[tuple[str, bytes]]:
    with open_bag(path) as bag:
        return [(message.topic, message.cdr) for message in bag.messages()]


def test_every_byte_of_a_replay_is_recorded(ros_context, record, spin, wait_until, tmp_path):
    written = straight_pass(900)
    bag = write_pose_bag(tmp_path / 'pass', written)
    recorder = record()
    player = BagPlayer(
        context=ros_context,
        parameter_overrides=[
            Parameter(name, value=value)
            for name, value in {
                'bag': str(bag), 'rate': 0.0, 'state_topic': '/atomizer/state',
            }.items()
        ],
    )  # fmt: skip
    spin(player)
    wait_until(player.finished.done, what='the end of the replay')
    information = finish(recorder)
    assert counts(information)['/atomizer/pose'] == 900
    assert counts(information)['/atomizer/state'] == 2
    assert [m for m in messages(recorder.run.folder) if m[0] == '/atomizer/pose'] == [
        m for m in messages(bag) if m[0] == '/atomizer/pose'
    ]
    again = read_trajectory(recorder.run.folder, None, '/atomizer/state')
    for name in ('stamps_ns', 'positions_m', 'trigger_stamps_ns', 'trigger_flow'):
        np.testing.assert_array_equal(getattr(again, name), getattr(written, name))


def test_latched_messages_are_recorded_as_latched(record, cell, wait_until):
    """The mesh's statistics came before the recorder; their QoS survives into the bag."""
    latched = cell.create_publisher(ThicknessStats, 'thickness/stats', qos.LATCHED)
    latched.publish(ThicknessStats(mean_um=41.5))
    recorder = record()
    wait_until(
        lambda: recorder.run.counts.get('/thickness/stats', 0) == 1, what='the latched message'
    )
    information = finish(recorder)
    (profile,) = offered(information, '/thickness/stats')
    assert profile['durability'] == 'transient_local'
    assert profile['reliability'] == 'reliable'
    ((_, data),) = messages(recorder.run.folder)
    # Not byte by byte: what pads a message is left as it was in memory.
    assert deserialize_message(data, ThicknessStats) == ThicknessStats(mean_um=41.5)


@pytest.mark.parametrize('profile', [BEST_EFFORT, QoSProfile(depth=50)])
def test_both_reliabilities_connect(record, publisher, wait_until, profile):
    recorder = record()
    poses = publisher(PoseStamped, 'atomizer/pose', profile)
    for k in range(20):
        poses.publish(pose(START_NS + k * 4_000_000))
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose', 0) == 20, what='the poses')
    information = finish(recorder)
    (recorded,) = offered(information, '/atomizer/pose')
    assert recorded['reliability'] == profile.reliability.name.lower()


def test_a_second_weaker_publisher_is_recorded_too(record, publisher, wait_until, cell):
    recorder = record()
    first = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=50))
    first.publish(pose(START_NS))
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose', 0) == 1, what='the first pose')
    second = publisher(PoseStamped, 'atomizer/pose', BEST_EFFORT)
    wait_until(lambda: first.get_subscription_count() == 1, what='one subscription')
    first.publish(pose(START_NS + 1))
    second.publish(pose(START_NS + 2))
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose', 0) == 3, what='the poses of both')
    finish(recorder)


def test_named_topics_are_recorded_and_no_others(record, publisher, wait_until, cell):
    recorder = record(topics=['chatter', '/cell/gun', 'never'])
    chatter = publisher(String, 'chatter', qos.RESULTS)
    gun = publisher(Bool, '/cell/gun', qos.RESULTS)
    other = cell.create_publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    other.publish(pose(START_NS))
    chatter.publish(String(data='hello'))
    gun.publish(Bool(data=True))
    wait_until(lambda: recorder.run.message_count == 2, what='both messages')
    assert counts(finish(recorder)) == {'/chatter': 1, '/cell/gun': 1}


def test_relative_topics_follow_the_namespace(record, publisher, wait_until):
    recorder = record(namespace='/cell1')
    poses = publisher(PoseStamped, '/cell1/atomizer/pose', QoSProfile(depth=500))
    poses.publish(pose(START_NS))
    wait_until(lambda: recorder.run.message_count == 1, what='the pose')
    assert counts(finish(recorder)) == {'/cell1/atomizer/pose': 1}


def test_gaps_and_missed_messages_are_counted(record, publisher, wait_until):
    recorder = record(topics=['atomizer/pose'], max_pose_gap_s=0.1)
    poses = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    stamps_ns = START_NS + np.array([0, 4, 8, 508, 512, 612, 613]) * 1_000_000
    for stamp in stamps_ns.tolist():
        poses.publish(pose(stamp))
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose', 0) == 7, what='the poses')
    recorder.close()
    # 500 ms is a gap, 100 ms is just none.
    assert recorder.summary() == f'7 messages, 1 gaps, file complete: {recorder.run.folder}'


def test_a_queue_that_overflows_shows_as_missed(record, cell, publisher, wait_until):
    """A hundred strings fit into the queue; what the middleware dropped before is counted."""
    recorder = record(topics=['chatter'])
    chatter = publisher(String, 'chatter', QoSProfile(depth=1000))
    chatter.publish(String(data='first'))
    wait_until(lambda: recorder.run.message_count == 1, what='the first message')
    # Nobody runs the recorder's callbacks meanwhile.
    for k in range(300):
        chatter.publish(String(data=str(k)))
    chatter.wait_for_all_acked()
    wait_until(lambda: recorder.run.message_count >= 101, what='what is left')
    recorder.close()
    lost = 301 - recorder.run.message_count
    assert lost > 0
    assert f'{recorder.run.message_count} messages, {lost} missed' in recorder.summary()


def test_poses_in_the_queue_at_the_end_are_recorded(record, publisher, wait_until):
    recorder = record()
    poses = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=1_000))
    poses.publish(pose(START_NS))
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose', 0) == 1, what='the first pose')
    for k in range(1, 500):
        poses.publish(pose(START_NS + k))
    poses.wait_for_all_acked()
    assert counts(finish(recorder)) == {'/atomizer/pose': 500}


def test_the_recorder_reports_progress(record, publisher, wait_until, cell):
    record()
    reports = []
    cell.create_subscription(PoseProgress, 'atomizer/progress', reports.append, qos.PROGRESS)
    poses = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    poses.publish(pose(START_NS + 7))
    wait_until(lambda: reports and reports[-1].poses_received == 1, what='a report')
    assert stamp_ns(reports[-1].header) == START_NS + 7


def test_stop_finishes_the_run(record, publisher, wait_until, cell):
    recorder = record()
    poses = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    poses.publish(pose(START_NS))
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose', 0) == 1, what='the pose')
    client = cell.create_client(Trigger, 'run_recorder/stop')
    wait_until(client.service_is_ready, what='the service')
    future = client.call_async(Trigger.Request())
    wait_until(future.done, what='the answer')
    assert future.result().success
    assert future.result().message.endswith(f'file complete: {recorder.run.folder}')
    assert recorder.finished.result() == 0
    assert (recorder.run.folder / 'metadata.yaml').exists()


def test_what_the_run_was_made_with_is_kept(record, tmp_path):
    mesh, model = tmp_path / 'door.stl', tmp_path / 'model.yaml'
    mesh.write_bytes(b'solid door')
    model.write_text('planar: {K1_cm3_per_s: 1.9}\n')
    notes = finish(record(mesh_file=str(mesh), model_file=str(model)))['custom_data']
    assert notes['mesh_file'] == str(mesh)
    assert len(notes['mesh_sha256']) == 64
    assert notes['model_yaml'] == 'planar: {K1_cm3_per_s: 1.9}\n'


def test_a_model_changed_meanwhile_is_in_the_recording(record, ros_context, spin, wait_until):
    planner = IndexPlanner(context=ros_context)
    spin(planner)
    recorder = record()
    events = [p for p in planner.publishers if p.topic_name == '/parameter_events']
    wait_until(
        lambda: all(p.get_subscription_count() > 0 for p in events), what='the subscription'
    )
    (result,) = planner.set_parameters([Parameter('width_m', value=0.75)])
    assert result.successful
    wait_until(lambda: recorder.run.counts.get('/parameter_events', 0) >= 1, what='the event')
    finish(recorder)
    with open_bag(recorder.run.folder) as bag:
        (event,) = (event for _, _, event in bag.decoded(['/parameter_events']))
    assert event.node == '/index_planner'
    (change,) = event.changed_parameters
    assert (change.name, change.value.double_value) == ('width_m', 0.75)


def test_diagnostics_tell_bytes_and_disk(record, publisher, wait_until, cell):
    record()
    got = []
    cell.create_subscription(DiagnosticArray, '/diagnostics', got.append, qos.DIAGNOSTICS)
    poses = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    poses.publish(pose(START_NS))

    def told() -> bool:
        values = {v.key: v.value for v in got[-1].status[0].values} if got else {}
        return values.get('/atomizer/pose') == '1 messages, 0 missed, 0 gaps'

    wait_until(told, what='diagnostics of the pose')
    status = got[-1].status[0]
    values = {v.key: v.value for v in status.values}
    assert status.name == 'run_recorder: recording'
    assert int(values['bytes']) > 0
    assert int(values['disk free bytes']) > 0


@pytest.mark.parametrize(
    ('parameters', 'says'),
    [
        ({'mesh_file': '/nowhere.stl'}, 'mesh_file /nowhere.stl: No such file or directory'),
        ({'compression': 'zip'}, "compression is 'zip': choose one of zstd, lz4, none"),
        ({'output_directory': '/dev/null/runs'}, 'cannot create /dev/null/runs/run'),
        ({'topic': 'x'}, 'run_recorder has no parameter topic; did you mean'),
    ],
)
def test_bad_input_is_told_at_the_start(record, parameters, says):
    with pytest.raises(PaintError, match=says):
        record(**parameters)


def test_an_existing_run_is_not_overwritten(record, tmp_path):
    (tmp_path / 'run').mkdir()
    with pytest.raises(RecordingError, match='run already exists'):
        record()


# --- as a process


def test_losses_that_cannot_be_counted_are_not_called_none(record, publisher, wait_until):
    """Some middlewares number no messages; the second one comes as from them."""
    recorder = record(topics=['chatter'])
    sender = publisher(String, 'chatter', QoSProfile(depth=10))
    sender.publish(String(data='numbered'))
    topic = recorder.resolve_topic_name('chatter')
    wait_until(lambda: recorder._topics[topic].messages == 1, what='the message')
    assert 'cannot be counted' not in recorder.summary()
    times = {'received_timestamp': 1, 'source_timestamp': 1}
    cdr = serialize_message(String(data='without a number'))
    recorder._topics[topic]._on_message(cdr, times | {'publication_sequence_number': None})
    assert '2 messages (losses cannot be counted: ' in recorder.summary()
    recorder.close()


def test_a_run_that_is_taken_away_ends_the_recorder(ros_domain, wait_until, tmp_path):
    run = tmp_path / 'run'
    with NodeProcess(
        tmp_path / 'recorder', MODULE, output_directory=tmp_path, name='run'
    ) as process:
        wait_until(lambda: 'recording' in process.err, what='the recording')
        shutil.rmtree(run)
        wait_until(lambda: process.exit_code is not None, what='the end')
        assert process.exit_code == 2
        assert f'error: {run}/run_0.mcap: No such file or directory' in process.err
        assert 'Traceback' not in process.err


class RobotStream:
    """Publishes poses at 250 Hz from a timer, numbered by their stamps."""

    def __init__(self, cell: Node) -> None:
        self.sent = 0
        profile = QoSProfile(depth=2_000)
        self._publisher = cell.create_publisher(PoseStamped, 'atomizer/pose', profile)
        self._start_s = time.monotonic()
        cell.create_timer(0.004, self._publish)

    def _publish(self) -> None:
        connected = self._publisher.get_subscription_count() > 0
        while connected and self.sent < 250 * (time.monotonic() - self._start_s):
            self.sent += 1
            self._publisher.publish(pose(START_NS + self.sent * 4_000_000))


def test_a_killed_recorder_keeps_what_came_a_moment_before(
    ros_domain, publisher, wait_until, tmp_path
):
    """A hundred poses do not fill a chunk: the recorder closes it by its age."""
    with NodeProcess(
        tmp_path / 'recorder', MODULE, output_directory=tmp_path, name='run', topics='[/pose]'
    ) as process:
        poses = publisher(PoseStamped, '/pose', QoSProfile(depth=100))
        for number in range(100):
            poses.publish(pose(START_NS + number * 4_000_000))

        def on_disk() -> int:
            # One chunk of poses that came within half a second, or several.
            with contextlib.suppress(RecordingError):
                recovery = recover(tmp_path / 'run', tmp_path / f'tried_{next(attempts)}')
                return recovery.message_count
            return 0

        attempts = itertools.count()
        wait_until(lambda: on_disk() == 100, what='all poses on disk')
        process.kill()
    assert not (tmp_path / 'run/metadata.yaml').exists()
    recovery = recover(tmp_path / 'run', tmp_path / 'recovered')
    assert recovery.counts == {'/pose': 100}
    assert len(read_trajectory(tmp_path / 'recovered')) == 100
    with Reader(tmp_path / 'recovered') as reader:
        (connection,) = reader.connections
        assert connection.digest.startswith('RIHS01_')
        assert connection.ext.offered_qos_profiles[0].reliability.name == 'RELIABLE'


@pytest.mark.parametrize('how', ['interrupt_as_launch_does', 'terminate'])
def test_a_recorder_told_to_end_completes_its_run(ros_domain, cell, wait_until, tmp_path, how):
    reports: list[PoseProgress] = []
    RobotStream(cell)
    cell.create_subscription(PoseProgress, 'atomizer/progress', reports.append, qos.PROGRESS)
    with NodeProcess(
        tmp_path / 'recorder', MODULE, output_directory=tmp_path, name='run'
    ) as process:
        wait_until(lambda: reports and reports[-1].poses_received > 50, what='poses recorded')
        getattr(process, how)()
        assert process.wait() == 0
        assert 'file complete: ' in process.err.splitlines()[-1]
        assert 'Traceback' not in process.err
    poses = read_trajectory(tmp_path / 'run')
    assert len(poses) > 50


@pytest.fixture
def small_disk(tmp_path):
    """A file system of one megabyte."""
    folder = tmp_path / 'small_disk'
    folder.mkdir()
    mounted = subprocess.run(
        ['mount', '-t', 'tmpfs', '-o', 'size=1m', 'tmpfs', str(folder)],
        capture_output=True,
        check=False,
    )
    if mounted.returncode != 0:
        pytest.skip('a small file system can be mounted by root alone')
    yield folder
    subprocess.run(['umount', '-l', str(folder)], check=True)


def test_a_full_disk_ends_the_recorder(ros_domain, cell, wait_until, tmp_path, small_disk):
    chatter = cell.create_publisher(String, 'chatter', QoSProfile(depth=100))
    noise = np.random.default_rng(2)
    with NodeProcess(
        tmp_path / 'recorder',
        MODULE,
        output_directory=small_disk,
        name='run',
        topics='[chatter]',
        compression='none',
    ) as process:
        wait_until(lambda: chatter.get_subscription_count() > 0)
        cell.create_timer(
            0.002,
            lambda: chatter.publish(String(data=noise.bytes(5_000).hex())),
        )
        wait_until(lambda: process.exit_code is not None, what='the end')
        assert process.exit_code == 2
        assert 'No space left on device; run `paint recover' in process.err
    assert not (small_disk / 'run/metadata.yaml').exists()
    recovery = recover(small_disk / 'run', tmp_path / 'recovered')
    # A megabyte of messages of 10 kB, less the chunk that did not fit.
    assert 85 <= recovery.message_count <= 105
    shutil.rmtree(small_disk / 'run')
