"""A replay is as fast as those who listen take it."""

from nodes.bags.listener import recorded


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
