"""A run whose poses are not in the part's frame: recorded, used without the nodes, replayed."""

import importlib.util
import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters

import paint_deposition as pd
from nodes.cell import offline_um, parameters, two_passes
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.nodes.bags.bag_player import BagPlayer
from paint_deposition.nodes.runtime.topics import header

MOTION = two_passes(poses=200, trigger=False)
# The part hangs turned by 90 degrees about z, a metre along the cell's x.
PART_POSE = [1.0, 0.0, 0.5, 0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)]
SET_PARAMETERS = '/deposition_simulator/set_parameters'
HAS_TF = importlib.util.find_spec('tf2_msgs') is not None


def in_the_cell() -> pd.Trajectory:
    poses = Rigid.of(PART_POSE).applied(MOTION.positions_m, MOTION.quaternions_xyzw)
    return pd.Trajectory(MOTION.stamps_ns, *poses, 'base_link')


@pytest.fixture
def recorded(simulator, record, robot, painted, wait_until):
    """A run of poses in `base_link`, and the film that the simulator had of it."""
    node = simulator(part_pose=PART_POSE, part_parent_frame='base_link')
    recorder = record()
    wait_until(lambda: '/part_pose' in recorder.run.counts, what='the pose of the part recorded')
    source = robot(node)
    # The recorder subscribes once it has found the publisher.
    wait_until(lambda: source.has_subscribers(2))
    source.send(in_the_cell(), frame_id='base_link')
    film = painted(node, len(MOTION))
    wait_until(lambda: recorder.run.counts['/atomizer/pose'] == len(MOTION), what='all recorded')
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
    replayed = painted(node, len(MOTION))
    assert np.array_equal(replayed, film)


def test_the_pose_of_the_part_is_unset_by_an_empty_list_of_any_kind(simulator, onlooker, call):
    node = simulator(part_pose=PART_POSE, part_parent_frame='base_link')
    viewer = onlooker()
    for kind in ('BYTE', 'BOOL', 'DOUBLE'):
        assert node.set_parameters(parameters(part_pose=PART_POSE))[0].successful
        assert node.frame.on_part(PoseStamped(header=header('base_link', 0))) is not None
        value = ParameterValue(type=getattr(ParameterType, f'PARAMETER_{kind}_ARRAY'))
        changes = [ParameterMessage(name='part_pose', value=value)]
        (result,) = call(viewer, SetParameters, SET_PARAMETERS, parameters=changes).results
        assert result.successful, result.reason
        assert list(node.values['part_pose']) == []
        assert list(node.get_parameter('part_pose').value) == []
