"""Large messages go to those who listen, as they can take them."""

import time

import numpy as np
from paint_msgs.msg import ThicknessField

from nodes.cell import two_passes
from nodes.processes import NodeProcess
from paint_deposition.nodes.painting.film_display import ACKNOWLEDGE_TIMEOUT_S
from paint_deposition.nodes.runtime import topics

MOTION = two_passes()
LISTENER = """
import rclpy
from paint_msgs.msg import ThicknessField
rclpy.init()
node = rclpy.create_node('listener')
node.create_subscription(ThicknessField, 'thickness/field', lambda message: print('heard'), 10)
rclpy.spin(node)
"""


def test_a_listener_that_stalls_gets_no_queue(simulator, robot, painted, onlooker, wait_until,
                                              tmp_path):  # fmt: skip
    """Nobody is sent the next message before all have taken the last one, and none is lost."""
    node = simulator(publish_rate_hz=30.0)
    source = robot(node)
    other = onlooker({'thickness/field': (ThicknessField, topics.RESULTS)})
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
