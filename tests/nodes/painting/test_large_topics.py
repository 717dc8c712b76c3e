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

from nodes.cell import two_passes, write_panel
from nodes.processes import NodeProcess
from paint_deposition.files.meshes import read_mesh
from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.nodes.painting.film_messages import MeshTiles, ShownFilm
from paint_deposition.nodes.runtime import topics

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
        return Viewer(onlooker({CHANGES: (PointCloud2, topics.RESULTS)}))

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


class MeshViewer:
    """Puts the markers of `thickness/mesh` together, each decoded once.

    Attributes:
        told: (number, colours) of every marker, in the order in which they came.
    """

    def __init__(self, node) -> None:
        self._node = node
        self.told: list[tuple[int, np.ndarray]] = []

    def look(self) -> MeshViewer:
        for data in self._node.heard['thickness/mesh'][len(self.told) :]:
            marker = deserialize_message(data, Marker)
            colours = np.array([(c.r, c.g, c.b, c.a) for c in marker.colors])
            self.told.append((marker.id, colours))
        return self

    def numbers(self) -> list[int]:
        return [number for number, _ in self.told]

    def shows(self, colours: np.ndarray) -> bool:
        """Whether these are the colours of all markers, in the order of their numbers."""
        seen = [marker for _, marker in sorted(dict(self.look().told).items())]
        now = np.concatenate([np.empty((0, 4)), *seen])
        return now.shape == colours.shape and np.allclose(now, colours, atol=1e-6)


def test_a_large_mesh_comes_in_parts_and_only_those_that_change(simulator, robot, painted,
                                                                onlooker, monkeypatch,
                                                                wait_until):  # fmt: skip
    monkeypatch.setattr('paint_deposition.nodes.painting.film_messages.MOST_FACES', 300)
    node = simulator(color_max_um=40.0)
    tiles = -(-len(node.surface.faces) // 300)
    assert tiles > 5

    def viewer() -> MeshViewer:
        return MeshViewer(onlooker({'thickness/mesh': (Marker, topics.LATCHED)}))

    def expected(film: np.ndarray) -> np.ndarray:
        rgba = film_scale(film, 0.0, 40.0).rgba(film, film > 1.0)
        corners = [node.display.shown_as.corners(tile) for tile in range(tiles)]
        return rgba[np.concatenate(corners)] / np.float32(255.0)

    early = viewer()
    wait_until(lambda: len(set(early.look().numbers())) == tiles, what='the bare mesh')
    source = robot(node)
    source.send(MOTION)
    whole = expected(painted(node))
    wait_until(lambda: early.shows(whole), what='the colours of the film')
    late = viewer()
    wait_until(lambda: late.shows(whole), what='the whole mesh')


def test_only_parts_whose_colours_changed_are_sent(monkeypatch, tmp_path):
    monkeypatch.setattr('paint_deposition.nodes.painting.film_messages.MOST_FACES', 300)
    surface = read_mesh(write_panel(tmp_path / 'panel.stl'), max_edge_length_m=0.05)
    shown = ShownFilm(surface, 'part')
    tiles = MeshTiles(shown)
    palette, rows = np.full((2, 4), 255, np.uint8), np.zeros(len(surface.vertices_m), int)

    def sent(edition: int, whole: bool = False) -> list[int]:
        numbers = []
        while data := tiles.message(edition, 0, palette, rows, whole and not numbers):
            numbers.append(deserialize_message(data, Marker).id)
        return numbers

    every = list(range(shown.tiles))
    assert sent(1) == every
    assert sent(2) == []
    rows[shown.corners(2)[0]] = 1
    changed = [tile for tile in every if rows[shown.corners(tile)].any()]
    assert sorted(sent(3)) == changed
    assert len(changed) < len(every)
    assert sorted(sent(3, whole=True)) == every


def test_parts_that_a_busy_listener_never_took_come_again(simulator, onlooker, executor,
                                                          monkeypatch, wait_until):  # fmt: skip
    """Its middleware has acknowledged them, and its queue of one has kept only the last."""
    monkeypatch.setattr('paint_deposition.nodes.painting.film_messages.MOST_FACES', 300)
    node = simulator()
    viewer = onlooker({'thickness/mesh': (Marker, topics.LATCHED)})
    sent: list[int] = []
    tile = node.display.shown_as.tile
    monkeypatch.setattr(
        node.display.shown_as, 'tile', lambda number: sent.append(number) or tile(number)
    )
    wait_until(lambda: viewer.heard['thickness/mesh'], what='the first part')
    executor.remove_node(viewer)
    wait_until(lambda: set(sent) == set(range(node.display.shown_as.tiles)), what='all parts sent')
    heard = MeshViewer(viewer)
    assert len(set(heard.look().numbers())) < node.display.shown_as.tiles
    executor.add_node(viewer)
    wait_until(
        lambda: set(heard.look().numbers()) == set(range(node.display.shown_as.tiles)),
        what='the rest',
    )
