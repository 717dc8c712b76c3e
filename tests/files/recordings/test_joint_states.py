"""Motion from joint states and a URDF: the arm's tip, where its geometry says it is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from files.recorded import Messages, write_bag
from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.joint_states import Robot
from robot_arm import JOINTS, TIP_M, URDF, sweep, tip_poses
from scenes import stamps_ns

TIMES_S = np.linspace(0.0, 3.0, 151)


def joint_bag(path, rows, storage='mcap'):
    """A bag of (topic, stamp, names, positions) of joint states."""
    messages = Messages(ros1=storage == 'ros1')
    entries = [
        (topic, int(stamp), messages.joints(stamp, names, values))
        for topic, stamp, names, values in rows
    ]
    return write_bag(path, entries, storage, messages)


def rows_of(joints=None, names=JOINTS):
    joints = sweep() if joints is None else joints
    return [
        ('/joint_states', stamp, names, row)
        for stamp, row in zip(stamps_ns(TIMES_S), joints, strict=True)
    ]


def test_any_joints_agree_with_the_product_of_exponentials():
    joints = np.random.default_rng(8).uniform(-3.5, 3.5, (40, 6))  # beyond their limits, too
    joints[0] = 0.0
    robot = Robot.read(URDF)
    assert (robot.base, robot.tip, robot.moving_joints) == ('base_link', 'tool0', list(JOINTS))
    positions, quaternions = robot.poses(joints)
    assert np.allclose(positions[0], TIP_M, atol=1e-9)
    expected, turned = tip_poses(joints)
    assert np.allclose(positions, expected, atol=1e-9)
    apart = (Rotation.from_quat(turned).inv() * Rotation.from_quat(quaternions)).magnitude()
    assert apart.max() < 1e-8


def test_joint_states_become_poses(tmp_path):
    bag = joint_bag(tmp_path / 'run.bag', rows_of(), 'ros1')
    read = read_recording(bag, urdf=str(URDF), frame_id='base_link')
    assert np.array_equal(read.stamps_ns, stamps_ns(TIMES_S))
    assert np.allclose(read.positions_m, tip_poses(sweep())[0], atol=1e-9)
    assert read.frame_id == 'base_link'
    (note,) = read.notes
    assert "pose of 'tool0' in 'base_link' by arm.urdf" in note


def test_joints_in_any_order_and_in_messages_of_their_own(tmp_path):
    """The pan comes at half the rate from another controller; a gripper's joint is left out."""
    joints, rows = sweep(), []
    for row, (stamp, values) in enumerate(zip(stamps_ns(TIMES_S), joints, strict=True)):
        others = (*JOINTS[:0:-1], 'gripper')
        rows.append(('/joint_states', stamp, others, [*values[:0:-1], 0.4]))
        if row % 2 == 0:
            rows.append(('/joint_states', stamp, ('shoulder_pan',), values[:1]))
    bag = joint_bag(tmp_path / 'run', rows)
    read = read_recording(bag, '/joint_states', urdf=str(URDF), frame_id='base_link')
    # The pan is even in time, so that what is interpolated is exact.
    assert np.allclose(read.positions_m, tip_poses(joints)[0], atol=1e-9)


def test_another_link_and_another_base(tmp_path):
    bag = joint_bag(tmp_path / 'run', rows_of())
    given = {'urdf': str(URDF), 'tip_link': 'wrist_roll_link', 'base_link': 'shoulder_pan_link'}
    read = read_recording(bag, **given, frame_id='shoulder_pan_link')
    joints = sweep()
    joints[:, 0] = 0.0  # the base turns along
    position, quaternion = tip_poses(joints)
    back = Rotation.from_quat(quaternion).apply([0, 0, TIP_M[0] - 1.05])
    assert np.allclose(read.positions_m, position - back - [0, 0, 0.4], atol=1e-9)


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        ({}, 'name a pose topic; it has no PoseStamped topic; it has joint states (give urdf)'),
        ({'urdf': 'ARM', 'tip_link': 'tool1'}, "has no link 'tool1'; did you mean 'tool0'?"),
        ({'urdf': 'ARM', 'base_link': 'tool0', 'tip_link': 'base_link'}, 'does not hang on'),
        ({'urdf': 'ARM', 'tf': ['a', 'b']}, 'leave one of them out'),
        ({'urdf': 'ARM', 'pose_topic': '/joints'}, 'no topic /joints; its JointState topics'),
        ({'urdf': 'ARM', 'frame_id': 'door'}, "in frame 'base_link', the mesh in 'door'"),
    ],
)
def test_missing_links_and_joints_are_named(given, words, tmp_path):
    bag = joint_bag(tmp_path / 'run', rows_of()[:3])
    given = {key: str(URDF) if value == 'ARM' else value for key, value in given.items()}
    with pytest.raises(RecordingError) as refused:
        read_recording(bag, **given)
    assert words in str(refused.value)


def test_joints_that_are_not_recorded_are_named(tmp_path):
    bag = joint_bag(tmp_path / 'run', rows_of(sweep()[:, :5], JOINTS[:5]))
    with pytest.raises(RecordingError, match=r'has nothing of wrist_roll of arm\.urdf'):
        read_recording(bag, urdf=str(URDF))


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('<robot name="a"><link name="b"/>', 'has no'),
        ('nothing', 'is no URDF'),
        ('<robot xmlns:xacro="http://x"><xacro:include/></robot>', 'is xacro; run: xacro'),
    ],
)
def test_what_is_no_robot_is_refused(text, words, tmp_path):
    (tmp_path / 'robot.urdf').write_text(text)
    with pytest.raises(RecordingError, match=words):
        Robot.read(tmp_path / 'robot.urdf', tip='tool0')


def test_joint_states_that_are_not_finite_are_left_out_and_counted(tmp_path):
    rows = rows_of()
    rows[20] = (*rows[20][:3], np.full(6, np.nan))
    read = read_recording(joint_bag(tmp_path / 'run', rows), urdf=str(URDF), frame_id='base_link')
    assert len(read) == len(rows) - 1
    assert np.isfinite(read.positions_m).all()
    assert '1 joint states on /joint_states with joints that are not finite' in ' '.join(
        read.warnings
    )
