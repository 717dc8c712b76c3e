"""Motion, frames and triggers from joint states, transforms and any message of a bag."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from files.recorded import Messages, pose_entries, straight_pass, write_bag
from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.files.recordings.joint_states import Robot
from paint_deposition.files.recordings.pose_topics import sources_of_poses
from paint_deposition.motion.transforms import Rigid
from refusals import refusal
from robot_arm import JOINTS, TIP_M, URDF, sweep, tip_poses
from scenes import stamps_ns

TIMES_S = np.linspace(0.0, 3.0, 151)


def joint_bag(path, rows, storage='mcap'):
    """A bag of (topic, stamp, names, positions) of joint states."""
    messages = Messages(ros1=storage == 'ros1')
    entries = [(topic, int(stamp), messages.joints(stamp, *told)) for topic, stamp, *told in rows]
    return write_bag(path, entries, storage, messages)


def rows_of(joints=None, names=JOINTS):
    each = zip(stamps_ns(TIMES_S), sweep() if joints is None else joints, strict=True)
    return [('/joint_states', stamp, names, row) for stamp, row in each]


def read_joints(folder, rows):
    """The motion of the arm's tip by these joint states."""
    return read_recording(joint_bag(folder / 'run', rows), urdf=str(URDF), frame_id='base_link')


def test_any_joints_agree_with_the_product_of_exponentials():
    joints = np.random.default_rng(8).uniform(-3.5, 3.5, (40, 6))  # beyond their limits, too
    joints[0] = 0.0
    robot = Robot.read(URDF)
    assert (robot.base, robot.tip, robot.arm.joints) == ('base_link', 'tool0', JOINTS)
    positions, quaternions = robot.poses(joints)
    assert np.allclose(positions[0], TIP_M, atol=1e-9)
    expected, turned = tip_poses(joints)
    assert np.allclose(positions, expected, atol=1e-9)
    apart = (Rotation.from_quat(turned).inv() * Rotation.from_quat(quaternions)).magnitude()
    assert apart.max() < 1e-8


def test_joints_in_any_order_and_in_messages_of_their_own(tmp_path):
    """The pan comes at half the rate from another controller; a gripper's joint is left out."""
    joints, rows = sweep(), []
    for row, (stamp, values) in enumerate(zip(stamps_ns(TIMES_S), joints, strict=True)):
        others = (*JOINTS[:0:-1], 'gripper')
        rows.append(('/joint_states', stamp, others, [*values[:0:-1], 0.4]))
        if row % 2 == 0:
            rows.append(('/joint_states', stamp, ('shoulder_pan',), values[:1]))
    # The pan is even in time, so that what is interpolated is exact.
    assert np.allclose(read_joints(tmp_path, rows).positions_m, tip_poses(joints)[0], atol=1e-9)
    # Another order from some message on.
    rows = rows_of()
    rows[70:] = [(*row[:2], JOINTS[::-1], row[3][::-1]) for row in rows[70:]]
    read = read_joints(tmp_path / 'again', rows)
    assert np.allclose(read.positions_m, tip_poses(joints)[0], atol=1e-9)
    assert read.warnings == ()


def test_another_link_and_another_base(tmp_path):
    bag = joint_bag(tmp_path / 'run.bag', rows_of(), 'ros1')
    given = {'urdf': str(URDF), 'tip_link': 'wrist_roll_link', 'base_link': 'shoulder_pan_link'}
    read = read_recording(bag, **given, frame_id='shoulder_pan_link')
    assert np.array_equal(read.stamps_ns, stamps_ns(TIMES_S))
    assert read.frame_id == 'shoulder_pan_link'
    (note,) = read.notes
    assert "pose of 'wrist_roll_link' in 'shoulder_pan_link' by arm.urdf" in note
    joints = sweep()
    joints[:, 0] = 0.0  # the base turns along
    position, quaternion = tip_poses(joints)
    back = Rotation.from_quat(quaternion).apply([0, 0, TIP_M[0] - 1.05])
    assert np.allclose(read.positions_m, position - back - [0, 0, 0.4], atol=1e-9)


def test_joints_that_are_not_recorded_or_never_known_together_are_named(tmp_path):
    with pytest.raises(RecordingError, match=r'has nothing of wrist_roll of arm\.urdf'):
        read_joints(tmp_path / 'few', rows_of(sweep()[:, :5], JOINTS[:5]))
    rows = [('/arm', stamp, JOINTS[1:], joints[1:]) for _, stamp, _, joints in rows_of()[:70]]
    rows += [('/pan', stamp, JOINTS[:1], joints[:1]) for _, stamp, _, joints in rows_of()[80:]]
    with pytest.raises(RecordingError, match=r'elbow on /arm until .*, shoulder_pan on /pan'):
        read_joints(tmp_path, rows)


ONE_JOINT = (
    '<robot name="a"><link name="base"/><link name="tool0"/><joint name="j" type="revolute">'
    '<parent link="base"/><child link="tool0"/><axis xyz="{axis}"/>'
    '<limit lower="-1" upper="1" velocity="{speed}"/></joint></robot>'
)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('<robot name="a"><link name="b"/></robot>', 'has no'),
        ('<robot name="a"><link name="tool0"/>', 'is no URDF'),
        (ONE_JOINT.format(axis='0 0 1', speed=1).replace('revolute', 'fixed'), 'no joint between'),
        ('nothing', 'is no URDF'),
        ('<robot xmlns:xacro="http://x"><xacro:include/></robot>', 'is xacro; run: xacro'),
        (ONE_JOINT.format(axis='0 0 0', speed=1), "axis of joint 'j' is 0 0 0; give one"),
        (ONE_JOINT.format(axis='0 0 1', speed='fast'), "velocity of joint 'j' is 'fast'; give a"),
        (ONE_JOINT.format(axis='0 0 1', speed='nan'), "velocity of joint 'j' is 'nan'; give a"),
    ],
)
def test_what_is_no_robot_is_refused(text, words, file):
    with pytest.raises(RecordingError, match=words):
        _ = Robot.read(file('robot.urdf', text), tip='tool0').arm


def test_joint_states_that_are_not_used_are_counted(tmp_path):
    rows = rows_of()
    rows[10] = (*rows[10][:3], np.full(6, np.nan))
    rows[20] = (*rows[20][:3], [])
    rows[30] = ('/joint_states', rows[29][1], *rows[30][2:])
    rows[140:] = [(*row[:2], (*JOINTS, 'gripper'), [*row[3], 0.1]) for row in rows[140:]]
    read = read_joints(tmp_path, rows)
    assert len(read) == 137
    assert np.isfinite(read.positions_m).all()
    told = [warning.split(' joint states on /joint_states ', 1) for warning in read.warnings]
    assert {why: count.split(': ')[-1] for count, why in told} == {
        'with joints that are not finite: left out': '1',
        'without a position for each joint: left out': '1',
        'stamped no later than one before: left out': '1',
        'with another set of joints than most: left out': '11',
    }


def test_joints_and_transforms_that_start_again_are_refused_and_named(tmp_path):
    """A single one that comes late by more than a second is none of another stream."""
    made, again = Messages(), 'the stamps start again 3.020 s after its first message; cut the bag'
    joints = [(t, made.joints(t, names, at)) for _, t, names, at in rows_of()]
    transforms = [
        (t, made.transforms((t, 'world', 'tool0', [*place, *turn])))
        for t, place, turn in zip(stamps_ns(TIMES_S), *tip_poses(sweep()), strict=True)
    ]
    for topic, messages, options in (
        ('/joint_states', joints, {'urdf': str(URDF)}),
        ('/tf', transforms, {'tf': ['world', 'tool0']}),
    ):
        # As from a log that is played in a loop.
        both = [message for _, message in messages] * 2
        entries = [(topic, 20_000_000 * row, message) for row, message in enumerate(both, start=1)]
        folder = write_bag(tmp_path / f'{topic[1:]}_twice', entries)
        assert again in refusal(RecordingError, read_recording, folder, **options)
        with open_bag(folder) as bag:
            (source,) = sources_of_poses(bag, 0.25)
        assert source.quality is None
        assert again in source.faults[0]
        late = [*messages[:100], messages[20], *messages[100:]]
        entries = [(topic, row, message) for row, (_, message) in enumerate(late)]
        read = read_recording(write_bag(tmp_path / f'{topic[1:]}_late', entries), **options)
        assert np.allclose(read.positions_m, tip_poses(sweep())[0], atol=1e-9)


TYPES = {
    'cell_msgs/msg/Valve': 'bool open\nfloat64 pressure_bar\nstring label\n',
    'cell_msgs/msg/Io': 'int32[] states\nfloat64 level\nuint8 word\ncell_msgs/Valve[2] valves\n',
    'cell_msgs/msg/Stamped': 'std_msgs/Header header\nint16 brush\n',
}
PASS = straight_pass(triggers=False)
# The gun opens with the 10th pose and closes with the 40th.
ON = np.zeros(len(PASS), dtype=bool)
ON[10:40] = True


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """The pass, and the cell's signals at every pose, logged as the pose is stamped."""
    messages, entries = Messages(state_types=TYPES), pose_entries(PASS)
    types = messages.store.types
    valve = types['cell_msgs/msg/Valve']
    for stamp, on in zip(PASS.stamps_ns.tolist(), ON.tolist(), strict=True):
        io = types['cell_msgs/msg/Io'](
            np.array([7, 0, 3, 5 if on else 0], np.int32), 23.8 if on else 0.4, 1 if on else 0,
            [valve(False, 0.0, 'off'), valve(on, 3.1 if on else np.nan, 'needle')],
        )  # fmt: skip
        brush = types['cell_msgs/msg/Stamped'](messages.header(stamp), 2 if on else 0)
        entries += [
            ('/io', stamp, io),
            ('/brush', stamp + 7_000_000_000, brush),
            ('/valve/pressure', stamp, types['std_msgs/msg/Float64'](3.0 if on else 0.0)),
            ('/closed', stamp, types['std_msgs/msg/Int32'](0 if on else 1)),
            ('/shut', stamp, types['std_msgs/msg/Bool'](not on)),
        ]
    folder = tmp_path_factory.mktemp('cell') / 'run'
    return write_bag(folder, entries, 'sqlite3', messages)


@pytest.mark.parametrize(
    ('trigger', 'said'),
    [
        ('/io.states[3]', 'trigger /io.states[3] is 0 to 5: the gun is on where it is above 0'),
        ('/io.level > 12', 'trigger /io.level is 0.4 to 23.8: the gun is on where it is above 12'),
        ('/io.valves[1].open', 'trigger /io.valves[1].open is 0 to 1'),
        ('/valve/pressure', 'trigger /valve/pressure is 0 to 3'),
        ('/closed < 1', 'the gun is on where it is below 1'),
        ('/shut < 1', 'trigger /shut is 0 to 1: the gun is on where it is below 1'),
    ],
)
def test_a_number_in_any_field_opens_the_gun(trigger, said, bag):
    read = read_recording(bag, None, trigger)
    rows = np.searchsorted(read.trigger_stamps_ns, PASS.stamps_ns, side='right') - 1
    assert np.array_equal(read.trigger_flow[rows] > 0.0, ON)
    (note,) = read.notes
    assert said in note


def test_values_that_are_no_number_are_left_out_and_counted(bag):
    read = read_recording(bag, state_topic='/io.valves[1].pressure_bar')
    assert len(read.trigger_flow) == ON.sum()
    assert '20 values that are no number are left out' in read.notes[0]


def test_the_run_of_a_part_keeps_the_order_in_which_its_states_came(tmp_path):
    stamps = PASS.stamps_ns[[0, 10]]
    told = replace(PASS, trigger_stamps_ns=stamps, trigger_flow=np.array([0.5, 1.0]))
    for custom_data, rows in ({'serial': '1'}, [0, 10]), ({}, []):
        bag = write_pose_bag(tmp_path / f'run_{len(rows)}', told, custom_data)
        for path in (bag, *bag.glob('*.mcap')):
            read = read_recording(path, state_topic='/atomizer/state')
            assert read.trigger_stamps_ns.tolist() == stamps.tolist()
            assert read.trigger_rows.tolist() == rows


BELL = [0.0, 0.02, 0.31, *Rotation.from_euler('y', 0.3).as_quat()]


def tf_bag(path, storage='mcap'):
    """A rail (0.1 m/s, 5 Hz) with an arm (50 Hz) and a bell: world -> rail -> tool0 -> bell."""
    messages = Messages(ros1=storage == 'ros1')
    positions, quaternions = tip_poses(sweep())
    stamps = stamps_ns(TIMES_S)
    entries = [('/tf_static', stamps[0], messages.transforms((0, 'tool0', 'bell', BELL)))]
    for row, stamp in enumerate(stamps.tolist()):
        pose = (stamp, 'rail', '/tool0', [*positions[row], *quaternions[row]])
        rail = (stamp, 'world', 'rail', [0.1 * TIMES_S[row], 0, 0.1, 0, 0, 0, 1])
        rows = [pose, rail] if row % 10 == 0 else [pose]
        entries.append(('/tf', stamp, messages.transforms(*rows)))
    return write_bag(path, entries, storage, messages)


def test_the_bell_in_the_world_is_the_product_along_the_tree(tmp_path):
    bag = tf_bag(tmp_path / 'run.bag', 'ros1')
    read = read_recording(bag, tf=['world', 'bell'], frame_id='world')
    positions, quaternions = tip_poses(sweep())
    bell, turn = Rigid.of(BELL), Rotation.from_quat(quaternions)
    at = positions + turn.apply(bell.translation_m) + [0, 0, 0.1]
    at[:, 0] += 0.1 * TIMES_S
    assert np.array_equal(read.stamps_ns, stamps_ns(TIMES_S))
    assert np.allclose(read.positions_m, at, atol=1e-6)
    turned = turn * Rotation.from_quat(bell.quaternion_xyzw)
    apart = turned.inv() * Rotation.from_quat(read.quaternions_xyzw)
    assert apart.magnitude().max() < 1e-6
    (note,) = read.notes
    assert "pose of 'bell' in 'world', 151 poses" in note
    assert 'interpolated over up to 0.2 s' in note


MISSING = {
    'joints': [
        ({}, 'name a pose topic; it has no PoseStamped topic; it has joint states (give urdf)'),
        ({'urdf': str(URDF), 'tip_link': 'tool1'}, "has no link 'tool1'; did you mean 'tool0'?"),
        ({'urdf': str(URDF), 'base_link': 'tool0', 'tip_link': 'base_link'}, 'does not hang on'),
        ({'urdf': str(URDF), 'tf': ['a', 'b']}, 'leave one of them out'),
        ({'urdf': str(URDF), 'pose_topic': '/joints'}, 'no topic /joints; its JointState topics'),
        ({'urdf': str(URDF), 'frame_id': 'door'}, "in frame 'base_link', the mesh in 'door'"),
    ],
    'signals': [
        ({'state_topic': '/io'},
         'is cell_msgs/msg/Io; name one of its fields: /io.states[0] /io.states[1]'),
        ({'state_topic': '/io.state[3]'},
         "no number or Bool at .state[3]; did you mean '/io.states[3]'?"),
        ({'state_topic': '/io.valves[1].label'}, 'no number or Bool at .valves[1].label'),
        ({'state_topic': '/oi.word'}, 'has no topic /oi.word'),
        ({'state_topic': '/io.level > 1e'}, "'1e' is no number"),
    ],
    'frames': [
        ({'tf': ['world', 'bel']}, "no frame 'bel' in its transforms; did you mean 'bell'?"),
        ({'tf': ['tool0', 'bell']}, "'bell' does not move in 'tool0'"),
    ],
}  # fmt: skip


@pytest.mark.parametrize('kind', MISSING)
def test_what_is_not_in_a_bag_is_refused_with_what_there_is(kind, bag, tmp_path):
    path = tmp_path / 'run'
    if kind != 'signals':
        bag = joint_bag(path, rows_of()[:3]) if kind == 'joints' else tf_bag(path)
    for given, words in MISSING[kind]:
        assert words in refusal(RecordingError, read_recording, bag, **given)
