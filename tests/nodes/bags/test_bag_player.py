"""Replay over real DDS: the recorded bytes in the recorded order and their time, at any speed."""

import threading
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from std_srvs.srv import Trigger

from files.recorded import START_NS, STATE_TYPES, Messages, pose_entries, straight_pass, write_bag
from nodes.bags.runs import recorded
from nodes.processes import NodeProcess
from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.nodes.bags.pace import LOST_TIMEOUT_S, Pace
from robot_arm import JOINTS, URDF, sweep


@pytest.mark.parametrize('rate', [0.0, 20.0])
def test_the_recorded_bytes_arrive_in_order(play, listen, wait_until, onlooker, pass_bag, rate):
    """Nothing is sent before somebody listens; without its clock a player publishes none."""
    viewer = onlooker()
    player = play(pass_bag, rate=rate, state_topic='/atomizer/state', publish_clock=False)
    wait_until(lambda: viewer.reports('bag_player: replay', 'waiting for 1 subscribers'))
    assert player.poses_published == 0
    assert not player.count_publishers('/clock')
    listener = listen()
    wait_until(player.finished.done, what='the end of the replay')
    wait_until(lambda: len(listener.poses) == 700, what='the last poses')
    assert listener.poses == recorded(pass_bag)
    written = straight_pass(700)
    assert [stamp_ns(s.header) for s in listener.states] == written.trigger_stamps_ns.tolist()
    assert [(s.spraying, s.flow) for s in listener.states] == [(True, 1.0), (False, 0.0)]
    assert np.isnan(listener.states[0].voltage_kv)
    assert (player.poses_published, player.states_published) == (700, 2)


@pytest.fixture
def replayed(play, listen, wait_until):
    """`replayed(bag, **parameters)`: who has heard all of a replay without pauses."""

    def replayed(bag, **chosen):
        listener = listen()
        wait_until(play(bag, rate=0.0, **chosen).finished.done, what='the end of the replay')
        return listener

    return replayed


def test_a_ros1_bag_is_replayed_as_ros2_messages(replayed, tmp_path):
    written = straight_pass(40, triggers=False)
    bag = write_bag(tmp_path / 'old.bag', pose_entries(written, ros1=True), 'ros1')
    poses = [deserialize_message(cdr, PoseStamped) for cdr in replayed(bag).poses]
    assert [stamp_ns(pose.header) for pose in poses] == written.stamps_ns.tolist()
    assert [pose.pose.position.x for pose in poses] == written.positions_m[:, 0].tolist()
    assert {pose.header.frame_id for pose in poses} == {'door'}


@pytest.mark.parametrize('kind', ['tf', 'urdf'])
def test_a_bag_without_poses_is_replayed(kind, play, replayed, tmp_path):
    """From transforms or joint states of a robot, with the trigger, as `paint simulate` does."""
    messages, entries = Messages(), []
    stamps_ns = START_NS + 20_000_000 * np.arange(40)
    for stamp, joints in zip(stamps_ns.tolist(), sweep(40), strict=True):
        if kind == 'urdf':
            moved = '/joint_states', stamp + 100, messages.joints(stamp, JOINTS, joints)
        else:
            pose = [joints[0], 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]
            moved = '/tf', stamp + 100, messages.transforms((stamp, 'base', 'tool0', pose))
        entries.append(moved)
    entries.insert(20, ('/gun', int(stamps_ns[20]), messages.trigger(True)))
    bag = write_bag(tmp_path / 'run', entries, messages=messages)
    remedy = 'give tf: TARGET SOURCE' if kind == 'tf' else 'give urdf'
    with pytest.raises(RecordingError, match=remedy):
        play(bag)
    given = {'tf': ['base', 'tool0']} if kind == 'tf' else {'urdf': str(URDF)}
    listener = replayed(bag, state_topic='/gun', **given)
    poses = [deserialize_message(cdr, PoseStamped) for cdr in listener.poses]
    offline = read_recording(bag, state_topic='/gun', **given)
    assert [stamp_ns(pose.header) for pose in poses] == offline.stamps_ns.tolist()
    places = [(p.x, p.y, p.z) for p in (pose.pose.position for pose in poses)]
    np.testing.assert_array_equal(places, offline.positions_m)
    assert {pose.header.frame_id for pose in poses} == {offline.frame_id}
    assert [stamp_ns(s.header) for s in listener.states] == offline.trigger_stamps_ns.tolist()


def test_states_of_another_version_keep_what_they_say(replayed, tmp_path):
    """The bag's own definition lacks the voltage; the message of today has it."""
    (kind,) = STATE_TYPES
    messages = Messages(state_types={kind: STATE_TYPES[kind].replace('float64 voltage_kv\n', '')})
    header = messages.header(START_NS - 9)
    state = messages.store.types[kind](header, True, 0.7, 250.0, 4e4)
    entries = pose_entries(straight_pass(20, triggers=False))
    entries.insert(0, ('/state', START_NS - 5, state))
    bag = write_bag(tmp_path / 'older', entries, messages=messages)
    (taken,) = replayed(bag, state_topic='state').states
    assert stamp_ns(taken.header) == START_NS - 9
    assert (taken.spraying, taken.flow, taken.shaping_air_l_per_min) == (True, 0.7, 250.0)
    assert np.isnan(taken.voltage_kv)
    assert taken.brush == 0


def test_a_loop_starts_over(play, listen, wait_until, tmp_path):
    bag = write_pose_bag(tmp_path / 'short', straight_pass(30, triggers=False))
    listener = listen()
    player = play(bag, rate=0.0, loop=True)
    wait_until(lambda: len(listener.poses) >= 100, what='the fourth round')
    assert listener.poses[:90] == 3 * recorded(bag)
    assert not player.finished.done()


def test_a_trigger_without_stamps_by_another_clock_is_refused(play, tmp_path):
    entries = pose_entries(straight_pass(20, triggers=False), delay_ns=10**10)
    entries.insert(0, ('/gun', START_NS + 10**10, Messages().trigger(True)))
    with pytest.raises(RecordingError, match='10 s off its own stamps'):
        play(write_bag(tmp_path / 'other_clock', entries), state_topic='/gun')


def test_the_player_stays_within_its_window(play, listen, wait_until, pass_bag):
    """A subscriber that takes poses and never says so gets a window of them, and no more."""
    listener = listen(reports=False)  # it has the publisher, and is silent
    player = play(pass_bag, rate=0.0, window=60)
    wait_until(lambda: len(listener.poses) == 60, what='a window of poses')
    assert player.poses_published == 60
    listener.report()
    wait_until(lambda: player.poses_published == 120, what='the next window')
    while not player.finished.done():
        taken = len(listener.poses)
        listener.report()
        wait_until(lambda n=taken: len(listener.poses) > n or player.finished.done())
    assert listener.poses == recorded(pass_bag)


def test_an_interrupt_ends_a_waiting_player(ros_domain, wait_until, pass_bag, tmp_path):
    with NodeProcess(tmp_path / 'player', 'bag_player', bag=pass_bag) as process:
        wait_until(lambda: 'waiting for 1 subscribers' in process.err)
        process.interrupt_as_launch_does()
        assert process.wait() == 0
        assert 'replayed 0 poses, 0 states' in process.err
        assert 'Traceback' not in process.err


def test_a_bag_that_breaks_off_later_ends_the_process(ros_domain, listen, wait_until, tmp_path):
    bag = write_pose_bag(tmp_path / 'pass', straight_pass(4_000))
    path = bag / 'pass_0.mcap'
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    listen()
    with NodeProcess(tmp_path / 'player', 'bag_player', bag=bag, rate='0.0') as process:
        wait_until(lambda: process.poll() is not None, what='the end')
        assert process.returncode == 2, process.err
        assert f'run: paint recover {bag}' in process.err


def ticks(viewer) -> list[int]:
    """The times [ns] on /clock."""
    return [Time.from_msg(message.clock).nanoseconds for message in viewer.all('/clock')]


def test_the_clock_runs_on_through_a_gap(play, listen, onlooker, wait_until, tmp_path):
    written = straight_pass(60, triggers=False)
    stamps_ns = written.stamps_ns.copy()
    stamps_ns[30:] += 2 * 10**9
    bag = write_pose_bag(tmp_path / 'pass', replace(written, stamps_ns=stamps_ns))
    viewer = onlooker('/clock')
    listen()
    player = play(bag, rate=2.0)
    wait_until(player.finished.done, what='the end of the replay')
    bag_ns = np.array(ticks(viewer))
    assert (np.diff(bag_ns) >= 0).all()
    assert bag_ns[0] == stamps_ns[0]
    assert bag_ns[-1] >= stamps_ns[-1]
    in_gap = (bag_ns > stamps_ns[29]) & (bag_ns < stamps_ns[30])
    assert len(np.unique(bag_ns[in_gap])) > 2


@pytest.mark.parametrize('rate', [1.0, 0.0])
def test_the_clock_stands_meanwhile(play, listen, onlooker, call, wait_until, pass_bag, rate):
    """Before the start and while paused, also for who comes late; no pose is lost by that."""

    def watch():
        viewer = onlooker('/clock')
        wait_until(lambda: len(viewer.heard['/clock']) > 5, what='the clock')
        return viewer

    player = play(pass_bag, rate=rate, window=50, start_paused=True)
    viewer = watch()
    tell = partial(call, viewer, Trigger)
    assert [tell('bag_player/resume').message for _ in range(2)] == ['resumed', 'not paused']
    early = ticks(viewer) + ticks(watch())
    assert player.poses_published == 0
    assert set(early) == {straight_pass(700).stamps_ns[0]}
    listener = listen(reports=None if rate else False)
    wait_until(lambda: player.poses_published >= 20, what='poses')
    for message in ('paused', 'already paused'):
        answer = tell('bag_player/pause')
        assert (answer.success, answer.message) == (True, message)
    paused_at = player.poses_published
    (paused_ns,) = set(ticks(watch()))
    wait_until(lambda: viewer.reports('bag_player: replay', 'paused'))
    assert player.poses_published - paused_at <= 1
    assert tell('bag_player/resume').success
    if rate:
        wait_until(lambda: len(listener.poses) > paused_at + 20, what='more poses')
        assert listener.poses == recorded(pass_bag)[: len(listener.poses)]
        wait_until(lambda: ticks(viewer)[-1] > paused_ns + 10**8, what='the time of the replay')
        assert ticks(viewer) == sorted(ticks(viewer))


@pytest.fixture
def pace(cell):
    """That of a publisher of poses."""
    publisher = cell.create_publisher(PoseStamped, 'atomizer/pose', 10)
    return Pace(cell, publisher, threading.Event(), rate=0.0, window=200, running=True)


def published(pace: Pace, stamps, now_s: float = 0.0) -> None:
    for stamp in stamps:
        pace.add_sent(stamp, now_s)


def test_lost_poses_are_not_waited_for_while_reports_arrive(pace):
    pace.set_subscribers(['simulator'], 0.0)
    published(pace, range(10))
    now_s = 0.0
    while now_s < LOST_TIMEOUT_S:
        pace.report('simulator', 6, now_s)
        assert pace.write_off_lost(now_s) == {'simulator': 3}
        now_s += 0.2
    pace.report('simulator', 6, now_s + 0.2)
    assert pace.write_off_lost(now_s + 0.2) == {}
    assert pace.subscribers['simulator'].lost == 3


def test_only_present_subscribers_are_waited_for(pace):
    pace.set_subscribers(['doomed', 'survivor'], 0.0)
    published(pace, range(10))
    pace.report('survivor', 9, 0.0)
    assert pace.write_off_lost(0.0) == {'doomed': 10}
    pace.set_subscribers(['late', 'survivor'], 0.0)
    assert pace.write_off_lost(0.0) == {}
    published(pace, range(10, 15))
    pace.report('survivor', 14, 0.0)
    assert pace.write_off_lost(0.0) == {'late': 5}
