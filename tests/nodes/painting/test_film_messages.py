"""Messages whose arrays are filled in place arrive as they were meant."""

import numpy as np
import pytest

pytest.importorskip('rclpy')

from rclpy.serialization import deserialize_message, serialize_message
from rclpy.time import Time
from sensor_msgs.msg import PointCloud2

from paint_deposition.nodes.painting.film_messages import FilmCloud, FilmField

STAMP_NS = 1_758_000_123_456_789_012


def test_the_cloud_has_points_and_film():
    vertices = np.random.default_rng(7).normal(size=(40, 3))
    film = np.linspace(0.0, 90.0, len(vertices))
    cloud = FilmCloud(vertices, 'part')
    cloud.message(1, np.zeros(len(vertices)))
    received = deserialize_message(serialize_message(cloud.message(STAMP_NS, film)), PointCloud2)
    assert received.header.frame_id == 'part'
    assert Time.from_msg(received.header.stamp).nanoseconds == STAMP_NS
    layout = np.dtype(
        {
            'names': [field.name for field in received.fields],
            'formats': ['<f4'] * 4,
            'offsets': [field.offset for field in received.fields],
            'itemsize': received.point_step,
        }
    )
    values = np.frombuffer(bytes(received.data), layout)
    assert received.width * received.height == len(values) == len(vertices)
    assert received.row_step == received.width * received.point_step
    assert layout.names == ('x', 'y', 'z', 'thickness_um')
    assert np.array_equal(values['y'], vertices[:, 1].astype(np.float32))
    assert np.array_equal(values['thickness_um'], film.astype(np.float32))


def test_the_field_has_one_value_a_vertex():
    field = FilmField(3, 'abc', 'part')
    message = field.message(STAMP_NS, np.array([0.0, 1.5, 2.5]))
    received = deserialize_message(serialize_message(message), type(message))
    assert received.mesh_id == 'abc'
    assert Time.from_msg(received.header.stamp).nanoseconds == STAMP_NS
    assert list(received.thickness_um) == [0.0, 1.5, 2.5]
