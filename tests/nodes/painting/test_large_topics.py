"""Large messages go to those who listen, as they can take them."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')

from paint_msgs.msg import ThicknessField

from nodes.cell import two_passes
from nodes.processes import NodeProcess
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
        before = len(other.heard['thickness/field'])
        for row in range(0, len(MOTION), 20):
            source.send(MOTION, slice(row, row + 20))
            painted(node, row + 20)
            node.publish()
        # 30 editions: one may be on its way, and patience ends once on a busy machine.
        assert len(other.heard['thickness/field']) <= before + 2
        listener.go_on()
        film = painted(node).astype(np.float32)

        def newest() -> np.ndarray:
            return np.array(other.newest('thickness/field').thickness_um, np.float32)

        wait_until(lambda: np.array_equal(newest(), film), what='the newest film')
