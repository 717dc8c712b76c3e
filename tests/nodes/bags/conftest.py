"""A recorder and who publishes to it; a player and who listens to it."""

import pytest

from files.recorded import straight_pass
from paint_deposition.files.recordings.bags import write_pose_bag


@pytest.fixture
def cell(ros_context, spin):
    """A node to publish from."""
    from rclpy.node import Node

    node = Node('cell', context=ros_context)
    spin(node)
    return node


@pytest.fixture
def publisher(cell, wait_until):
    """`publisher(type, topic, profile)`: a publisher that the recorder has subscribed to."""

    def publisher(kind, topic: str, profile):
        made = cell.create_publisher(kind, topic, profile)
        wait_until(made.get_subscription_count, what=f'a subscriber on {topic}')
        return made

    return publisher


@pytest.fixture
def listen(ros_context, spin):
    """`listen(reports=True)`: a node that hears the poses, running."""
    from nodes.bags.runs import Listener

    def listen(reports=True) -> Listener:
        listener = Listener(ros_context, reports)
        spin(listener)
        return listener

    return listen


@pytest.fixture
def pass_bag(tmp_path):
    """A recording of 700 poses."""
    return write_pose_bag(tmp_path / 'pass', straight_pass(700))
