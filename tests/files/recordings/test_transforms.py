"""Motion and frames from the transforms of a bag."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from files.recorded import Messages, write_bag
from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_recording
from paint_deposition.motion.part_frame import Rigid
from robot_arm import sweep, tip_poses
from scenes import stamps_ns

TIMES_S = np.linspace(0.0, 3.0, 151)
BELL = [0.0, 0.02, 0.31, *Rotation.from_euler('y', 0.3).as_quat()]
RAIL = [0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0]


def tf_bag(path, storage='mcap'):
    """A rail that carries an arm with a bell: world -> rail -> tool0 -> bell.

    The rail goes evenly at 0.1 m/s and is published at 5 Hz, the arm at 50 Hz, the bell is static.
    """
    messages = Messages(ros1=storage == 'ros1')
    positions, quaternions = tip_poses(sweep())
    stamps = stamps_ns(TIMES_S)
    entries = [('/tf_static', stamps[0], messages.transforms((0, 'tool0', 'bell', BELL)))]
    for row, stamp in enumerate(stamps.tolist()):
        pose = (stamp, 'rail', '/tool0', [*positions[row], *quaternions[row]])
        rail = (stamp, 'world', 'rail', [0.1 * TIMES_S[row], *RAIL[1:]])
        rows = [pose, rail] if row % 10 == 0 else [pose]
        entries.append(('/tf', stamp, messages.transforms(*rows)))
    return write_bag(path, entries, storage, messages)


def expected_poses():
    """Of the bell in the world."""
    positions, quaternions = tip_poses(sweep())
    bell, turn = Rigid.of(BELL), Rotation.from_quat(quaternions)
    at = positions + turn.apply(bell.translation_m) + [0, 0, 0.1]
    at[:, 0] += 0.1 * TIMES_S
    return at, (turn * Rotation.from_quat(bell.quaternion_xyzw)).as_quat()


def test_the_bell_in_the_world_is_the_product_along_the_tree(tmp_path):
    bag = tf_bag(tmp_path / 'run.bag', 'ros1')
    read = read_recording(bag, tf=['world', 'bell'], frame_id='world')
    positions, quaternions = expected_poses()
    assert np.array_equal(read.stamps_ns, stamps_ns(TIMES_S))
    assert np.allclose(read.positions_m, positions, atol=1e-6)
    apart = Rotation.from_quat(quaternions).inv() * Rotation.from_quat(read.quaternions_xyzw)
    assert apart.magnitude().max() < 1e-6
    (note,) = read.notes
    assert "pose of 'bell' in 'world', 151 poses" in note
    assert 'interpolated over up to 0.2 s' in note


@pytest.mark.parametrize(
    ('frames', 'words'),
    [
        (['world', 'bel'], "no frame 'bel' in its transforms; did you mean 'bell'?"),
        (['tool0', 'bell'], "'bell' does not move in 'tool0'"),
    ],
)
def test_frames_that_are_not_there_or_do_not_move_are_refused(frames, words, tmp_path):
    with pytest.raises(RecordingError) as refused:
        read_recording(tf_bag(tmp_path / 'run'), tf=frames)
    assert words in str(refused.value)
