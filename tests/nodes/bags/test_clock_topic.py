"""The time of a replay on /clock."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from files.recorded import straight_pass
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.nodes.runtime import topics


@pytest.fixture
def clock_ticks(ros_context, spin):
    """`clock_ticks()`: a list that fills with the times [ns] on /clock."""

    def clock_ticks(name='clock_watch') -> list[int]:
        node = Node(name, context=ros_context)
        ticks = []

        def hear(message: Clock) -> None:
            ticks.append(Time.from_msg(message.clock).nanoseconds)

        node.create_subscription(Clock, '/clock', hear, topics.CLOCK)
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


@pytest.mark.parametrize('rate', [1.0, 0.0])
def test_the_clock_stands_before_the_start_and_while_paused(
    onlooker, play, listen, clock_ticks, call, wait_until, pass_bag, rate
):
    """Also for who comes late; it begins to run with the first pose."""
    tell, ticks = partial(call, onlooker(), Trigger), clock_ticks()
    player = play(pass_bag, rate=rate, window=50)
    wait_until(lambda: len(ticks) > 5, what='the clock')
    early = clock_ticks('early')
    wait_until(lambda: len(early) > 5, what='the clock')
    assert player.poses_published == 0
    assert set(ticks + early) == {straight_pass(700).stamps_ns[0]}
    listen(reports=None if rate else False)
    wait_until(lambda: player.poses_published >= 20, what='poses')
    assert tell('bag_player/pause').success
    late = clock_ticks('late')
    wait_until(lambda: len(late) > 5, what='the clock')
    assert len(set(late)) == 1
    assert tell('bag_player/resume').success
    if rate:
        wait_until(lambda: ticks[-1] > late[0] + 10**8, what='the time of the replay')
        assert ticks == sorted(ticks)
