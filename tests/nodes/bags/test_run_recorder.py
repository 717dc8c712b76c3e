"""Recording over real DDS: byte for byte, what was asked for, and with what."""

import threading
import time

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import Part, ThicknessStats
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool, String

import paint_deposition as pd
from files.recorded import START_NS, straight_pass
from nodes.bags.runs import counts, finish, messages, offered, pose
from nodes.cell import FACING_PANEL, Robot, parameters
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.pose_stream import TriggerChange
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
    information = finish(recorder)
    assert counts(information)['/atomizer/pose'] == 900
    assert counts(information)['/atomizer/state'] == 2
    assert [m for m in messages(recorder.run.folder) if m[0] == '/atomizer/pose'] == [
        m for m in messages(bag) if m[0] == '/atomizer/pose'
    ]
    again = pd.read_recording(recorder.run.folder, None, '/atomizer/state')
    for name in ('stamps_ns', 'positions_m', 'trigger_stamps_ns', 'trigger_flow'):
        np.testing.assert_array_equal(getattr(again, name), getattr(written, name))


def test_latched_messages_are_recorded_as_latched(record, cell, wait_until):
    """The mesh's statistics came before the recorder; their QoS survives into the bag."""
    latched = cell.create_publisher(ThicknessStats, 'thickness/stats', topics.LATCHED)
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


def test_a_weaker_publisher_leaves_poses_in_their_order(record, publisher, cell, wait_until):
    """Those that are in the queue come before those that a second subscription hears."""
    recorder = record()
    first = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    first.publish(pose(START_NS))
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose', 0) == 1, what='the first pose')
    for k in range(1, 200):
        first.publish(pose(START_NS + k))
    weak = cell.create_publisher(PoseStamped, 'atomizer/pose', BEST_EFFORT)
    until_s = time.monotonic() + 30.0
    while weak.get_subscription_count() == 0 and time.monotonic() < until_s:
        recorder.recorded['/atomizer/pose'].match_qos()
    for k in range(200, 300):
        first.publish(pose(START_NS + k))
    wait_until(lambda: recorder.run.counts['/atomizer/pose'] == 300, what='all poses')
    # Those that are in the queue at the end are recorded, too.
    for k in range(300, 800):
        first.publish(pose(START_NS + k))
    first.wait_for_all_acked()
    recorder.close()
    stamps = [header_stamp_ns(cdr) for t, cdr in messages(recorder.run.folder) if 'pose' in t]
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
    other.publish(pose(START_NS))
    chatter.publish(String(data='hello'))
    gun.publish(Bool(data=True))
    wait_until(lambda: recorder.run.message_count == 2, what='both messages')
    information = finish(recorder)
    assert counts(information) == {'/chatter': 1, '/cell/gun': 1}
    notes = information['custom_data']
    assert notes['mesh_file'] == str(mesh)
    assert len(notes['mesh_sha256']) == 64
    assert notes['model_yaml'] == 'planar: {K1_cm3_per_s: 1.9}\n'


def test_a_model_changed_meanwhile_is_in_the_recording(record, start, wait_until):
    planner = start(IndexPlanner)
    recorder = record()
    events = [p for p in planner.publishers if p.topic_name == '/parameter_events']
    wait_until(
        lambda: all(p.get_subscription_count() > 0 for p in events), what='the subscription'
    )
    (result,) = planner.set_parameters(parameters(width_m=0.75))
    assert result.successful
    wait_until(lambda: recorder.run.counts.get('/parameter_events', 0) >= 1, what='the event')
    finish(recorder)
    with open_bag(recorder.run.folder) as bag:
        (event,) = (event for _, _, event in bag.decoded(['/parameter_events']))
    assert event.node == '/index_planner'
    (change,) = event.changed_parameters
    assert (change.name, change.value.double_value) == ('width_m', 0.75)


def test_bad_input_is_reported_at_the_start(record):
    for values, says in (
        ({'mesh_file': '/nowhere.stl'}, 'mesh_file /nowhere.stl: No such file or directory'),
        ({'output_directory': '/dev/null/runs'}, 'cannot create /dev/null/runs/run'),
    ):
        with pytest.raises(pd.PaintError, match=says):
            record(**values)


@pytest.mark.parametrize('are_lost', [False, True])
def test_poses_that_come_late_are_in_the_run_for_which_they_were_sent(
    record, ros_context, spin, onlooker, wait_until, still, tmp_path, monkeypatch, are_lost
):
    """One comes before its part is announced, others after the next part is.

    They count that are in the queue of a recorder which was stopped for longer than it waits, and
    those that were lost on the way and come with the next heartbeat, three seconds later. The run
    ends once it has what was sent for it.
    """
    if not are_lost:
        monkeypatch.setattr(run_recorder, 'LATE_S', 2.0)
    recorder, robot, place = record(), Robot(ros_context), (np.zeros(3), FACING_PANEL)
    spin(robot)
    parts = onlooker().create_publisher(Part, 'part', topics.LATCHED)
    wait_until(lambda: robot.has_subscribers(1), what='the recorder')
    robot.send_pose(START_NS, *place)
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose'), what='the first pose')
    until_ns = time.time_ns() + (5_000_000_000 if are_lost else 300_000_000)
    at = header('part', START_NS + 9)
    carried = [state_message('', TriggerChange(START_NS + 5, 0.5))]
    parts.publish(Part(
        run='1', header=at, last_sent_ns=until_ns, guns=[''],
        states_sent_ns=[until_ns], states=carried,
    ))  # fmt: skip
    wait_until(lambda: recorder.run.folder.name == '1', what='the run')
    if are_lost:
        still(3.0)
    for k in range(1, 10):
        robot.send_pose(START_NS + k, *place)
    robot.send_state(START_NS + 5, 0.5)
    if not are_lost:
        threading.Event().wait(2.1)  # nothing runs meanwhile
    wait_until(lambda: recorder.leaving.counts.get('/atomizer/pose') == 10, what='late ones')
    wait_until(lambda: time.time_ns() > until_ns)
    robot.send_pose(START_NS + 10, *place)
    robot.send_state(START_NS + 10, 0.5)
    ended = (tmp_path / 'run/metadata.yaml').is_file
    wait_until(ended, what='the end of the first run', timeout_s=5.0)
    robot.send_pose(START_NS + 11, *place)
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose') == 2, what='its own')
    recorder.close()
    for run, poses, flows in (('run', range(10), [0.5]), ('1', range(10, 12), [0.5, 0.5])):
        motion = pd.read_recording(tmp_path / run, state_topic='/atomizer/state')
        assert motion.stamps_ns.tolist() == [START_NS + k for k in poses]
        assert motion.trigger_flow.tolist() == flows
