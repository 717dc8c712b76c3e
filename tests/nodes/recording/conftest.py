"""A recorder, and who publishes to it."""

import pytest


@pytest.fixture
def record(ros_context, spin, tmp_path):
    """`record(**parameters)`: a recorder of the run `run`, running."""
    from nodes.cell import parameters
    from paint_deposition.nodes.recording.run_recorder import RunRecorder

    def record(namespace='', **chosen) -> RunRecorder:
        values = {'output_directory': str(tmp_path), 'name': 'run'} | chosen
        recorder = RunRecorder(
            context=ros_context, namespace=namespace, parameter_overrides=parameters(**values)
        )
        spin(recorder)
        return recorder

    return record


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
