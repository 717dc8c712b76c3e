"""Poses from joints and states from signals, over real DDS, as a robot's driver sends them."""

import math
import time
from functools import partial

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped
from paint_msgs.msg import AtomizerState
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, UInt16

from nodes.cell import FACING_PANEL, START_NS
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.motion.transforms import Rigid
from paint_deposition.nodes.atomizer_source import AtomizerSource
from paint_deposition.nodes.topics import header
from robot_arm import JOINTS, URDF, tip_poses

WAY = np.linspace([0.1, -0.2, 0.3, 0.0, 0.2, -0.1], [0.4, 0.1, 0.1, 0.3, -0.2, 0.5], 40)


class Driver(Node):
    """A robot's driver: joint states, best effort as some send them, and signals."""

    def __init__(self, context, signals=(), reliability=ReliabilityPolicy.BEST_EFFORT) -> None:
        super().__init__('driver', context=context)
        profile = QoSProfile(depth=100, reliability=reliability)
        self.joints = self.create_publisher(JointState, 'joint_states', profile)
        self.signals = {topic: self.create_publisher(kind, topic, 10) for topic, kind in signals}

    def move(self, stamps_ns, names=JOINTS, rows=WAY) -> None:
        for stamp, row in zip(stamps_ns, rows, strict=True):
            at, position = header('', int(stamp)), [9.0, *row.tolist()]
            message = JointState(header=at, name=['rail', *names], position=position)
            self.joints.publish(message)

    def say(self, topic: str, value: float) -> None:
        publisher = self.signals[topic]
        publisher.publish(publisher.msg_type(data=value))

    def has_subscribers(self) -> bool:
        publishers = [self.joints, *self.signals.values()]
        return all(publisher.get_subscription_count() for publisher in publishers)


@pytest.fixture
def source(start):
    """`source(**parameters)`: the node, with the arm's URDF."""
    return lambda **values: start(AtomizerSource, **{'urdf_file': str(URDF)} | values)


@pytest.fixture
def driver(ros_context, spin, wait_until):
    def driver(*signals) -> Driver:
        node = Driver(ros_context, signals)
        spin(node)
        wait_until(node.has_subscribers, what='discovery')
        return node

    return driver


@pytest.fixture
def viewer(onlooker):
    return onlooker('atomizer/pose', 'atomizer/state')


@pytest.fixture
def switched(viewer, wait_until):
    """`switched(count)`: the states, once there are so many."""

    def switched(count: int) -> list[AtomizerState]:
        heard = viewer.heard['atomizer/state']
        wait_until(lambda: len(heard) >= count, what=f'{count} states')
        assert len(heard) == count
        return viewer.all('atomizer/state')

    return switched


def stamps_from_now() -> np.ndarray:
    return time.time_ns() + 4_000_000 * np.arange(len(WAY))


def test_a_driver_that_returns_another_way_is_heard(source, ros_context, spin, viewer, wait_until):
    node = source()
    for count, quality in ((1, ReliabilityPolicy.RELIABLE), (2, ReliabilityPolicy.BEST_EFFORT)):
        driver = Driver(ros_context, reliability=quality)
        spin(driver)
        wait_until(driver.has_subscribers, what='the source')
        driver.move([START_NS + 4_000_000 * count], rows=WAY[:1])
        wait_until(lambda n=count: len(viewer.heard['atomizer/pose']) == n, what='its pose')
        driver.destroy_node()
    assert node.poses_published == 2


@pytest.mark.parametrize(('given', 'prefix', 'scale'), [
    ({}, '', 1.0), ({'joint_prefix': 'irb_', 'angle_unit': 'deg'}, 'irb_', 180.0 / np.pi),
])  # fmt: skip
def test_poses_are_those_of_the_bell(source, driver, viewer, wait_until, given, prefix, scale,
                                     switched):  # fmt: skip
    """And a joint may be the signal: the rail stands at 9."""
    offset = [0.0, 0.02, 0.15, 0.0, np.sin(0.2), 0.0, np.cos(0.2)]
    signal = {'joint_topic': '/joint_states', 'trigger': '/joint_states.position[0] > 3'}
    source(tcp_offset=offset, **signal, **given)
    robot = driver()
    wait_until(lambda: viewer.count_publishers('atomizer/pose'))
    stamps = stamps_from_now()
    robot.move(stamps, [prefix + name for name in JOINTS], scale * WAY)
    wait_until(lambda: len(viewer.heard['atomizer/pose']) == len(WAY), what='the poses')
    pose = viewer.newest('atomizer/pose')
    tip = Rigid.of(np.concatenate([column[-1] for column in tip_poses(WAY)]))
    expected = tip @ Rigid.of(offset)
    p, q = pose.pose.position, pose.pose.orientation
    assert [p.x, p.y, p.z] == pytest.approx(list(expected.values[:3]), abs=1e-9)
    quaternion = np.array([q.x, q.y, q.z, q.w])
    assert abs(quaternion @ expected.values[3:]) == pytest.approx(1.0, abs=1e-9)
    assert pose.header == header('base_link', int(stamps[-1]))
    assert switched(1)[0].spraying


def test_signals_are_flow_brush_and_programmed_speed(source, driver, switched):
    source(
        trigger='/paint_ml_min > 5', flow='/paint_ml_min', calibrated_flow=250.0,
        brush='/brush_number', speed='/speed_mm_s', speed_scale=0.001,
    )  # fmt: skip
    robot = driver(('/paint_ml_min', Float64), ('/brush_number', UInt16), ('/speed_mm_s', UInt16))
    # A state needs all of them.
    for topic, value, count in (
        ('/paint_ml_min', 0.0, 0), ('/brush_number', 3, 0), ('/speed_mm_s', 350, 1),
        ('/paint_ml_min', 300.0, 2), ('/brush_number', 4, 3), ('/speed_mm_s', 500, 4),
    ):  # fmt: skip
        robot.say(topic, value)
        states = switched(count)
    assert [state.spraying for state in states] == [False, True, True, True]
    assert [state.flow for state in states] == [0.0, 1.2, 1.2, 1.2]
    assert [state.brush for state in states] == [3, 3, 4, 4]
    speeds = [state.programmed_speed_m_per_s for state in states]
    assert speeds == pytest.approx([0.35, 0.35, 0.35, 0.5], rel=1e-12)


def test_a_signal_that_was_overtaken_takes_effect_with_the_newest(source, driver, switched):
    """Unless the clock was set back."""
    source(trigger='/gun.point.x', flow='/paint.point.x')
    robot = driver(('/gun', PointStamped), ('/paint', PointStamped))
    for topic, at_ms, value, count in (
        ('/paint', 9000, 0.5, 0), ('/gun', 10_000, 1.0, 1), ('/paint', 9980, 0.8, 2),
        ('/paint', 5000, 0.7, 3),
    ):  # fmt: skip
        message = PointStamped(header=header('', at_ms * 1_000_000))
        message.point.x = value
        robot.signals[topic].publish(message)
        states = switched(count)
    assert [(stamp_ns(s.header) // 1_000_000, s.flow) for s in states] == [
        (10_000, 0.5), (10_000, 0.8), (5000, 0.7),
    ]  # fmt: skip
    assert math.isnan(states[0].voltage_kv)


def test_joint_states_and_signals_that_are_refused_are_told(source, driver, viewer, wait_until):
    """From the start, and joint states from then on."""
    node = source(trigger='/io.level > 1')
    robot = driver(('/io', UInt16))
    for told in ('no joint state has all joints: ', 'joint states are refused: '):
        robot.move(stamps_from_now(), names=JOINTS[:5], rows=WAY[:, :5])
        reports = partial(viewer.reports, 'atomizer_source: robot', told, b'\x02')
        wait_until(reports, what=told)
        assert 'wrist_roll' in viewer.status('atomizer_source: robot').message
        robot.move(stamps_from_now())
        wait_until(lambda: node.poses_published >= len(WAY), what='the poses')
    robot.say('/io', 1)
    told = '/io: UInt16 has no number or Bool at .level'
    wait_until(lambda: viewer.reports('atomizer_source: signals', told, b'\x02'))


def test_a_trigger_alone_switches_the_gun(source, robot, wait_until, viewer, switched):
    """Poses of its own, a Bool of the PLC: sent when it says, unless the clocks differ."""
    node = source(urdf_file='', trigger='/gun')
    poses, place = robot(), (np.zeros(3), FACING_PANEL, 'cell')
    gun = poses.create_publisher(Bool, '/gun', 10)
    wait_until(lambda: gun.get_subscription_count())
    wait_until(lambda: poses.pose_publisher.get_subscription_count() == 2, what='discovery')
    before_ns = time.time_ns()
    poses.send_pose(before_ns, *place)
    wait_until(lambda: viewer.heard['atomizer/pose'], what='the pose')
    for value in (True, False):
        gun.publish(Bool(data=value))
    first, _ = switched(2)
    assert (first.spraying, first.header.frame_id) == (True, 'cell')
    assert before_ns <= Time.from_msg(first.header.stamp).nanoseconds <= time.time_ns()
    assert node.count_publishers('atomizer/pose') == 1
    wait_until(lambda: viewer.reports('atomizer_source: robot', 'the robot publishes its poses'))
    poses.send_pose(before_ns - 30_000_000_000, *place)
    wait_until(lambda: len(viewer.heard['atomizer/pose']) == 2, what='the other clock')
    gun.publish(Bool(data=True))
    told = '/gun has no stamps, and the poses of the robot are sent 3'
    wait_until(lambda: viewer.reports('atomizer_source: signals', told, b'\x02'))
    switched(2)


def test_a_signal_that_fails_keeps_the_gun_as_it_was(source, driver, viewer, wait_until, switched):
    source(trigger='/level.data > 12', brush='/number')
    robot = driver(('/level', Float64), ('/number', Float64))
    # A signal that says the same again is no new state.
    for row, (topic, wrong, told) in enumerate((
        ('/level', math.nan, '/level: trigger is nan: give a number'),
        ('/number', 2.7, '/number: brush is 2.7: give 0 to'),
        ('/number', math.nan, '/number: brush is nan'),
        ('/number', 1e12, '/number: brush is 1e+12'),
    )):  # fmt: skip
        robot.say('/number', 2.0)
        robot.say('/level', 24.0)
        switched(2 * row + 1)
        robot.say(topic, wrong)
        wait_until(lambda t=told: viewer.reports('atomizer_source: signals', t, b'\x02'), told)
        robot.say('/number', 2.0)
        robot.say('/level', 3.0)
        states = switched(2 * row + 2)
        assert [(s.spraying, s.brush) for s in states[-2:]] == [(True, 2), (False, 2)]
