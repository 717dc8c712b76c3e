"""Logs in the form in which drivers of ABB robots give them: one motion of one arm in each."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import paint_deposition as pd
from files.recorded import Messages, write_bag
from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.pose_topics import sources_of_poses
from paint_deposition.motion.path_builder import PathBuilder, spray_path
from paint_deposition.motion.pose_stream import PoseBatch
from robot_arm import sweep, tip_poses
from scenes import stamps_ns

TIMES_S = np.linspace(0.0, 3.0, 751)
STAMPS = stamps_ns(TIMES_S)
SWEEP = sweep(len(TIMES_S))
POSITIONS, QUATERNIONS = tip_poses(SWEEP)
RAIL_M = np.linspace(0.0, 0.6, len(TIMES_S))
ABB_JOINTS = [f'joint_{k}' for k in range(1, 7)]
# The arm with ABB's names of joints, and with the rail that it may stand on.
ROBOTS = Path(__file__).with_name('robots')
LAG_NS = 12_000_000


def joints(topic, names, values, every=1, times=1):
    """Each ``every``-th row on a topic, each value sent ``times`` times with a new stamp."""

    def entries(messages):
        return [
            (topic, STAMPS[row], messages.joints(STAMPS[row], names, values[row - row % times]))
            for row in range(0, len(values), every)
        ]

    return entries


def poses(topic, kind, scale=1.0, frame_id='base_link'):
    """The arm's poses as messages of a type."""

    def entries(messages):
        make, made = messages.store.types, []
        for stamp, position, quaternion in zip(
            STAMPS, scale * POSITIONS, QUATERNIONS, strict=True
        ):
            stamped = messages.pose(stamp, position, quaternion, frame_id)
            head = stamped.header
            covered = make['geometry_msgs/msg/PoseWithCovariance'](stamped.pose, np.zeros(36))
            if kind == 'PoseStamped':
                message = stamped
            elif kind == 'PoseWithCovarianceStamped':
                message = make['geometry_msgs/msg/PoseWithCovarianceStamped'](head, covered)
            elif kind == 'TransformStamped':
                row = (stamp, frame_id, 'bell', [*position, *quaternion])
                message = messages.transforms(row).transforms[0]
            else:
                still = make['geometry_msgs/msg/Vector3'](0.0, 0.0, 0.0)
                twist = make['geometry_msgs/msg/Twist'](still, still)
                moved = make['geometry_msgs/msg/TwistWithCovariance'](twist, np.zeros(36))
                message = make['nav_msgs/msg/Odometry'](head, 'bell', covered, moved)
            made.append((topic, stamp, message))
        return made

    return entries


def bag(path, *streams):
    messages = Messages()
    rows = (row for stream in streams for row in stream(messages))
    entries = [(topic, stamp + LAG_NS, message) for topic, stamp, message in rows]
    return write_bag(path, sorted(entries, key=lambda entry: entry[1]), 'mcap', messages)


def egm_log(path):
    """What ``EGMLogger`` writes: ms, mm and degrees; measured, planned and asked for."""
    quaternion, none = QUATERNIONS[:, [3, 0, 1, 2]], 0.0 * TIMES_S
    own = {f'POS_RJ{k + 1}': column for k, column in enumerate(np.degrees(SWEEP).T)}
    own |= {f'POS_EJ{k}': none for k in range(1, 7)}
    own |= {f'POS_{axis}': 1e3 * POSITIONS[:, k] for k, axis in enumerate('XYZ')}
    own |= {f'EULER_{axis}': none for axis in 'XYZ'}
    own |= {f'QUAT_U{k}': quaternion[:, k] for k in range(4)}
    own |= {f'VEL_{kind}': none for kind in ('RJ1', 'EJ1', 'LX', 'LY', 'LZ', 'AX', 'AY', 'AZ')}
    columns = {'TIMESTAMP': np.round(1e3 * TIMES_S)}
    for group, scale in {'R_FB': 1.0, 'R_PL': 1.1, 'S_REF': 0.0}.items():
        columns |= {f'{group}_{name}': scale * column for name, column in own.items()}
    return table(path, columns)


def program_log(path):
    """What abb_motion_program_exec logs: seconds, the command's number, degrees."""
    columns = {'timestamp': TIMES_S, 'cmdnum': 0.0 * TIMES_S + 2}
    return table(path, columns | {f'J{k + 1}': np.degrees(SWEEP[:, k]) for k in range(6)})


def table(path, columns):
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, '%.9g', ',', header=','.join(columns), comments='')
    return path


EGM = joints('/egm/joint_states', ABB_JOINTS, SWEEP)
PREFIXED = joints('/egm/joint_states', [f'irb_{name}' for name in ABB_JOINTS], SWEEP)
UNSCORED = [name.replace('_', '') for name in ABB_JOINTS]
DEGREES = joints('/arm_JointState', UNSCORED, np.degrees(SWEEP))
RAIL = joints('/rail/joint_states', ['rail'], RAIL_M[:, None], every=2)
RAIL_MM = joints('/rail/joint_states', ['rail'], 1e3 * RAIL_M[:, None], every=2)
MILLIMETRES = poses('/arm_PoseStamped', 'PoseStamped', 1e3, '')
BOTH = (EGM, joints('/joint_states', ABB_JOINTS, SWEEP, every=5))
# What was recorded, the options that read it, and what is said without the last of them.
DRIVERS = {
    'abb_ros2': ((EGM,), {'urdf': 'arm'}, 'give urdf'),
    'prefix': ((PREFIXED,), {'urdf': 'arm', 'joint_prefix': 'irb_'}, 'give --joint-prefix'),
    'degrees': ((DEGREES,), {'urdf': 'arm', 'angle_unit': 'deg'}, 'give --angle-unit deg'),
    'rail': ((EGM, RAIL), {'urdf': 'railed'}, 'give urdf'),
    'rail in mm': ((EGM, RAIL_MM), {'urdf': 'railed', 'pose_unit': 'mm'}, ''),
    'named topics': (BOTH, {'urdf': 'arm', 'pose_topic': '/egm/joint_states'},
                     '--pose-topic /egm/joint_states'),
    'millimetres': ((MILLIMETRES,), {'pose_unit': 'mm'}, ''),
    'odometry': ((poses('/odom', 'Odometry'),), {}, ''),
    'covariance': ((poses('/pose', 'PoseWithCovarianceStamped'),), {}, ''),
    'transform': ((poses('/vicon/bell', 'TransformStamped'),), {}, ''),
    'abb_libegm': (egm_log, {}, ''),
    'abb_libegm joints': (egm_log, {'urdf': 'arm'}, ''),
    'abb_motion_program_exec': (program_log, {'urdf': 'arm', 'angle_unit': 'deg'},
                                'give --angle-unit deg'),
}  # fmt: skip


@pytest.mark.parametrize('driver', DRIVERS)
def test_each_driver_gives_the_motion_of_the_arm(driver, tmp_path):
    streams, given, words = DRIVERS[driver]
    log = streams(tmp_path / 'log.csv') if callable(streams) else bag(tmp_path / 'log', *streams)
    options = {k: str(ROBOTS / f'{v}.urdf') if k == 'urdf' else v for k, v in given.items()}
    read = pd.read_recording(log, **options)
    assert len(read) == len(TIMES_S) - ('rail' in driver and len(TIMES_S) % 2 == 0)
    moved = POSITIONS + [0.0, 1.0, 0.0] * RAIL_M[:, None] if 'rail' in driver else POSITIONS
    assert np.allclose(read.positions_m, moved, atol=1e-7)
    turned = np.abs(np.sum(read.quaternions_xyzw * QUATERNIONS, axis=1))
    assert np.allclose(turned, 1.0, atol=1e-8)
    assert np.allclose(1e-9 * (read.stamps_ns - read.stamps_ns[0]), TIMES_S, atol=1e-6)
    assert not [line for line in read.warnings if 'samples' in line]
    if words:
        options.popitem()
        with pytest.raises(RecordingError, match=words):
            pd.read_recording(log, **options)


@pytest.mark.parametrize(
    ('stream', 'words'),
    [
        (joints('/rws', ABB_JOINTS, SWEEP, every=50),
         '/rws: only 5 samples a second: .* 20 cm at 1 m/s, .* polling_rate'),
        (joints('/rws', ABB_JOINTS, SWEEP, times=3),
         '/rws: 480 of 751 samples repeat .* dropped, and 83.3 a second'),
        (MILLIMETRES, '/arm_PoseStamped: its positions reach 1277 .* give --pose-unit mm'),
    ],
)  # fmt: skip
def test_what_was_taken_in_silence_is_told(stream, words, tmp_path):
    given = {} if stream is MILLIMETRES else {'urdf': str(ROBOTS / 'arm.urdf')}
    read = pd.read_recording(bag(tmp_path / 'run', stream), **given)
    (told,) = (line for line in read.warnings if line.startswith(('/rws: ', '/arm_')))
    assert re.match(words, told)


def test_repeated_poses_leave_the_speed_of_the_gun_and_the_same_path_live():
    """Two and three times in turns, as of a loop that asks more often than the robot answers."""
    kept = np.cumsum(np.arange(len(TIMES_S)) % 5 % 2 == 0) - 1
    rows = np.searchsorted(kept, kept)
    path, counts = spray_path(pd.Trajectory(STAMPS, POSITIONS[rows], QUATERNIONS[rows]))
    assert counts.repeated_samples > 0.3 * len(TIMES_S)
    late = path.time_s > 0.5
    speed = np.linalg.norm(path.velocity_m_per_s, axis=1)[late]
    true = np.linalg.norm(np.diff(POSITIONS, axis=0), axis=1).max() / 0.004
    assert speed.min() > 0.5 * true
    assert speed.max() < 1.7 * true
    live = PathBuilder()
    for part in np.array_split(np.arange(len(rows)), 60):
        live.add_poses(PoseBatch(STAMPS[part], POSITIONS[rows[part]], QUATERNIONS[rows[part]]))
    again = live.take(finish=True)
    assert live.screen.counts == counts
    assert np.array_equal(again.position_m, path.position_m)


def test_inspect_says_of_each_source_whether_it_will_do_and_how(tmp_path):
    run = bag(
        tmp_path / 'run', MILLIMETRES, DEGREES, poses('/odom', 'Odometry'),
        joints('/slow', ABB_JOINTS, SWEEP, every=50),
        joints('/twice', ABB_JOINTS, SWEEP, times=2),
    )  # fmt: skip
    with open_bag(run) as opened:
        found = {source.topic: source for source in sources_of_poses(opened, 0.25)}
    assert {topic: source.unit for topic, source in found.items()} == {
        '/arm_PoseStamped': 'mm', '/arm_JointState': 'deg', '/odom': 'm',
        '/slow': 'rad', '/twice': 'rad',
    }  # fmt: skip
    assert 'only 5 samples' in found['/slow'].faults[0]
    assert found['/twice'].quality.repeated_samples == 355
    assert found['/twice'].quality.new_rate_hz == pytest.approx(125.0)
    assert found['/odom'].quality.lag_s == pytest.approx(0.012)
    assert (found['/arm_PoseStamped'].frame_id, found['/odom'].frame_id) == ('', 'base_link')
    for source in found.values():
        if source.quality:
            words = shlex.split(source.options.replace('ROBOT', str(ROBOTS / 'arm.urdf')))
            options = {k[2:].replace('-', '_'): v for k, v in zip(*[iter(words)] * 2, strict=True)}
            ends = pd.read_recording(run, **options).positions_m[[0, -1]]
            assert np.allclose(ends, POSITIONS[[0, -1]], atol=2e-3)
