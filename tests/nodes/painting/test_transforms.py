"""Poses in frames of the cell: those that wait for their transform, and a part on a conveyor."""

import importlib.util

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nodes.cell import START_NS, Broadcaster, offline_um, two_passes
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import STATE_TOPIC
from paint_deposition.motion.transforms import Rigid

MOTION = two_passes(poses=600)
POSE_TOPIC = '/atomizer/pose'
CAMERA = Rigid.of([0.3, -0.2, 0.7, *Rotation.from_euler('xyz', [0.3, 0.5, 0.7]).as_quat()])
LAST_NS = int(MOTION.stamps_ns[-1])
TF_NS = range(START_NS - 20_000_000, LAST_NS + 40_000_000, 20_000_000)


def place(stamp_ns: int) -> Rigid:
    """Of the part: along the cell's x at 0.2 m/s, turning evenly."""
    at_s = 1e-9 * (stamp_ns - START_NS)
    return Rigid.of([1.0 + 0.2 * at_s, 0.3, 0.5, *Rotation.from_euler('z', 0.4 * at_s).as_quat()])


@pytest.mark.skipif(
    importlib.util.find_spec('tf2_msgs') is None, reason='tf2_msgs comes with a ROS installation'
)
@pytest.mark.parametrize('silent_s', [(), (0.5, 0.9), (0.1, 2.3)])
def test_the_recorded_run_of_a_conveyor_has_the_film_that_was_seen(
    silent_s, ros_context, spin, simulator, robot, record, wait_until
):
    """Transforms come after the poses of their time, and not at all while the driver restarts."""
    node, recorder, driver = simulator(), record(), Broadcaster(ros_context)
    spin(driver)
    source = robot(node)
    wait_until(lambda: source.has_subscribers(2) and driver.has_subscribers(2), what='discovery')
    driver.send(START_NS, static=True, world_to_camera=CAMERA)
    quiet = [START_NS + int(1e9 * at_s) for at_s in silent_s] or [0, 0]
    sent = [stamp for stamp in TF_NS if not quiet[0] < stamp < quiet[1]]
    row = 0
    for stamp, following in zip(sent, [*sent[1:], LAST_NS + 1], strict=True):
        rows = range(row, int(np.searchsorted(MOTION.stamps_ns, following)))
        row = rows.stop
        for each in rows:
            at_ns = int(MOTION.stamps_ns[each])
            for changed_ns, *gun in MOTION.triggers:
                if at_ns - 4_000_000 < changed_ns <= at_ns:
                    source.send_state(changed_ns, *gun)
            pose = MOTION.positions_m[each], MOTION.quaternions_xyzw[each]
            source.send_pose(at_ns, *(CAMERA.inverse() @ place(at_ns)).applied(*pose), 'camera')
        driver.send(stamp, world_to_part=place(stamp))
    gun = node.inputs[0]
    wait_until(lambda: gun.poses_received == len(MOTION) and not gun.tf_queue, what='all poses')
    node.catch_up()
    film = node.film.snapshot().film_um
    counts = recorder.run.counts
    wait_until(lambda: (counts[POSE_TOPIC], counts['/tf']) == (len(MOTION), len(sent)))
    recorder.close()
    read = read_recording(recorder.run.folder, state_topic=STATE_TOPIC)
    assert np.array_equal(offline_um(node, read), film)
    lost = len(MOTION) - len(read)
    assert gun.poses_refused == lost
    if quiet[1] - quiet[0] > 2_000_000_000:
        assert lost == pytest.approx(550, abs=10)
        assert 'tf has none for 2.2' in gun.refusal
    else:
        still = offline_um(node, MOTION)
        assert np.abs(film - still).max() < 1e-3 * still.max()
        assert not lost
