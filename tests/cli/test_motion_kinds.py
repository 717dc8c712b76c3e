"""One motion of a six-axis arm in every kind of file: one film."""

import json

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import paint_deposition as pd
from files.recorded import Messages, write_bag
from paint_deposition.files.rapid.program import module_text
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.motion.programmed import PROGRAMMED, Move
from paint_deposition.motion.trajectory import Trajectory
from robot_arm import JOINTS, sweep, tip_poses, urdf
from scenes import stamps_ns

TIMES_S = np.linspace(0.0, 3.0, 301)
STAMPS = stamps_ns(TIMES_S)
JOINT_VALUES = sweep(len(TIMES_S))
POSITIONS, QUATERNIONS = tip_poses(JOINT_VALUES)
MIDDLE = len(TIMES_S) // 2
# The panel stands where the bell looks in the middle of its way, a standoff before it.
TURN = Rotation.from_quat(QUATERNIONS[MIDDLE])
PART_AT = POSITIONS[MIDDLE] + TURN.apply([0.0, 0.0, 0.25])
PART_POSE = [*PART_AT, *TURN.as_quat()]
OPENS, CLOSES = 60, 240
ON = np.zeros(len(TIMES_S), dtype=bool)
ON[OPENS:CLOSES] = True


@pytest.fixture(scope='module')
def panel(tmp_path_factory):
    """A panel of 0.8 m by 0.6 m in x and y, outward to -z."""
    corners = np.array([[-0.4, -0.3, 0], [0.4, -0.3, 0], [0.4, 0.3, 0], [-0.4, 0.3, 0]])
    path = tmp_path_factory.mktemp('panel') / 'panel.stl'
    trimesh.Trimesh(corners, [[0, 2, 1], [0, 3, 2]], process=False).export(path)
    return path


def pose_bag(folder):
    trigger = {
        'trigger_stamps_ns': STAMPS[[OPENS, CLOSES]], 'trigger_flow': np.array([1.0, 0.0])
    }  # fmt: skip
    poses = Trajectory(STAMPS, POSITIONS, QUATERNIONS, 'base_link', **trigger)
    return write_pose_bag(folder / 'poses', poses), {'state_topic': '/atomizer/state'}


def with_signal(messages):
    """The gun's signal as an integer among others of the cell, once with every pose."""
    make = messages.store.types['std_msgs/msg/Int32']
    return [
        ('/cell/gun', stamp, make(int(on)))
        for stamp, on in zip(STAMPS.tolist(), ON.tolist(), strict=True)
    ]


def joint_bag(folder):
    messages = Messages()
    entries = with_signal(messages)
    entries += [
        ('/joint_states', stamp, messages.joints(stamp, JOINTS, row))
        for stamp, row in zip(STAMPS.tolist(), JOINT_VALUES, strict=True)
    ]
    (folder / 'arm.urdf').write_text(urdf())
    bag = write_bag(folder / 'joints', entries, 'mcap', messages)
    urdf_file = str(folder / 'arm.urdf')
    return bag, {'urdf': urdf_file, 'tip_link': 'tool0', 'state_topic': '/cell/gun'}


def tf_bag(folder):
    messages = Messages()
    entries = with_signal(messages)
    entries += [
        ('/tf', stamp, messages.transforms((stamp, 'base_link', 'bell', [*place, *turn])))
        for stamp, place, turn in zip(STAMPS.tolist(), POSITIONS, QUATERNIONS, strict=True)
    ]
    bag = write_bag(folder / 'tf', entries, 'sqlite3', messages)
    return bag, {'tf': ['base_link', 'bell'], 'state_topic': '/cell/gun'}


def table(folder):
    turns = Rotation.from_quat(QUATERNIONS).as_rotvec()
    rows = np.column_stack([1e3 * TIMES_S, 1e3 * POSITIONS, turns, ON])
    text = '\n'.join(';'.join(f'{value:.8f}'.replace('.', ',') for value in row) for row in rows)
    path = folder / 'robot.csv'
    path.write_text(f't [ms];X [mm];Y [mm];Z [mm];RX [rad];RY [rad];RZ [rad];gun\n{text}\n')
    return path, {}


def moves():
    """Straight moves from pose to pose at their speeds, for what is programmed."""
    steps = np.linalg.norm(np.diff(POSITIONS, axis=0), axis=1) / np.diff(TIMES_S)
    speeds = np.append(steps[0], steps)
    rows = range(len(POSITIONS))
    return [
        Move(POSITIONS[k], QUATERNIONS[k], float(speeds[k]), bool(ON[max(k - 1, 0)])) for k in rows
    ]


def module(folder):
    path = folder / 'passes.mod'
    path.write_text(module_text(moves()))
    return path, {}


def passes(folder):
    rows = [
        [1, *move.position_m, *move.quaternion_xyzw, move.speed_m_per_s, int(move.spraying)]
        for move in moves()
    ]
    heading = 'pass,x_m,y_m,z_m,qx,qy,qz,qw,speed_m_per_s,spraying'
    text = '\n'.join(','.join(f'{value:.9g}' for value in row) for row in rows)
    path = folder / 'passes.csv'
    path.write_text(f'{heading}\n{text}\n')
    return path, {}


# The kind, and what its film may differ from that of the poses, as a share of the peak: angles
# with six digits, RAPID with 0.001 mm and 0.001 mm/s.
KINDS = {
    'joints': (joint_bag, 1e-5), 'tf': (tf_bag, 1e-5), 'table': (table, 1e-5),
    'module': (module, 1e-3), 'passes': (passes, 1e-3),
}  # fmt: skip


@pytest.fixture(scope='module')
def surface(panel):
    return pd.read_mesh(panel, max_edge_length_m=0.04)


def film_of(surface, motion, options) -> tuple[np.ndarray, pd.Trajectory]:
    recorded = pd.read_recording(motion, part_pose=PART_POSE, **options)
    return pd.simulate(surface, recorded).film_um, recorded


@pytest.fixture(scope='module')
def expected(surface, panel, tmp_path_factory):
    """The film of the recorded poses, and what the gauge should show of it."""
    film, _ = film_of(surface, *pose_bag(tmp_path_factory.mktemp('poses')))
    assert film.max() > 5.0
    return film, predicted(campaign_of(pose_bag, panel, tmp_path_factory.mktemp('expected')))


@pytest.mark.slow
@pytest.mark.parametrize('kind', KINDS)
def test_film_and_campaign_are_those_of_the_recorded_poses(
    kind, panel, surface, expected, tmp_path
):
    write, share = KINDS[kind]
    film, recorded = film_of(surface, *write(tmp_path))
    assert np.abs(film - expected[0]).max() < share * expected[0].max()
    assert (PROGRAMMED in recorded.notes) == (kind in ('module', 'passes'))
    again = tmp_path / 'campaign'
    again.mkdir()
    gauge_um = predicted(campaign_of(write, panel, again))
    assert np.abs(gauge_um - expected[1]).max() < share * gauge_um.max() + 1e-3


def campaign_of(write, panel, folder):
    """A campaign with readings of 10 µm on the panel, painted by that kind of motion."""
    motion, options = write(folder)
    lines = [f'{x:.2f},{y},0,10' for x in np.linspace(-0.2, 0.2, 9) for y in (-0.1, 0.1)]
    (folder / 'readings.csv').write_text('\n'.join(['x_m,y_m,z_m,thickness_um', *lines]))
    entry = {
        'name': 'panel', 'mesh': str(panel), 'trajectory': motion.name,
        'measurements': 'readings.csv', 'part_pose': [float(value) for value in PART_POSE],
        **options,
    }  # fmt: skip
    (folder / 'campaign.yaml').write_text(json.dumps({'experiments': [entry]}))
    return folder / 'campaign.yaml'


def predicted(campaign) -> np.ndarray:
    """(P,) what the gauge should show [um]."""
    return Forward(pd.read_campaign(campaign)).predict_um(pd.DepositionModel())
