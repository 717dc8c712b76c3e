"""A replay is as fast as those who listen take it."""

import pytest

pytest.importorskip('rclpy')

from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

from files.recorded import straight_pass
from nodes.replay.listener import Listener, recorded
from paint_deposition.files.recordings.bags import write_pose_bag


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
    bag = write_pose_bag(tmp_path / 'long', straight_pass(4_000, triggers=False))
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
    assert player.poses_published < 4_000
    late.create_timer(0.01, late.report)
    wait_until(player.finished.done, what='the end of the replay')
    everything = recorded(bag)
    assert late.poses == everything[-len(late.poses) :]


def test_nothing_is_sent_before_somebody_listens(play, listen, wait_until, still, pass_bag):
    player = play(pass_bag, rate=0.0)
    still(0.5)
    assert player.poses_published == 0
    listener = listen()
    wait_until(player.finished.done, what='the end of the replay')
    assert listener.poses == recorded(pass_bag)
