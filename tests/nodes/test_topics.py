"""Messages that several nodes send: a coloured mesh, and diagnostics."""

import numpy as np
import pytest
from geometry_msgs.msg import Point
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from paint_deposition.nodes.node import OK, WARN, PaintNode, Status
from paint_deposition.nodes.topics import ColouredMesh, header, white_marker
from paint_deposition.report.colour_scales import FILM_PALETTE

STAMPS_NS = 0, 1_758_000_123_456_789_012


# Names of every length modulo 8: what comes behind them must keep its alignment.
@pytest.mark.parametrize('frame_id', ['', 'p', 'pa', 'par', 'part', 'cell1/door', 'Tür'])
@pytest.mark.parametrize('triangles', [1, 2, 57])
def test_the_mesh_is_the_marker_that_rclpy_builds(frame_id, triangles):
    rng = np.random.default_rng(7)
    vertices, faces = rng.normal(size=(40, 3)), rng.integers(0, 40, size=(triangles, 3))
    mesh = ColouredMesh(vertices, faces, frame_id, 'thickness')
    for stamp_ns in STAMPS_NS:
        rows = rng.integers(0, len(FILM_PALETTE), size=len(vertices))
        data = mesh.serialise(stamp_ns, FILM_PALETTE, rows)
        expected = white_marker(Marker.TRIANGLE_LIST, 'thickness', 0, frame_id)
        expected.header = header(frame_id, stamp_ns)
        rgba = FILM_PALETTE[rows] / 255.0
        for vertex in faces.ravel():
            x, y, z = vertices[vertex].tolist()
            r, g, b, a = rgba[vertex].tolist()
            expected.points.append(Point(x=x, y=y, z=z))
            expected.colors.append(ColorRGBA(r=r, g=g, b=b, a=a))
        received = deserialize_message(data, Marker)
        assert received.points == expected.points
        for name in 'rgba':
            colours = [[getattr(c, name) for c in m.colors] for m in (received, expected)]
            assert np.allclose(*colours, rtol=0, atol=1e-7)
        expected.colors = received.colors
        assert received == expected
        # Padding may hold anything; there is none behind the header's name.
        assert len(data) == len(serialize_message(expected))


def test_every_task_reports_each_period(ros_context, spin, onlooker, wait_until):
    node = PaintNode(context=ros_context, namespace='cell1')
    calls = []

    def gun() -> Status:
        calls.append(1)
        return Status(WARN, f'call {len(calls)}', {'poses': 3, 'gap s': 0.5})

    node.report({'gun': gun, 'mesh': lambda: Status(OK, 'loaded')}, period_s=0.05)
    viewer = onlooker()
    spin(node)
    wait_until(lambda: len(viewer.heard['/diagnostics']) >= 3, what='diagnostics')
    first, later = (viewer.decoded('/diagnostics', row) for row in (0, 2))
    (gun_status, mesh_status), later_status = first.status, later.status[0]
    assert gun_status.name == 'cell1/paint_node: gun'
    assert mesh_status.name == 'cell1/paint_node: mesh'
    assert (gun_status.level, mesh_status.level) == (b'\x01', b'\x00')
    assert gun_status.hardware_id == '/cell1/paint_node'
    assert [(v.key, v.value) for v in gun_status.values] == [('poses', '3'), ('gap s', '0.5')]
    assert first.header.stamp.sec > 0
    assert later_status.message != gun_status.message
