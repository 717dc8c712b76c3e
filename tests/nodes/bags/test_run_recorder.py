"""Recording over real DDS: what was asked for, byte for byte, and what of it was lost."""

import contextlib
import itertools
import shutil
import threading
import time
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import Part, ThicknessStats
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool, String

import paint_deposition as pd
from files.recorded import START_NS, straight_pass
from nodes.bags import runs
from nodes.cell import FACING_PANEL, parameters
from nodes.processes import recorder_process
from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.nodes import topics
from paint_deposition.nodes.bags import run_recorder
from paint_deposition.nodes.index_planner import IndexPlanner
from paint_deposition.nodes.topics import header, header_stamp_ns, state_message

BEST_EFFORT = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


def test_every_byte_of_a_replay_is_recorded(play, record, wait_until, tmp_path):
    written = straight_pass(900)
    bag = write_pose_bag(tmp_path / 'pass', written)
    recorder = record()
    player = play(bag, rate=0.0, state_topic='/atomizer/state')
    wait_until(player.finished.done, what='the end of the replay')
    information = runs.finish(recorder)
    assert runs.counts(information)['/atomizer/pose'] == 900
    assert runs.counts(information)['/atomizer/state'] == 2
    assert runs.recorded(recorder.run.folder) == runs.recorded(bag)
    again = pd.read_recording(recorder.run.folder, None, '/atomizer/state')
    for name in ('stamps_ns', 'positions_m', 'trigger_stamps_ns', 'trigger_flow'):
        np.testing.assert_array_equal(getattr(again, name), getattr(written, name))


def test_latched_messages_and_changed_parameters_are_recorded(record, start, cell, wait_until):
    """The mesh's statistics came before the recorder; their QoS survives into the bag."""
    planner = start(IndexPlanner)
    (events,) = (p for p in planner.publishers if p.topic_name == '/parameter_events')
    latched = cell.create_publisher(ThicknessStats, 'thickness/stats', topics.LATCHED)
    latched.publish(ThicknessStats(mean_um=41.5))
    recorder = record()
    counts = recorder.run.counts
    wait_until(lambda: counts.get('/thickness/stats', 0) == 1, what='the latched message')
    wait_until(events.get_subscription_count, what='the subscription')
    assert planner.set_parameters(parameters(width_m=0.75))[0].successful
    wait_until(lambda: counts.get('/parameter_events', 0) >= 1, what='the event')
    entries = runs.finish(recorder)['topics_with_message_count']
    told = (entry['topic_metadata'] for entry in entries)
    (profile,) = next(t for t in told if t['name'] == '/thickness/stats')['offered_qos_profiles']
    assert profile['durability'] == 'transient_local'
    assert profile['reliability'] == 'reliable'
    data = dict(runs.messages(recorder.run.folder))['/thickness/stats']
    # Not byte by byte: what pads a message is left as it was in memory.
    assert deserialize_message(data, ThicknessStats) == ThicknessStats(mean_um=41.5)
    with open_bag(recorder.run.folder) as bag:
        (event,) = (event for _, _, event in bag.decoded(['/parameter_events']))
    (change,) = event.changed_parameters
    told = event.node, change.name, change.value.double_value
    assert told == ('/index_planner', 'width_m', 0.75)


def test_a_weaker_publisher_leaves_poses_in_their_order(record, publisher, cell, wait_until):
    """Those that are in the queue come before those that a second subscription hears."""
    recorder = record()
    first = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    first.publish(runs.pose(START_NS))
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose', 0) == 1, what='the first pose')
    for k in range(1, 200):
        first.publish(runs.pose(START_NS + k))
    weak = cell.create_publisher(PoseStamped, 'atomizer/pose', BEST_EFFORT)
    until_s = time.monotonic() + 30.0
    while weak.get_subscription_count() == 0 and time.monotonic() < until_s:
        recorder.recorded['/atomizer/pose'].match_qos()
    for k in range(200, 300):
        first.publish(runs.pose(START_NS + k))
    wait_until(lambda: recorder.run.counts['/atomizer/pose'] == 300, what='all poses')
    # Those that are in the queue at the end are recorded, too.
    for k in range(300, 800):
        first.publish(runs.pose(START_NS + k))
    first.wait_for_all_acked()
    recorder.close()
    stamps = [header_stamp_ns(cdr) for cdr in runs.recorded(recorder.run.folder)]
    assert stamps == [START_NS + k for k in range(800)]


def test_named_topics_are_recorded_and_no_others(record, publisher, wait_until, cell, tmp_path):
    """With what the run was made with."""
    mesh, model = tmp_path / 'door.stl', tmp_path / 'model.yaml'
    mesh.write_bytes(b'solid door')
    model.write_text('planar: {K1_cm3_per_s: 1.9}\n')
    wanted = ['chatter', '/cell/gun', 'never']
    recorder = record(topics=wanted, mesh_file=str(mesh), model_file=str(model))
    chatter = publisher(String, 'chatter', topics.RESULTS)
    gun = publisher(Bool, '/cell/gun', topics.RESULTS)
    other = cell.create_publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    other.publish(runs.pose(START_NS))
    chatter.publish(String(data='hello'))
    gun.publish(Bool(data=True))
    wait_until(lambda: recorder.run.message_count == 2, what='both messages')
    information = runs.finish(recorder)
    assert runs.counts(information) == {'/chatter': 1, '/cell/gun': 1}
    notes = information['custom_data']
    assert notes['mesh_file'] == str(mesh)
    assert len(notes['mesh_sha256']) == 64
    assert notes['model_yaml'] == 'planar: {K1_cm3_per_s: 1.9}\n'


@pytest.mark.parametrize('are_lost', [False, True])
def test_poses_that_come_late_are_in_the_run_for_which_they_were_sent(
    record, robot, onlooker, wait_until, still, tmp_path, monkeypatch, are_lost
):
    """One comes before its part, others from a full queue or with the heartbeat 3 s later."""
    if not are_lost:
        monkeypatch.setattr(run_recorder, 'LATE_S', 2.0)
    recorder, place = record(), (np.zeros(3), FACING_PANEL)
    parts, source = onlooker().create_publisher(Part, 'part', topics.LATCHED), robot(recorder)
    source.send_pose(START_NS, *place)
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose'), what='the first pose')
    until_ns = time.time_ns() + (5_000_000_000 if are_lost else 300_000_000)
    at = header('part', START_NS + 9)
    carried = [state_message(header=header('', START_NS + 5), spraying=True, flow=0.5)]
    sent = {'last_sent_ns': until_ns, 'states_sent_ns': [until_ns]}
    parts.publish(Part(run='1', header=at, guns=[''], states=carried, **sent))
    wait_until(lambda: recorder.run.folder.name == '1', what='the run')
    if are_lost:
        still(3.0)
    for k in range(1, 10):
        source.send_pose(START_NS + k, *place)
    source.send_state(START_NS + 5, 0.5)
    if not are_lost:
        threading.Event().wait(2.1)  # nothing runs meanwhile
    wait_until(lambda: recorder.run_before.counts.get('/atomizer/pose') == 10, what='late ones')
    wait_until(lambda: time.time_ns() > until_ns)
    source.send_pose(START_NS + 10, *place)
    source.send_state(START_NS + 10, 0.5)
    ended = (tmp_path / 'run/metadata.yaml').is_file
    wait_until(ended, what='the end of the first run', timeout_s=5.0)
    source.send_pose(START_NS + 11, *place)
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose') == 2, what='its own')
    recorder.close()
    for run, poses, flows in (('run', range(10), [0.5]), ('1', range(10, 12), [0.5, 0.5])):
        motion = pd.read_recording(tmp_path / run, state_topic='/atomizer/state')
        assert motion.stamps_ns.tolist() == [START_NS + k for k in poses]
        assert motion.trigger_flow.tolist() == flows


def test_gaps_and_missed_messages_are_reported(record, publisher, onlooker, wait_until):
    recorder = record(topics=['atomizer/pose'], max_pose_gap_s=0.1)
    viewer = onlooker()
    poses = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    stamps_ns = START_NS + np.array([0, 4, 8, 508, 512, 612, 613]) * 1_000_000
    for stamp in stamps_ns.tolist():
        poses.publish(runs.pose(stamp))

    losses = '0 missed' if runs.NUMBERED else 'losses cannot be counted'
    task = 'run_recorder: recording'
    # 500 ms is a gap, 100 ms is just none.
    told = f'7 messages, {losses}, 1 gaps'
    wait_until(lambda: viewer.value(task, '/atomizer/pose') == told, what='the diagnostics')
    assert all(int(viewer.value(task, key)) > 0 for key in ('bytes', 'disk free bytes'))
    recorder.close()
    words = f'7 messages{"" if runs.NUMBERED else runs.UNCOUNTED}, 1 gaps'
    assert recorder.summary() == f'{words}, file complete: {recorder.run.folder}'


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
    missed = f', {lost} missed' if runs.NUMBERED else runs.UNCOUNTED
    assert f'{recorder.run.message_count} messages{missed}' in recorder.summary()


@pytest.mark.skipif(not runs.NUMBERED, reason='this middleware does not number messages')
def test_what_is_sent_before_its_publisher_is_heard_is_counted(record, cell, wait_until):
    """Of one robot that starts after the recorder, and of one that has long been sending."""
    sent = Counter()

    def start(gun: str) -> Callable[[], None]:
        best_effort = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        robot = cell.create_publisher(PoseStamped, f'{gun}/atomizer/pose', best_effort)

        def send() -> None:
            robot.publish(runs.pose(START_NS + sent[gun]))
            sent[gun] += 1

        cell.create_timer(0.005, send)
        return send

    start('old')
    wait_until(lambda: sent['old'] >= 300, what='poses that no recorder was there for')
    recorder = record(atomizers=['old', 'new'])
    sent_before, counts = sent['old'], recorder.run.counts
    wait_until(lambda: counts.get('/old/atomizer/pose', 0) >= 60, what='poses of the first')
    send = start('new')
    for _ in range(20):
        send()
    wait_until(lambda: counts.get('/new/atomizer/pose', 0) >= 60, what='poses of both')
    recorder.close()
    before_discovery = sent['new'] - counts['/new/atomizer/pose']
    assert before_discovery >= 20
    assert recorder.recorded['/new/atomizer/pose'].losses == (
        f'0 missed, {before_discovery} sent before the recorder heard their publisher'
    )
    of_old = recorder.recorded['/old/atomizer/pose'].before_discovery.total()
    assert 0 < of_old < sent_before, 'by its rate, those since the recording began'
    assert f'{before_discovery} of /new/atomizer/pose sent before the' in recorder.summary()


def test_a_run_that_is_taken_away_ends_the_recorder(ros_domain, wait_until, tmp_path):
    run = tmp_path / 'run'
    with recorder_process(tmp_path) as process:
        wait_until(lambda: 'recording' in process.err, what='the recording')
        shutil.rmtree(run)
        assert process.wait() == 2
        assert f'error: {run}/run_0.mcap: No such file or directory' in process.err
        assert 'Traceback' not in process.err


def test_a_killed_recorder_keeps_what_came_before(ros_domain, publisher, wait_until, tmp_path):
    """A hundred poses do not fill a chunk: the recorder closes it by its age."""
    with recorder_process(tmp_path, topics='[/pose]') as process:
        poses = publisher(PoseStamped, '/pose', QoSProfile(depth=100))
        for number in range(100):
            poses.publish(runs.pose(START_NS + number * 4_000_000))

        attempts = (tmp_path / f'tried_{number}' for number in itertools.count())

        def are_on_disk() -> bool:
            # In one chunk of poses that came within half a second, or several.
            with contextlib.suppress(RecordingError):
                return recover(tmp_path / 'run', next(attempts))[0].message_count == 100

        wait_until(are_on_disk, what='all poses on disk')
        process.kill()
    assert not (tmp_path / 'run/metadata.yaml').exists()
    recovery, _ = recover(tmp_path / 'run', tmp_path / 'recovered')
    assert recovery.counts == {'/pose': 100}
    assert len(read_recording(tmp_path / 'recovered')) == 100
