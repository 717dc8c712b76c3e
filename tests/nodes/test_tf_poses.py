"""Poses from transforms over real DDS, as robot_state_publisher and a rail's driver send them."""

import importlib.util

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nodes.cell import START_NS, Broadcaster, parameters
from paint_deposition.errors import PaintError
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.motion.transforms import Rigid
from paint_deposition.nodes.atomizer_source import AtomizerSource

STEP_NS = 4_000_000
FLANGE = Rigid.of([0.0, 0.1, 0.3, *Rotation.from_euler('x', 30.0, degrees=True).as_quat()])
TCP = [0.0, 0.02, 0.15, *Rotation.from_euler('y', 25.0, degrees=True).as_quat()]


@pytest.fixture
def viewer(onlooker):
    return onlooker('atomizer/pose')


@pytest.fixture
def broadcaster(start, ros_context, spin, viewer, wait_until):
    pytest.importorskip('tf2_msgs', reason='tf2 comes with a ROS installation')
    start(AtomizerSource, base_link='world', tcp_offset=TCP)
    sender = Broadcaster(ros_context)
    spin(sender)
    wait_until(sender.has_subscribers, what='discovery')
    wait_until(lambda: viewer.count_publishers('atomizer/pose'))
    return sender


def rail(stamp: int) -> Rigid:
    """Moves along the cell's x at 0.5 m/s, which interpolation meets exactly."""
    return Rigid.of([0.5e-9 * (stamp - START_NS), 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def arm(stamp: int) -> Rigid:
    turn = Rotation.from_euler('z', 1e-9 * (stamp - START_NS))
    return Rigid.of([0.2, 0.0, 1.0, *turn.as_quat()])


def poses(viewer) -> tuple[list[int], np.ndarray]:
    heard, rows = viewer.all('atomizer/pose'), []
    for message in heard:
        p, q = message.pose.position, message.pose.orientation
        rows.append([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
        assert message.header.frame_id == 'world'
    return [stamp_ns(message.header) for message in heard], np.array(rows)


def told(viewer) -> str:
    status = viewer.status('atomizer_source: robot')
    return status.message if status else ''


def test_poses_of_the_bell_have_the_stamps_of_transforms(broadcaster, viewer, wait_until):
    """A rail that tells its place at a fifth of the arm's rate, and late."""
    broadcaster.send(START_NS, static=True, flange_to_tool0=FLANGE)
    stamps = [START_NS + STEP_NS * row for row in range(51)]
    for row, stamp in enumerate(stamps):
        broadcaster.send(stamp, foot_to_flange=arm(stamp), other_to_camera=arm(stamp + 17))
        if row % 5 == 0:
            broadcaster.send(stamp, world_to_foot=rail(stamp))
    wait_until(lambda: len(viewer.heard['atomizer/pose']) == len(stamps), what='the poses')
    found_ns, found = poses(viewer)
    assert found_ns == stamps
    expected = np.array(
        [(rail(stamp) @ arm(stamp) @ FLANGE @ Rigid.of(TCP)).values for stamp in stamps]
    )
    assert np.abs(found[:, :3] - expected[:, :3]).max() < 1e-9
    assert np.abs(np.sum(found[:, 3:] * expected[:, 3:], axis=1)) == pytest.approx(1.0, abs=1e-12)
    wait_until(lambda: told(viewer) == 'following the robot')


def test_a_stream_that_begins_again_is_followed(broadcaster, viewer, wait_until):
    broadcaster.send(START_NS, static=True, world_to_foot=rail(START_NS), flange_to_tool0=FLANGE)
    stamps = [START_NS + 10_000_000_000, START_NS]
    for first in stamps:
        for row in range(5):
            broadcaster.send(first + STEP_NS * row, foot_to_flange=arm(first + STEP_NS * row))
    wait_until(lambda: len(viewer.heard['atomizer/pose']) == 10, what='the poses of both')
    assert poses(viewer)[0] == [first + STEP_NS * row for first in stamps for row in range(5)]


def test_a_frame_that_is_not_there_is_named(broadcaster, viewer, wait_until):
    broadcaster.send(START_NS, foot_to_tool=arm(START_NS))
    wait_until(lambda: told(viewer) == "tf has no frame 'tool0'; did you mean 'tool'?")
    broadcaster.send(START_NS, foot_to_tool0=arm(START_NS), cell_to_world=rail(START_NS))
    no_way = "no moving transforms connect 'tool0' to 'world'"
    wait_until(lambda: told(viewer) == no_way)
    assert not viewer.heard['atomizer/pose']


@pytest.mark.skipif(
    importlib.util.find_spec('tf2_msgs') is not None, reason='tf2 is installed here'
)
def test_without_tf2_it_says_what_to_install(ros_context):
    with pytest.raises(PaintError, match='poses from tf need tf2_msgs, which is not installed'):
        AtomizerSource(context=ros_context, parameter_overrides=parameters(base_link='world'))
