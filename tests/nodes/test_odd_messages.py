"""No message of the right type ends a node, whatever it holds, nor spoils what comes after it."""

import math
import os
import random
import re
import time

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from nodes.cell import offline_um, two_passes, write_panel
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.nodes.atomizer_source import AtomizerSource
from paint_deposition.nodes.bags.bag_player import BagPlayer
from paint_deposition.nodes.bags.run_recorder import RunRecorder
from paint_deposition.nodes.model_comparison import ModelComparison
from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator
from paint_deposition.nodes.topics import message_class
from paint_deposition.nodes.web_view import WebView
from robot_arm import URDF

NUMBERS = (0.0, 1.0, -1.0, math.nan, math.inf, -math.inf, 1e308, -1e-308, 1e6, 0.5)
WORDS = ('', '/', 'part', 'cell', 'no such frame', '..', 'a' * 300, "it's\n=1+1", 'µ\u2028')
ARRAY = re.compile(r'(sequence<(?P<inner>.+?)(, \d+)?>|(?P<kind>.+)\[(?P<count>\d+)\])')


def odd_message(message: type, rng: random.Random) -> object:
    """A message of that type, each field of which is now and then left as it is."""
    made = message()
    for name, kind in message.get_fields_and_field_types().items():
        if rng.random() < 0.85:
            setattr(made, name, _odd(kind, rng))
    return made


def _odd(kind: str, rng: random.Random) -> object:
    if several := ARRAY.fullmatch(kind):
        count = int(several['count'] or rng.choice([0, 1, 3, 7]))
        return [_odd(several['inner'] or several['kind'], rng) for _ in range(count)]
    if kind in ('float', 'double'):
        value = rng.choice(NUMBERS)
        return value if kind == 'double' or abs(value) < 1e38 or math.isinf(value) else 0.0
    if kind.startswith(('string', 'wstring')):
        return rng.choice(WORDS)
    if kind == 'boolean':
        return rng.random() < 0.5
    if kind in ('octet', 'byte'):
        return bytes([rng.randrange(4)])
    if match := re.fullmatch(r'(u?)int(\d+)', kind):
        bits = int(match[2])
        low, high = (0, 2**bits - 1) if match[1] else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return rng.choice([low, high, 0, 1, max(low, -1), 999_999_999 % (high + 1)])
    package, name = kind.split('/')
    return odd_message(message_class(f'{package}/msg/{name}'), rng)


def send_odd(peer: Node, publishers: dict[str, Publisher], nodes, rng: random.Random) -> None:
    """An odd message on every topic that these nodes subscribe to."""
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    for subscription in [each for node in nodes for each in node.subscriptions]:
        topic, kind = subscription.topic_name, subscription.msg_type
        if topic not in publishers:
            publishers[topic] = peer.create_publisher(kind, topic, latched)
        publishers[topic].publish(odd_message(kind, rng))


MESSAGES = int(os.environ.get('PAINT_MESSAGES', '60'))
MOTION = two_passes()


@pytest.fixture
def made(closed, tmp_path):
    """`made(name)`: a node that runs, of each kind that subscribes to anything."""
    mesh = {'mesh_file': str(write_panel(tmp_path / 'panel.stl')), 'max_edge_length_m': 0.1}
    readings = tmp_path / 'readings.csv'
    readings.write_text('x_m,y_m,z_m,thickness_um\n' + '0.0,0.0,0.1,20\n0.1,0.0,0.1,21\n' * 3)
    bag = str(write_pose_bag(tmp_path / 'pass', MOTION))
    signal = {'trigger': 'gun', 'flow': 'flow'}
    films = {'output_directory': str(tmp_path / 'films')}
    nodes = {
        'simulator': (DepositionSimulator, mesh | films),
        'comparison': (ModelComparison, mesh | {'measurements_file': str(readings)}),
        'web_view': (WebView, mesh | {'port': 0}),
        'recorder': (RunRecorder, {'output_directory': str(tmp_path / 'runs'), 'name': 'run'}),
        'joints': (AtomizerSource, {'urdf_file': str(URDF), **signal}),
        'tf': (AtomizerSource, {'base_link': 'base', 'tip_link': 'tool0', **signal}),
        'trigger': (AtomizerSource, signal),
        'player': (BagPlayer, {'bag': bag, 'rate': 0.0, 'loop': True, 'publish_clock': False}),
    }
    return lambda name: closed(nodes[name][0], **nodes[name][1])


@pytest.mark.parametrize('name', [
    'simulator', 'comparison', 'web_view', 'recorder', 'joints', 'tf', 'trigger', 'player',
])  # fmt: skip
def test_no_odd_message_ends_a_node(name, made, ros_context, spin, executor, wait_until):
    if name == 'tf':
        pytest.importorskip('tf2_msgs')
    peer, publishers = Node('peer', context=ros_context), {}
    signals = [peer.create_publisher(Float64, topic, 10) for topic in ('gun', 'flow')]
    poses = peer.create_publisher(PoseStamped, 'atomizer/pose', 10)
    node = made(name)
    spin(peer)
    rng = random.Random(sum(map(ord, name)))
    if name in ('joints', 'tf', 'trigger'):
        wait_until(lambda: all(s.get_subscription_count() for s in signals), what='signals')
    if name == 'recorder':
        poses.publish(PoseStamped())
        wait_until(lambda: len(node.recorded) > 0, what='a recorded topic')
    nodes = [node, made('web_view')] if name == 'recorder' else [node]
    send_odd(peer, publishers, nodes, rng)
    heard = lambda: all(each.get_subscription_count() for each in publishers.values())  # noqa: E731
    wait_until(heard, what='discovery')
    for _ in range(MESSAGES):
        send_odd(peer, publishers, nodes, rng)
        for _ in range(10):
            executor.spin_once(timeout_sec=0.0)
    sent_ns = time.monotonic_ns()
    wait_until(
        lambda: all(
            timer.is_canceled() or timer.time_since_last_call() < time.monotonic_ns() - sent_ns
            for timer in node.timers
        ),
        what='diagnostics, statistics and all other timers',
    )
    for _ in range(3):  # what timers and services show of it
        node.publish_diagnostics()
    assert not node.finished.done(), node.finished.exception()


def test_odd_messages_spoil_no_film(made, robot, wait_until, call):
    """After a reset the film is as without them."""
    node = made('simulator')
    driver = robot(node)
    rng = random.Random(33)
    for _ in range(MESSAGES):
        for publisher in (driver.pose_publisher, driver.state_publisher):
            publisher.publish(odd_message(publisher.msg_type, rng))
    driver.send_fields(MOTION.stamps_ns[0], spraying=False, programmed_speed_m_per_s=0.123)
    heard = node.inputs[0]
    wait_until(lambda: heard.poses_received == MESSAGES and heard.programmed_m_per_s == 0.123)
    call(driver, Trigger, '/deposition_simulator/reset')
    driver.send(MOTION)
    wait_until(lambda: node.film.counts.received >= len(MOTION))
    node.catch_up()
    assert np.array_equal(node.film.snapshot().film_um, offline_um(node, MOTION))
