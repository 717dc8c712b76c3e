"""A simulator that is started while the robot paints."""

from nodes.processes import NodeProcess

STREAM = """
from nodes.cell import Robot, two_passes
from rclpy.context import Context

context = Context()
context.init()
robot, motion = Robot(context), two_passes(trigger=False)
print('ready', flush=True)
while True:
    robot.send(motion)
"""


def test_no_pose_is_left_out_while_it_activates_itself(
    ros_domain, simulator, wait_until, tmp_path, monkeypatch, repository
):
    """Poses that come between its first subscription and its first callback are painted."""
    monkeypatch.setenv('PYTHONPATH', str(repository / 'tests'), prepend=':')
    with NodeProcess(tmp_path / 'robot', '', code=STREAM) as robot:
        wait_until(lambda: 'ready' in robot.out, what='the robot')
        for _ in range(3):
            node = simulator(publish_rate_hz=1.0)
            wait_until(lambda node=node: node.film.counts.received > 100, what='poses painted')
            assert node.inputs[0].unpainted == 0
            node.destroy_node()
