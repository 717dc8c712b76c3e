"""A recorder, and who publishes to it."""

import pytest


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

    def publisher(kind, topic: str, profile, subscribers: int = 1):
        made = cell.create_publisher(kind, topic, profile)
        wait_until(
            lambda: made.get_subscription_count() >= subscribers, what=f'a subscriber on {topic}'
        )
        return made

    return publisher
