"""The live film over real DDS."""

import time
from types import SimpleNamespace

import numpy as np
import trimesh
from geometry_msgs.msg import PoseStamped

from booth import centroid_m
from nodes.cell import offline_um, turned, two_passes
from nodes.processes import NodeProcess
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.model_file import write_model
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.nodes.painting.film_display import ACKNOWLEDGE_TIMEOUT_S
from paint_deposition.nodes.topics import AdaptiveSubscription, header_stamp_ns
from paint_deposition.part.surface import toward_the_guns

MOTION = two_passes()
STREAM = """
import time
from nodes.cell import Robot, two_passes
from rclpy.context import Context

context = Context()
context.init()
robot, motion = Robot(context), two_passes(trigger=False)
print('ready', flush=True)
while True:
    for first in range(0, len(motion), 10):
        robot.send(motion, slice(first, first + 10))
        time.sleep(0.005)
"""
LISTENER = """
import rclpy
from paint_msgs.msg import ThicknessField
rclpy.init()
node = rclpy.create_node('listener')
node.create_subscription(ThicknessField, 'thickness/field', lambda message: print('heard'), 10)
rclpy.spin(node)
"""


def test_the_gun_decides_which_side_of_a_solid_is_outward(simulator, robot, painted, tmp_path):
    """A plate of 12 mm that is painted on +x: booth air to the gun's right blows to +y."""
    aside_m = 0.06
    model = DepositionModel().with_effect(AirDrift(shift_across_m=aside_m))
    write_model(tmp_path / 'air.yaml', model)
    plate = tmp_path / 'plate.stl'
    trimesh.creation.box((0.012, 0.8, 0.8)).export(plate)
    motion = turned(MOTION, 90.0)
    still = simulator(mesh_file=str(plate))
    node = simulator(mesh_file=str(plate), model_file=str(tmp_path / 'air.yaml'))
    robot(still, node).send(motion)
    lies, lay = (centroid_m(painted(one), one.surface.points()) for one in (node, still))
    moved = lies - lay
    assert moved[1] > 0.2 * aside_m
    path, _ = spray_path(motion)
    motions = [(path.position_m, path.rotation[:, :, 2])]
    offline = toward_the_guns(read_mesh(plate, 1.0, 0.05), motions)
    np.testing.assert_array_equal(node.surface.outward, [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(offline.outward, node.surface.outward)
    seen = SimpleNamespace(points=offline.points(), surface=offline)
    assert np.array_equal(painted(node), offline_um(seen, motion, model))


def test_a_large_mesh_costs_a_robot_at_250_hz_no_pose(simulator, onlooker, wait_until, tmp_path):
    """100,000 triangles go out five times a second, to a subscriber, while poses come."""
    node = simulator(max_edge_length_m=0.0045, publish_rate_hz=5.0, pose_queue_depth=5000)
    assert len(node.surface.faces) > 100_000
    viewer = onlooker('thickness/mesh')
    motion = two_passes(poses=750, trigger=False)
    bag = write_pose_bag(tmp_path / 'motion', motion)
    with NodeProcess(tmp_path / 'player', 'bag_player', bag=bag) as replay:
        wait_until(lambda: replay.poll() is not None, what='the replay')
    wait_until(lambda: node.film.counts.received == len(motion), what='every pose painted')
    assert node.film.counts.rejected == 0
    assert node.inputs[0].steps.long == 0
    # Meshes of 12 MB reached the subscriber meanwhile, and the last one shows the last pose.
    meshes = viewer.heard['thickness/mesh']
    wait_until(lambda: header_stamp_ns(meshes[-1]) == motion.stamps_ns[-1], what='the last mesh')
    assert len({header_stamp_ns(mesh) for mesh in meshes}) > 3
    assert min(map(len, meshes)) > 120 * 100_000


def test_a_listener_that_stalls_gets_no_queue(simulated, painted, onlooker, wait_until, tmp_path):
    """Nobody is sent the next message before all have taken the last one, and none is lost."""
    node, source = simulated(publish_rate_hz=30.0)
    other = onlooker('thickness/field')
    with NodeProcess(tmp_path / 'listener', '', code=LISTENER) as listener:
        wait_until(lambda: 'heard' in listener.out, what='the listener')
        listener.stall()
        before, began_s = len(other.heard['thickness/field']), time.monotonic()
        for row in range(0, len(MOTION), 30):
            source.send(MOTION, slice(row, row + 30))
            painted(node, row + 30)
            node.publish()
        # Of 20 editions one may be on its way, and one for each time that patience ends.
        patience = (time.monotonic() - began_s) / ACKNOWLEDGE_TIMEOUT_S
        assert len(other.heard['thickness/field']) <= before + 2 + patience
        listener.go_on()
        film = painted(node).astype(np.float32)

        def newest() -> np.ndarray:
            return np.array(other.newest('thickness/field').thickness_um, np.float32)

        wait_until(lambda: np.array_equal(newest(), film), what='the newest film')


def test_who_sends_faster_than_it_takes_does_not_hold_the_node(simulator, robot):
    node = simulator()
    sender, taken = robot(node), []

    def take(message, _):
        taken.append(message)
        sender.pose_publisher.publish(message)

    topic = AdaptiveSubscription(node, PoseStamped, 'atomizer/pose', take, depth=10)
    until_s = time.monotonic() + 30.0
    while not taken and time.monotonic() < until_s:
        sender.pose_publisher.publish(PoseStamped())
        topic.take_pending()
    assert 1 <= len(taken) <= 10


def test_no_pose_is_left_out_while_it_activates_itself(
    ros_domain, simulator, wait_until, tmp_path, monkeypatch, repository
):
    """Of a gun at 2 kHz, poses between the first subscription and the first callback count."""
    monkeypatch.setenv('PYTHONPATH', str(repository / 'tests'), prepend=':')
    with NodeProcess(tmp_path / 'robot', '', code=STREAM) as robot:
        wait_until(lambda: 'ready' in robot.out, what='the robot')
        for _ in range(3):
            node = simulator(publish_rate_hz=1.0)
            wait_until(lambda node=node: node.film.counts.received > 100, what='poses painted')
            assert node.inputs[0].unpainted == 0
            node.destroy_node()
