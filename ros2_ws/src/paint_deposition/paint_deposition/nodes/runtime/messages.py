"""Films as messages, without a Python object for each point.

A Marker of 100,000 triangles takes a second to build from Python objects and milliseconds to
serialise anew; here it is serialised once and its colours are rewritten in the bytes. Messages
whose large part is an array of numbers need no such care: their arrays are filled in place.
"""

from __future__ import annotations

import struct
import sys
from array import array

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3
from paint_msgs.msg import ThicknessField, ThicknessStats
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from paint_deposition.film.statistics import FilmStatistics

# The stamp is the first thing in a Marker, behind the four bytes that say how it is encoded.
STAMP_OFFSET = 4
# Three points and colours whose bytes occur nowhere else in a Marker.
SAMPLE_POINTS = np.array([[3.1e1, 4.1e2, 5.9e3], [2.6e4, 5.3e5, 5.8e6], [9.7e7, 9.3e8, 2.3e9]])
SAMPLE_COLOURS = np.array(
    [[0.31, 0.41, 0.59, 0.26], [0.53, 0.58, 0.97, 0.93], [0.23, 0.84, 0.62, 0.64]], np.float32
)


def to_time(stamp_ns: int) -> Time:
    """A stamp in nanoseconds as a message."""
    sec, nanosec = divmod(int(stamp_ns), 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


def to_ns(stamp: Time) -> int:
    """A stamp in integer nanoseconds, which a float could not hold."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


class ColouredMesh:
    """A TRIANGLE_LIST Marker as serialised bytes; only stamp and colours change.

    Args:
        vertices_m: (V, 3) [m]. faces: (F, 3), at least one.
        frame_id: frame of the mesh.
        namespace: of the marker.
    """

    def __init__(
        self, vertices_m: np.ndarray, faces: np.ndarray, frame_id: str, namespace: str
    ) -> None:
        self._corners = faces.ravel()
        head, tail = _around_the_arrays(frame_id, namespace)
        points = vertices_m[self._corners].astype(np.float64).tobytes()
        count = struct.pack('=I', len(self._corners))
        gap = b'\0' * (-(len(head) + len(count) - STAMP_OFFSET) % 8)
        before_colours = head + count + gap + points + count
        self._buffer = bytearray(before_colours)
        self._buffer += bytes(16 * len(self._corners)) + tail
        self._colours = np.frombuffer(
            self._buffer, np.float32, 4 * len(self._corners), len(before_colours)
        ).reshape(-1, 4)

    def serialised(self, stamp_ns: int, palette: np.ndarray, rows: np.ndarray) -> bytes:
        """The message, ready to be published.

        Args:
            palette: (P, 4) uint8 RGBA. rows: (V,) row of the palette for each vertex.
        """
        colours = (palette / np.float32(255.0)).astype(np.float32)
        np.take(colours, rows[self._corners], axis=0, out=self._colours, mode='clip')
        struct.pack_into('=iI', self._buffer, STAMP_OFFSET, *divmod(int(stamp_ns), 1_000_000_000))
        return bytes(self._buffer)


def _around_the_arrays(frame_id: str, namespace: str) -> tuple[bytes, bytes]:
    """What a serialised Marker has before its points' count and after its colours.

    The middleware's own serialiser says it: a small marker is serialised and searched for its
    arrays. Whatever stands behind them keeps its alignment, since a corner takes 40 bytes.
    """
    marker = Marker(ns=namespace, id=0, type=Marker.TRIANGLE_LIST, action=Marker.ADD)
    marker.header.frame_id = frame_id
    marker.pose.orientation.w = 1.0
    marker.scale = Vector3(x=1.0, y=1.0, z=1.0)
    # Viewers multiply the vertices' alpha by this one.
    marker.color = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in SAMPLE_POINTS.tolist()]
    marker.colors = [ColorRGBA(r=r, g=g, b=b, a=a) for r, g, b, a in SAMPLE_COLOURS.tolist()]
    sample = serialize_message(marker)
    points = sample.index(SAMPLE_POINTS.tobytes())
    colours = sample.index(SAMPLE_COLOURS.tobytes())
    count = struct.pack('=I', len(SAMPLE_POINTS))
    return sample[: sample.rindex(count, 0, points)], sample[colours + SAMPLE_COLOURS.nbytes :]


class FilmCloud:
    """A PointCloud2 with x, y, z [m] and thickness_um, filled in place."""

    FIELDS = ('x', 'y', 'z', 'thickness_um')

    def __init__(self, positions_m: np.ndarray, frame_id: str) -> None:
        size = 4 * len(self.FIELDS)
        self._message = PointCloud2(
            height=1,
            width=len(positions_m),
            fields=[
                PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1)
                for k, name in enumerate(self.FIELDS)
            ],
            is_bigendian=sys.byteorder == 'big',
            point_step=size,
            row_step=size * len(positions_m),
            data=array('B', bytes(size * len(positions_m))),
            is_dense=True,
        )
        self._message.header.frame_id = frame_id
        self._values = np.frombuffer(self._message.data, np.float32).reshape(-1, len(self.FIELDS))
        self._values[:, :3] = positions_m

    def message(self, stamp_ns: int, film_um: np.ndarray) -> PointCloud2:
        """The one message that is filled; publish it before the next call."""
        self._message.header.stamp = to_time(stamp_ns)
        self._values[:, 3] = film_um
        return self._message


class FilmField:
    """A ThicknessField, filled in place."""

    def __init__(self, vertex_count: int, mesh_id: str, frame_id: str) -> None:
        self._message = ThicknessField(
            mesh_id=mesh_id, thickness_um=array('f', bytes(4 * vertex_count))
        )
        self._message.header.frame_id = frame_id
        self._values = np.frombuffer(self._message.thickness_um, np.float32)

    def message(self, stamp_ns: int, film_um: np.ndarray) -> ThicknessField:
        """The one message that is filled; publish it before the next call."""
        self._message.header.stamp = to_time(stamp_ns)
        self._values[:] = film_um
        return self._message


def stats_message(frame_id: str, stamp_ns: int, figures: FilmStatistics) -> ThicknessStats:
    """The film's figures; counts of poses are the caller's to add."""
    message = ThicknessStats()
    message.header.frame_id = frame_id
    message.header.stamp = to_time(stamp_ns)
    for name in (
        'mean_um', 'std_dev_um', 'min_um', 'max_um', 'coverage', 'within_target',
        'painted_volume_cm3', 'transfer_efficiency',
    ):  # fmt: skip
        setattr(message, name, getattr(figures, name))
    return message
