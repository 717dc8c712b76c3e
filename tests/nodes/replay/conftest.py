"""A player, and who listens to it."""

import time

import pytest

from files.recorded import straight_pass
from paint_deposition.files.recordings.bags import write_pose_bag


@pytest.fixture
def play(ros_context, spin):
    """`play(bag, **parameters)`: a player of this bag, running."""
    from nodes.cell import parameters
    from paint_deposition.nodes.bags.bag_player import BagPlayer

    def play(bag, namespace='', **chosen) -> BagPlayer:
        values = {'bag': str(bag)} | chosen
        player = BagPlayer(
            context=ros_context, namespace=namespace, parameter_overrides=parameters(**values)
        )
        spin(player)
        return player

    return play


@pytest.fixture
def listen(ros_context, spin):
    """`listen(name)`: a node that hears the poses, running."""
    from nodes.replay.listener import Listener

    def listen(name='listener', reports=True, namespace='') -> Listener:
        listener = Listener(ros_context, name, reports, namespace)
        spin(listener)
        return listener

    return listen


@pytest.fixture
def pass_bag(tmp_path):
    """A recording of 700 poses."""
    return write_pose_bag(tmp_path / 'pass', straight_pass(700))


@pytest.fixture
def still(wait_until):
    """`still(duration_s)`: let so much time pass, in which nothing more should happen."""

    def still(duration_s: float) -> None:
        end_s = time.monotonic() + duration_s
        wait_until(lambda: time.monotonic() > end_s, what='the time')

    return still
