"""Runs whose poses are not in the part's frame: recorded, used without the nodes, replayed."""

import importlib.util
import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from scipy.spatial.transform import Rotation

import paint_deposition as pd
from nodes.cell import START_NS, Broadcaster, offline_um, parameters, two_passes
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import STATE_TOPIC
from paint_deposition.motion.transforms import Rigid, moved
from paint_deposition.nodes.bags.bag_player import BagPlayer
from paint_deposition.nodes.topics import header

PASSES = two_passes(poses=200, trigger=False)
# The part hangs turned by 90 degrees about z, a metre along the cell's x.
PART_POSE = [1.0, 0.0, 0.5, 0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)]
HAS_TF = importlib.util.find_spec('tf2_msgs') is not None


@pytest.fixture
def recorded(simulator, record, robot, painted, wait_until):
    """A run of poses in `base_link`, and the film that the simulator had of it."""
    node = simulator(part_pose=PART_POSE, part_parent_frame='base_link')
    recorder = record()
    wait_until(lambda: '/part_pose' in recorder.run.counts, what='the pose of the part recorded')
    source = robot(node)
    # The recorder subscribes once it has found the publisher.
    wait_until(lambda: source.has_subscribers(2))
    source.send(moved(PASSES, Rigid.of(PART_POSE), 'base_link'), frame_id='base_link')
    film = painted(node, len(PASSES))
    wait_until(lambda: recorder.run.counts['/atomizer/pose'] == len(PASSES), what='all recorded')
    recorder.close()
    return recorder.run.folder, film


def test_it_is_simulated_with_the_recorded_pose_of_the_part(recorded, start, simulator, capfd):
    run, film = recorded
    read = pd.read_recording(run)
    assert read.frame_id == 'part'
    assert "'base_link' to 'part'" in read.notes[-1]
    assert film.max() > 2.0
    node = simulator()
    offline = offline_um(node, read)
    assert np.array_equal(offline, film)
    if HAS_TF:
        return
    # The player names the simulator's parameters to set.
    start(BagPlayer, bag=str(run), start_paused=True)
    said = capfd.readouterr().err
    assert "part_parent_frame: 'base_link' and part_pose: [1, 0, 0.5, 0, 0, 0.70710" in said


@pytest.mark.skipif(not HAS_TF, reason='needs tf2_msgs')
def test_its_replay_brings_the_transforms_along(recorded, start, executor, simulator, painted):
    run, film = recorded
    for node in executor.get_nodes():
        executor.remove_node(node)
        node.destroy_node()
    node = simulator()
    start(BagPlayer, bag=str(run), rate=0.0)
    replayed = painted(node, len(PASSES))
    assert np.array_equal(replayed, film)


def test_the_pose_of_the_part_is_unset_by_an_empty_list_of_any_kind(simulator, onlooker, call):
    node = simulator(part_pose=PART_POSE, part_parent_frame='base_link')
    viewer = onlooker()
    for kind in ('BYTE', 'BOOL', 'DOUBLE'):
        assert node.set_parameters(parameters(part_pose=PART_POSE))[0].successful
        assert node.frame.on_part(PoseStamped(header=header('base_link', 0))) is not None
        value = ParameterValue(type=getattr(ParameterType, f'PARAMETER_{kind}_ARRAY'))
        changes = [ParameterMessage(name='part_pose', value=value)]
        service = SetParameters, '/deposition_simulator/set_parameters'
        (result,) = call(viewer, *service, parameters=changes).results
        assert result.successful, result.reason
        assert list(node.values['part_pose']) == []
        assert list(node.get_parameter('part_pose').value) == []


MOTION = two_passes(poses=600)
CAMERA = Rigid.of([0.3, -0.2, 0.7, *Rotation.from_euler('xyz', [0.3, 0.5, 0.7]).as_quat()])
LAST_NS = int(MOTION.stamps_ns[-1])
TF_NS = range(START_NS - 20_000_000, LAST_NS + 40_000_000, 20_000_000)


def place(stamp_ns: int) -> Rigid:
    """Of the part: along the cell's x at 0.2 m/s, turning evenly."""
    at_s = 1e-9 * (stamp_ns - START_NS)
    return Rigid.of([1.0 + 0.2 * at_s, 0.3, 0.5, *Rotation.from_euler('z', 0.4 * at_s).as_quat()])


@pytest.mark.skipif(not HAS_TF, reason='needs tf2_msgs')
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
    wait_until(lambda: (counts['/atomizer/pose'], counts['/tf']) == (len(MOTION), len(sent)))
    recorder.close()
    read = read_recording(recorder.run.folder, state_topic=STATE_TOPIC)
    assert np.array_equal(offline_um(node, read), film)
    lost = len(MOTION) - len(read)
    assert gun.refused_frames.total() == lost
    if quiet[1] - quiet[0] > 2_000_000_000:
        assert lost == pytest.approx(550, abs=10)
        assert 'tf has none for 2.2' in gun.refusal
    else:
        still = offline_um(node, MOTION)
        assert np.abs(film - still).max() < 1e-3 * still.max()
        assert not lost
