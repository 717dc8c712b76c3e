"""What the gun's states do to the film while it is painted."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')

from nodes.cell import DIAGNOSTICS, offline_um, two_passes

POSES = 'deposition_simulator: poses'
UNTRIGGERED = two_passes(trigger=False)


def test_a_state_of_which_only_spraying_is_filled_sprays(simulator, robot, painted, onlooker,
                                                         wait_until):  # fmt: skip
    node = simulator()
    viewer = onlooker(DIAGNOSTICS)
    source = robot(node)
    source.send_fields(UNTRIGGERED.stamps_ns[0], spraying=True)
    source.send(UNTRIGGERED)
    film = painted(node)
    assert film.max() > 5.0
    assert np.array_equal(film, offline_um(node, UNTRIGGERED))
    # It says that it sprays, and that no paint flows.
    source.send_fields(UNTRIGGERED.stamps_ns[-1], spraying=True, flow=0.0)

    def shown():
        status = viewer.status(POSES)
        return status and '1 states that spray with flow 0' in status.message and status

    wait_until(shown)
    assert shown().level == b'\x01'
