"""Large messages go to those who listen, as they can take them; changes go out in between."""

from __future__ import annotations

import os

import numpy as np
import pytest

pytest.importorskip('rclpy')

from paint_msgs.msg import ThicknessField
from paint_msgs.srv import ChangePart
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker

from nodes.cell import two_passes
from nodes.processes import NodeProcess
from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.nodes.runtime import qos

MOTION = two_passes()
CHANGES = 'thickness/changes'
LISTENER = """
import rclpy
from paint_msgs.msg import ThicknessField
rclpy.init()
node = rclpy.create_node('listener')
node.create_subscription(ThicknessField, 'thickness/field', lambda message: print('heard'), 10)
rclpy.spin(node)
"""


class Viewer:
    """Puts the messages of `thickness/changes` together, as its documentation says."""

    def __init__(self, node) -> None:
        self._node, self._taken = node, 0
        self.film_um, self.whole, self.bytes = np.empty(0, np.float32), 0, []

    def look(self) -> np.ndarray:
        for data in self._node.heard[CHANGES][self._taken :]:
            self._take(deserialize_message(data, PointCloud2))
            self.bytes.append(len(data))
        self._taken = len(self._node.heard[CHANGES])
        return self.film_um

    def _take(self, cloud: PointCloud2) -> None:
        kinds = {7: '<f4', 6: '<u4'}
        layout = np.dtype([(field.name, kinds[field.datatype]) for field in cloud.fields])
        points = np.frombuffer(bytes(cloud.data), layout)
        if 'vertex' in layout.names:
            self.film_um[points['vertex']] = points['thickness_um']
        else:
            self.film_um = points['thickness_um'].copy()
            self.whole += 1


@pytest.fixture
def viewer(onlooker):
    def viewer() -> Viewer:
        return Viewer(onlooker({CHANGES: (PointCloud2, qos.RESULTS)}))

    return viewer


def test_who_adds_the_changes_to_the_first_message_has_the_film(simulator, robot, painted, viewer,
                                                                wait_until):  # fmt: skip
    node = simulator(max_edge_length_m=0.02)
    early = viewer()
    wait_until(lambda: early.look().size, what='the whole film')
    assert not early.look().any()
    source = robot(node)
    source.send(MOTION, slice(0, 300))
    first_pass = painted(node, 300)
    # While it is painted the viewer lacks no more than a gauge would show.
    wait_until(lambda: np.abs(early.look() - first_pass).max() <= NO_PAINT_UM)
    late = viewer()
    wait_until(lambda: late.look().size, what='the whole film for the second')
    source.send(MOTION, slice(300, None))
    film = painted(node).astype(np.float32)
    for each in (early, late):
        wait_until(lambda each=each: np.array_equal(each.look(), film), what='the same film')
        # Once for each of the two who came, and no more.
        assert each.whole <= 2
        assert len(each.bytes) > each.whole
    # The second pass leaves most of the upper half as it was.
    assert min(early.bytes) < 0.5 * max(early.bytes)
    node.reset()
    wait_until(lambda: not early.look().any(), what='bare metal')


def test_another_part_begins_with_the_whole_film(simulator, robot, painted, viewer, call,
                                                 onlooker, wait_until, tmp_path):  # fmt: skip
    node = simulator()
    seen = viewer()
    source = robot(node)
    source.send(MOTION)
    film = painted(node).astype(np.float32)
    wait_until(lambda: np.array_equal(seen.look(), film))
    wholes = seen.whole
    os.link(tmp_path / 'panel.stl', tmp_path / 'next.stl')
    request = ChangePart.Request(mesh_file=str(tmp_path / 'next.stl'), serial='2')
    assert call(source, ChangePart, 'deposition_simulator/change_part', request).success
    wait_until(lambda: seen.look().size and not seen.film_um.any(), what='bare metal')
    assert seen.whole == wholes + 1


def test_nothing_large_is_made_for_nobody(simulator, robot, painted):
    node = simulator()
    robot(node).send(MOTION)
    painted(node)
    node.publish()
    assert not {'mesh', 'cloud', 'field'} & set(vars(node.shown_as))


def test_a_listener_that_stalls_gets_no_queue(simulator, robot, painted, onlooker, wait_until,
                                              tmp_path):  # fmt: skip
    """Nobody is sent the next message before all have taken the last one, and none is lost."""
    node = simulator(publish_rate_hz=30.0)
    source = robot(node)
    other = onlooker({'thickness/field': (ThicknessField, qos.RESULTS)})
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


def test_a_large_mesh_comes_in_parts_and_only_those_that_change(simulator, robot, painted,
                                                                onlooker, monkeypatch,
                                                                wait_until):  # fmt: skip
    monkeypatch.setattr('paint_deposition.nodes.painting.film_messages.MOST_FACES', 300)
    node = simulator(color_max_um=40.0)
    tiles = -(-len(node.surface.faces) // 300)
    assert tiles > 5
    viewer = onlooker({'thickness/mesh': (Marker, qos.LATCHED)})

    markers: dict[int, Marker] = {}
    decoded: list[bytes] = []

    def colours() -> np.ndarray:
        """As the viewer shows them; each message is decoded once."""
        heard = viewer.heard['thickness/mesh'][len(decoded) :]
        decoded.extend(heard)
        markers.update((m.id, m) for m in (deserialize_message(data, Marker) for data in heard))
        found = [c for _, marker in sorted(markers.items()) for c in marker.colors]
        return np.array([(c.r, c.g, c.b, c.a) for c in found])

    def expected(film: np.ndarray) -> np.ndarray:
        rgba = film_scale(film, 0.0, 40.0).rgba(film, film > 1.0)
        corners = [node.shown_as.corners(tile) for tile in range(tiles)]
        return rgba[np.concatenate(corners)] / np.float32(255.0)

    wait_until(lambda: len(viewer.heard['thickness/mesh']) == tiles, what='the bare mesh')
    source = robot(node)
    # The gun is still at the side of the panel.
    source.send(MOTION, slice(0, 60))
    begun = expected(painted(node, 60))
    wait_until(lambda: np.allclose(colours(), begun, atol=1e-6), what='the first colours')
    assert tiles < len(decoded) < 2 * tiles
    source.send(MOTION, slice(60, None))
    whole = expected(painted(node))
    wait_until(lambda: np.allclose(colours(), whole, atol=1e-6), what='the colours of the film')
    late = onlooker({'thickness/mesh': (Marker, qos.LATCHED)})
    wait_until(lambda: len(late.heard['thickness/mesh']) >= tiles, what='the whole mesh')
    assert {late.decoded('thickness/mesh', row).id for row in range(-tiles, 0)} == set(
        range(tiles)
    )
