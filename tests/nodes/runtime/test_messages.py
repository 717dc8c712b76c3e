"""A mesh made of bytes is the message that rclpy would have built."""

import numpy as np
import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import Point
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.time import Time
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from paint_deposition.film.colour_scales import FILM_PALETTE
from paint_deposition.nodes.runtime.messages import ColouredMesh

STAMP_NS = 1_758_000_123_456_789_012


def _marker(vertices_m, faces, frame_id, stamp_ns, rgba):
    """The message the slow way."""
    marker = Marker(ns='thickness', type=Marker.TRIANGLE_LIST)
    marker.header.frame_id = frame_id
    marker.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    marker.color = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
    for vertex in faces.ravel():
        x, y, z = vertices_m[vertex].tolist()
        r, g, b, a = (rgba[vertex] / 255.0).tolist()
        marker.points.append(Point(x=x, y=y, z=z))
        marker.colors.append(ColorRGBA(r=r, g=g, b=b, a=a))
    return marker


@pytest.fixture
def part(rng):
    """Forty vertices and triangles on them in no order."""
    return rng.normal(size=(40, 3)), rng.integers(0, 40, size=(57, 3))


@pytest.fixture
def rng():
    """Numbers that are the same in every run."""
    return np.random.default_rng(7)


# Names of every length modulo 8: what comes behind them must keep its alignment.
@pytest.mark.parametrize('frame_id', ['', 'p', 'pa', 'par', 'part', 'cell1/door', 'Tür'])
@pytest.mark.parametrize('triangles', [1, 2, 57])
def test_the_mesh_is_the_marker_that_rclpy_builds(part, rng, frame_id, triangles):
    vertices, faces = part[0], part[1][:triangles]
    mesh = ColouredMesh(vertices, faces, frame_id, 'thickness')
    for stamp_ns in (0, STAMP_NS):
        rows = rng.integers(0, len(FILM_PALETTE), size=len(vertices))
        data = mesh.serialised(stamp_ns, FILM_PALETTE, rows)
        expected = _marker(vertices, faces, frame_id, stamp_ns, FILM_PALETTE[rows])
        received = deserialize_message(data, Marker)
        assert received.header == expected.header
        assert received.points == expected.points
        for name in ('r', 'g', 'b', 'a'):
            colours = [[getattr(c, name) for c in m.colors] for m in (received, expected)]
            assert np.allclose(*colours, rtol=0, atol=1e-7)
        expected.colors = received.colors
        assert received == expected
        # Padding may hold anything; there is none behind the header's name.
        assert len(data) == len(serialize_message(expected))
