"""Nodes of a small paint cell, spinning."""

import time

import numpy as np
import pytest


@pytest.fixture
def start(ros_context, spin):
    """`start(node_class, namespace='', **parameters)`: a node that runs."""
    from nodes.cell import parameters

    def start(node_class, namespace='', **values):
        chosen = parameters(**values)
        node = node_class(context=ros_context, namespace=namespace, parameter_overrides=chosen)
        spin(node)
        return node

    return start


@pytest.fixture
def closed(start):
    """`closed(node_class, **parameters)`: a node that runs, and is closed at the end."""
    made = []

    def closed(node_class, **values):
        made.append(start(node_class, **values))
        return made[-1]

    yield closed
    for node in made:
        node.close()


@pytest.fixture
def simulator(start, tmp_path):
    """`simulator(**parameters)`: a simulator of the panel that runs."""
    from nodes.cell import write_panel
    from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator

    def simulator(**values) -> DepositionSimulator:
        chosen = {
            'mesh_file': str(write_panel(tmp_path / 'panel.stl')), 'max_edge_length_m': 0.05,
            'publish_rate_hz': 10.0, 'pose_queue_depth': 1000,
            'output_directory': str(tmp_path / 'films'),
        }  # fmt: skip
        return start(DepositionSimulator, **chosen | values)

    return simulator


@pytest.fixture
def record(start, tmp_path):
    """`record(**parameters)`: a recorder of the run `run`, running."""
    from paint_deposition.nodes.bags.run_recorder import RunRecorder

    run = {'output_directory': str(tmp_path), 'name': 'run'}
    return lambda **chosen: start(RunRecorder, **run | chosen)


@pytest.fixture
def play(start):
    """`play(bag, **parameters)`: a player of this bag, running."""
    from paint_deposition.nodes.bags.bag_player import BagPlayer

    return lambda bag, **chosen: start(BagPlayer, **{'bag': str(bag)} | chosen)


@pytest.fixture
def still(wait_until):
    """`still(duration_s)`: let so much time pass, in which callbacks run."""

    def still(duration_s: float) -> None:
        end_s = time.monotonic() + duration_s
        wait_until(lambda: time.monotonic() > end_s, what='the time')

    return still


@pytest.fixture
def robot(ros_context, spin, wait_until):
    """`robot(*nodes, **options)`: a robot that runs, and that these nodes hear."""
    from nodes.cell import Robot

    def robot(*nodes, **options) -> Robot:
        robot = Robot(ros_context, **options)
        spin(robot)
        wait_until(lambda: robot.is_subscribed_by(*nodes), what='discovery of the simulator')
        return robot

    return robot


@pytest.fixture
def simulated(simulator, robot):
    """`simulated(**parameters)`: a simulator of the panel, and a robot that it hears."""

    def simulated(**values):
        node = simulator(**values)
        return node, robot(node)

    return simulated


@pytest.fixture
def onlooker(ros_context, spin):
    """`onlooker(*topics)`: a node that keeps what it hears, diagnostics too."""
    from nodes.cell import Onlooker

    def onlooker(*topics) -> Onlooker:
        node = Onlooker(ros_context, *topics)
        spin(node)
        return node

    return onlooker


@pytest.fixture
def asked(wait_until):
    """`asked(node, type, name, **fields)`: the future of the response of a service, found once."""
    clients = {}

    def asked(node, service, name, /, **fields):
        if (node, name) not in clients:
            clients[node, name] = node.create_client(service, name)
        client = clients[node, name]
        wait_until(client.service_is_ready, what=f'service {name}')
        return client.call_async(service.Request(**fields))

    return asked


@pytest.fixture
def call(asked, wait_until):
    """`call(node, type, name, **fields)`: the response of a service."""

    def call(node, service, name, /, **fields):
        future = asked(node, service, name, **fields)
        wait_until(future.done, what=f'answer of {name}')
        return future.result()

    return call


@pytest.fixture
def painted(wait_until):
    """`painted(node, count)`: the film [um] once so many poses, or `two_passes()`, are painted."""
    from nodes.cell import TWO_PASSES_POSES

    def painted(node, count: int = TWO_PASSES_POSES) -> np.ndarray:
        wait_until(lambda: node.film.counts.received >= count, what=f'{count} poses painted')
        node.catch_up()
        return node.film.snapshot().film_um

    return painted
