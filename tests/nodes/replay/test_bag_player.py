"""Replay over real DDS: the recorded bytes in the recorded order, whatever the speed."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState, PoseProgress
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from files.recorded import (
    START_NS,
    STATE_TYPES,
    Messages,
    pose_entries,
    straight_pass,
    write_bag,
)
from nodes.processes import NodeProcess
from paint_deposition.errors import PaintError, RecordingError
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.files.recordings.triggers import stamp_ns
from paint_deposition.nodes.replay.bag_player import BagPlayer
from paint_deposition.nodes.runtime import qos


@pytest.fixture
def play(ros_context, spin):
    """`play(bag, **parameters)`: a player of this bag, running."""

    def play(bag, namespace='', **parameters) -> BagPlayer:
        values = {'bag': str(bag)} | parameters
        player = BagPlayer(
            context=ros_context,
            namespace=namespace,
            parameter_overrides=[Parameter(name, value=value) for name, value in values.items()],
        )
        spin(player)
        return player

    return play


class Listener(Node):
    """Takes poses and states as they come, as bytes, and may report progress."""

    def __init__(self, context, name='listener', reports=False, namespace=''):
        super().__init__(name, context=context, namespace=namespace)
        self.poses: list[bytes] = []
        self.states: list[AtomizerState] = []
        self.order: list[str] = []
        self.reports = reports
        self.create_subscription(
            PoseStamped, 'atomizer/pose', self.take_pose, QoSProfile(depth=5_000), raw=True
        )
        self.create_subscription(
            AtomizerState, 'atomizer/state', self.take_state, QoSProfile(depth=5_000)
        )
        self.publisher = (
            self.create_publisher(PoseProgress, 'atomizer/progress', qos.PROGRESS)
            if reports is not None
            else None
        )
        if reports:
            self.create_timer(0.05, self.report)

    def take_pose(self, cdr: bytes) -> None:
        self.poses.append(cdr)
        self.order.append('pose')

    def take_state(self, state: AtomizerState) -> None:
        self.states.append(state)
        self.order.append('state')

    def report(self) -> None:
        reporter = self.get_fully_qualified_name()
        progress = PoseProgress(reporter=reporter, poses_received=len(self.poses))
        if self.poses:
            progress.header = deserialize_message(self.poses[-1], PoseStamped).header
        self.publisher.publish(progress)


@pytest.fixture
def listen(ros_context, spin):
    def listen(name='listener', reports=True, namespace='') -> Listener:
        listener = Listener(ros_context, name, reports, namespace)
        spin(listener)
        return listener

    return listen


@pytest.fixture
def pass_bag(tmp_path):
    return write_pose_bag(tmp_path / 'pass', straight_pass(700))


@pytest.fixture
def still(wait_until):
    """`still(duration_s)`: let so much time pass, in which nothing more should happen."""

    def still(duration_s: float) -> None:
        end_s = time.monotonic() + duration_s
        wait_until(lambda: time.monotonic() > end_s, what='the time')

    return still


def recorded(bag, topic='/atomizer/pose') -> list[bytes]:
    with open_bag(bag) as opened:
        return [message.cdr for message in opened.messages([topic])]


@pytest.mark.parametrize('rate', [0.0, 20.0])
def test_the_recorded_bytes_arrive_in_order(play, listen, wait_until, pass_bag, rate):
    listener = listen()
    player = play(pass_bag, rate=rate, state_topic='/atomizer/state')
    wait_until(player.finished.done, what='the end of the replay')
    wait_until(lambda: len(listener.poses) == 700, what='the last poses')
    assert listener.poses == recorded(pass_bag)
    written = straight_pass(700)
    assert [stamp_ns(s.header) for s in listener.states] == written.trigger_stamps_ns.tolist()
    assert [(s.spraying, s.flow) for s in listener.states] == [(True, 1.0), (False, 0.0)]
    assert np.isnan(listener.states[0].voltage_kv)
    assert (player.poses_published, player.states_published) == (700, 2)


def test_a_ros1_bag_is_replayed_as_ros2_messages(play, listen, wait_until, tmp_path):
    written = straight_pass(40, triggers=False)
    bag = write_bag(tmp_path / 'old.bag', pose_entries(written, ros1=True), 'ros1')
    listener = listen()
    player = play(bag, rate=0.0)
    wait_until(player.finished.done, what='the end of the replay')
    poses = [deserialize_message(cdr, PoseStamped) for cdr in listener.poses]
    assert [stamp_ns(pose.header) for pose in poses] == written.stamps_ns.tolist()
    assert [pose.pose.position.x for pose in poses] == written.positions_m[:, 0].tolist()
    assert {pose.header.frame_id for pose in poses} == {'door'}


def test_states_of_another_version_keep_what_they_say(play, listen, wait_until, tmp_path):
    """The bag's own definition lacks the voltage; the message of today has it."""
    (kind,) = STATE_TYPES
    messages = Messages(state_types={kind: STATE_TYPES[kind].replace('float64 voltage_kv\n', '')})
    header = messages.header(START_NS - 9)
    state = messages.store.types[kind](header, True, 0.7, 250.0, 4e4)
    entries = pose_entries(straight_pass(20, triggers=False))
    entries.insert(0, ('/state', START_NS - 5, state))
    bag = write_bag(tmp_path / 'older', entries, messages=messages)
    listener = listen()
    player = play(bag, rate=0.0, state_topic='state')
    wait_until(player.finished.done, what='the end of the replay')
    (taken,) = listener.states
    assert stamp_ns(taken.header) == START_NS - 9
    assert (taken.spraying, taken.flow, taken.shaping_air_l_per_min) == (True, 0.7, 250.0)
    assert np.isnan(taken.voltage_kv)
    assert taken.brush == 0


def test_the_player_stays_within_its_window(play, listen, wait_until, still, pass_bag):
    """A subscriber that takes poses and never says so gets a window of them, and no more."""
    listener = listen(reports=False)  # it has the publisher, and is silent
    player = play(pass_bag, rate=0.0, window=60)
    wait_until(lambda: player.poses_published == 60, what='a window of poses')
    still(0.5)
    assert player.poses_published == 60
    wait_until(lambda: len(listener.poses) == 60, what='the poses')
    listener.report()
    wait_until(lambda: player.poses_published == 120, what='the next window')
    while not player.finished.done():
        taken = len(listener.poses)
        listener.report()
        wait_until(
            lambda taken=taken: len(listener.poses) > taken or player.finished.done(),
            what='more poses',
        )
    assert listener.poses == recorded(pass_bag)


def test_the_slowest_of_two_sets_the_pace(play, listen, wait_until, still, pass_bag):
    listen('quick', reports=True)
    slow = listen('slow', reports=False)
    player = play(pass_bag, rate=0.0, window=50, wait_for_subscribers=2)
    wait_until(lambda: player.poses_published == 50, what='a window of poses')
    still(0.3)
    assert player.poses_published == 50
    slow.create_timer(0.02, slow.report)
    wait_until(player.finished.done, what='the end of the replay')
    assert len(slow.poses) == 700


def test_a_node_that_dies_does_not_hold_the_replay(
    ros_context, play, listen, wait_until, pass_bag
):
    survivor = listen('survivor', reports=True)
    doomed = Listener(ros_context, 'doomed', reports=False)
    executor = SingleThreadedExecutor(context=ros_context)
    executor.add_node(doomed)
    player = play(pass_bag, rate=0.0, window=50, wait_for_subscribers=2)
    wait_until(lambda: player.poses_published == 50, what='a window of poses')
    executor.shutdown()
    doomed.destroy_node()
    wait_until(player.finished.done, what='the end of the replay')
    assert len(survivor.poses) == 700


def test_who_joins_late_is_waited_for(play, listen, call, wait_until, still, tmp_path):
    bag = write_pose_bag(tmp_path / 'long', straight_pass(20_000, triggers=False))
    early = listen('early', reports=None)
    player = play(bag, rate=0.0, window=50)
    wait_until(lambda: player.poses_published > 100, what='the replay')
    assert call(early, Trigger, 'bag_player/pause', Trigger.Request()).success
    late = listen('late', reports=False)
    wait_until(
        lambda: (
            player.count_publishers('atomizer/progress') == 1
            and player.count_subscribers('atomizer/pose') == 2
        ),
        what='discovery',
    )
    assert call(early, Trigger, 'bag_player/resume', Trigger.Request()).success
    wait_until(lambda: late.poses, what='poses')
    taken = -1
    while taken != len(late.poses):
        taken = len(late.poses)
        still(0.5)
    assert player.poses_published < 20_000
    late.create_timer(0.01, late.report)
    wait_until(player.finished.done, what='the end of the replay')
    everything = recorded(bag)
    assert late.poses == everything[-len(late.poses) :]


def test_a_bool_of_another_clock_is_refused(play, tmp_path):
    entries = pose_entries(straight_pass(20, triggers=False), delay_ns=10**10)
    entries.insert(0, ('/gun', START_NS + 10**10, Messages().trigger(True)))
    bag = write_bag(tmp_path / 'other_clock', entries)
    with pytest.raises(RecordingError, match='10 s off its own stamps'):
        play(bag, state_topic='/gun')


def test_who_does_not_report_is_not_waited_for(play, listen, wait_until, pass_bag):
    listener = listen(reports=None)
    player = play(pass_bag, rate=0.0, window=50)
    wait_until(player.finished.done, what='the end of the replay')
    wait_until(lambda: len(listener.poses) == 700, what='all poses')


def test_nothing_is_sent_before_somebody_listens(play, listen, wait_until, still, pass_bag):
    player = play(pass_bag, rate=0.0)
    still(0.5)
    assert player.poses_published == 0
    listener = listen()
    wait_until(player.finished.done, what='the end of the replay')
    assert listener.poses == recorded(pass_bag)


def test_real_time_takes_the_recorded_time(play, listen, wait_until, tmp_path):
    written = straight_pass(120, triggers=False)
    bag = write_pose_bag(tmp_path / 'pass', written)
    listener = listen()
    player = play(bag, rate=2.0)
    wait_until(lambda: listener.poses, what='the first pose')
    started = time.monotonic()
    wait_until(lambda: len(listener.poses) == 120, what='the last pose')
    # A busy machine takes longer; for the pace itself see the replay's clock.
    assert time.monotonic() - started > written.duration_s / 2.0 - 0.1
    wait_until(player.finished.done, what='the end of the replay')


@pytest.fixture
def clock_ticks(ros_context, spin):
    """`clock_ticks()`: a list that fills with the times [ns] on /clock."""

    def clock_ticks(name='clock_watch') -> list[int]:
        node = Node(name, context=ros_context)
        ticks = []
        node.create_subscription(
            Clock,
            '/clock',
            lambda message: ticks.append(Time.from_msg(message.clock).nanoseconds),
            qos.CLOCK,
        )
        spin(node)
        return ticks

    return clock_ticks


def test_the_clock_runs_on_through_a_gap(play, listen, clock_ticks, wait_until, tmp_path):
    written = straight_pass(60, triggers=False)
    stamps_ns = written.stamps_ns.copy()
    stamps_ns[30:] += 2 * 10**9
    bag = write_pose_bag(tmp_path / 'pass', replace(written, stamps_ns=stamps_ns))
    ticks = clock_ticks()
    listen()
    player = play(bag, rate=2.0)
    wait_until(player.finished.done, what='the end of the replay')
    bag_ns = np.array(ticks)
    assert (np.diff(bag_ns) >= 0).all()
    assert bag_ns[0] == stamps_ns[0]
    assert bag_ns[-1] >= stamps_ns[-1]
    in_gap = (bag_ns > stamps_ns[29]) & (bag_ns < stamps_ns[30])
    assert len(np.unique(bag_ns[in_gap])) > 2


def test_the_clock_stands_before_the_start(play, listen, clock_ticks, wait_until, pass_bag):
    """Also for who comes late; it begins to run with the first pose."""
    start_ns = straight_pass(700).stamps_ns[0]
    early = clock_ticks('early')
    player = play(pass_bag, rate=1.0)
    wait_until(lambda: len(early) > 5, what='the clock')
    late = clock_ticks('late')
    wait_until(lambda: len(late) > 5, what='the clock')
    assert player.poses_published == 0
    assert set(early + late) == {start_ns}
    listen()
    wait_until(lambda: late[-1] > start_ns + 10**8, what='the time of the replay')
    assert player.poses_published > 0


@pytest.mark.parametrize('rate', [1.0, 0.0])
def test_the_clock_stands_while_paused(
    ros_context, play, listen, clock_ticks, spin, call, wait_until, pass_bag, rate
):
    listen(reports=None if rate else False)
    caller = Node('caller', context=ros_context)
    spin(caller)
    ticks = clock_ticks()
    player = play(pass_bag, rate=rate, window=50)
    wait_until(lambda: player.poses_published >= 20, what='poses')
    assert call(caller, Trigger, 'bag_player/pause', Trigger.Request()).success
    late = clock_ticks('late')
    wait_until(lambda: len(late) > 5, what='the clock')
    assert len(set(late)) == 1
    assert call(caller, Trigger, 'bag_player/resume', Trigger.Request()).success
    if rate:
        wait_until(lambda: ticks[-1] > late[0] + 10**8, what='the time of the replay')
        assert ticks == sorted(ticks)


def test_without_its_clock_a_player_publishes_none(
    play, listen, clock_ticks, wait_until, pass_bag
):
    ticks = clock_ticks()
    listen()
    player = play(pass_bag, rate=0.0, publish_clock=False)
    wait_until(player.finished.done, what='the end of the replay')
    assert not ticks


def test_pause_and_resume(ros_context, play, listen, spin, call, wait_until, still, pass_bag):
    caller = Node('caller', context=ros_context)
    spin(caller)
    listener = listen()
    player = play(pass_bag, rate=1.0, start_paused=True)

    def tell(name: str) -> Trigger.Response:
        return call(caller, Trigger, f'bag_player/{name}', Trigger.Request())

    assert tell('resume').message == 'resumed'
    assert not tell('resume').success
    wait_until(lambda: len(listener.poses) > 20, what='poses')
    assert tell('pause').success
    assert tell('pause').message == 'already paused'
    paused_at = player.poses_published
    still(0.5)
    assert player.poses_published - paused_at <= 1
    assert tell('resume').success
    wait_until(lambda: len(listener.poses) > paused_at + 20, what='more poses')
    assert listener.poses == recorded(pass_bag)[: len(listener.poses)]


def test_a_loop_starts_over(play, listen, wait_until, tmp_path):
    bag = write_pose_bag(tmp_path / 'short', straight_pass(30, triggers=False))
    listener = listen()
    player = play(bag, rate=0.0, loop=True)
    wait_until(lambda: len(listener.poses) >= 100, what='the fourth round')
    assert listener.poses[:90] == 3 * recorded(bag)
    assert not player.finished.done()


def test_names_are_relative(play, listen, wait_until, tmp_path):
    bag = write_pose_bag(tmp_path / 'short', straight_pass(30, triggers=False))
    listener = listen(namespace='/cell1')
    player = play(bag, namespace='/cell1', rate=0.0)
    wait_until(player.finished.done, what='the end of the replay')
    assert len(listener.poses) == 30


@pytest.mark.parametrize(
    ('parameters', 'says'),
    [
        ({'bag': ''}, 'bag is empty: give the path of a recording'),
        ({'bag': '/nowhere'}, 'no bag at /nowhere'),
        ({'pose_topic': 'atomizer/pos'}, 'its PoseStamped topics: /atomizer/pose'),
        ({'state_topic': '/gun'}, 'its state topics: /atomizer/state'),
        ({'rate': -1.0}, 'rate is -1.0: must be at least 0.0'),
        ({'topic': 'x'}, 'bag_player has no parameter topic; did you mean'),
    ],
)
def test_bad_input_is_told_at_the_start(play, pass_bag, parameters, says):
    values = {'bag': str(pass_bag)} | parameters
    with pytest.raises((PaintError, RecordingError), match=says):
        play(**values)


def test_the_process_ends_with_what_it_did(ros_domain, listen, wait_until, pass_bag, tmp_path):
    listener = listen()
    with NodeProcess(
        tmp_path / 'player',
        'bag_player',
        bag=pass_bag,
        state_topic='/atomizer/state',
        rate='0.0',
    ) as process:
        wait_until(lambda: process.exit_code is not None, what='the end')
        assert process.exit_code == 0
        assert 'replayed 700 poses, 2 states' in process.err
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
        wait_until(lambda: process.exit_code is not None, what='the end')
        assert process.exit_code == 2
        assert f'run: paint recover {bag}' in process.err


def test_destroying_a_player_ends_its_thread(play, pass_bag):
    player = play(pass_bag)
    player.destroy_node()
    assert not any(thread.name == 'replay' for thread in threading.enumerate())
