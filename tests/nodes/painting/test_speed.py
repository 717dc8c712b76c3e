"""The speed of the gun in the diagnostics, over real DDS."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from nodes.cell import DIAGNOSTICS, two_passes, values_of

MOTION = two_passes(trigger=False)
# Across 1 m in 45 % of 600 poses at 250 Hz.
SPEED = 1.0 / (0.45 * 599 * 0.004)


def test_it_is_told_beside_the_programmed_one(simulator, robot, painted, onlooker, wait_until):
    node, viewer = simulator(), onlooker(DIAGNOSTICS)
    source = robot(node)

    def told() -> dict[str, str]:
        status = viewer.status('deposition_simulator: poses')
        return values_of(status) if status else {}

    wait_until(lambda: told().get('programmed speed [m/s]') == 'unknown')
    stamp = MOTION.stamps_ns[0]
    source.send_fields(stamp, spraying=True, programmed_speed_m_per_s=1.2)
    source.send(MOTION, slice(0, 250))
    painted(node, 250)
    wait_until(lambda: told()['programmed speed [m/s]'] == '1.200')
    wait_until(lambda: told()['speed [m/s]'] == f'{SPEED:.3f}')
