"""Messages that several nodes use: stamps in serialised messages, a coloured mesh.

A Marker of 100,000 triangles takes a second to build from Python objects. Here it is serialised
once, and for each publication only its stamp and colours are rewritten in the bytes.
"""

import importlib
import struct
from collections.abc import Iterable

import numpy as np
from geometry_msgs.msg import Point, PoseStamped, Vector3
from paint_msgs.msg import AtomizerState
from rclpy.serialization import serialize_message
from rclpy.time import Time
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from paint_deposition.files.recordings.headers import nanoseconds
from paint_deposition.motion.pose_stream import TriggerChange

# The stamp of a header follows the four bytes that give the encoding of the message.
STAMP_OFFSET = 4
# Three points and colours whose bytes occur nowhere else in a Marker.
SAMPLE_POINTS = np.array([[3.1e1, 4.1e2, 5.9e3], [2.6e4, 5.3e5, 5.8e6], [9.7e7, 9.3e8, 2.3e9]])
SAMPLE_COLOURS = np.array(
    [[0.31, 0.41, 0.59, 0.26], [0.53, 0.58, 0.97, 0.93], [0.23, 0.84, 0.62, 0.64]], np.float32
)


def header(frame_id: str, stamp_ns: int) -> Header:
    return Header(frame_id=frame_id, stamp=Time(nanoseconds=stamp_ns).to_msg())


def pose_message(frame_id: str, stamp_ns: int, values: Iterable[float]) -> PoseStamped:
    """A pose x y z qx qy qz qw in a frame at a time."""
    pose = PoseStamped(header=header(frame_id, stamp_ns))
    p, q = pose.pose.position, pose.pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, values)
    return pose


def state_message(frame_id: str, change: TriggerChange) -> AtomizerState:
    """A state that says no more of the gun than this."""
    return AtomizerState(
        header=header(frame_id, change.stamp_ns), spraying=change.flow > 0.0, flow=change.flow,
        brush=change.brush,
    )  # fmt: skip


def message_class(type_name: str) -> type:
    """The Python class of a message type such as std_msgs/msg/Bool."""
    package, kind, name = type_name.split('/')
    return getattr(importlib.import_module(f'{package}.{kind}'), name)


def white_marker(kind: int, namespace: str, number: int, frame_id: str) -> Marker:
    """A marker at the origin of its frame; its white leaves the colours of vertices unchanged."""
    marker = Marker(ns=namespace, id=number, type=kind, header=Header(frame_id=frame_id))
    marker.pose.orientation.w = 1.0
    marker.scale = Vector3(x=1.0, y=1.0, z=1.0)
    marker.color = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
    return marker


def header_stamp_ns(cdr: bytes) -> int:
    """``stamp_ns`` of a serialised message that begins with a header."""
    little_endian = cdr[1] & 1
    return nanoseconds(*struct.unpack_from('<iI' if little_endian else '>iI', cdr, STAMP_OFFSET))


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
        head, tail = _marker_head_and_tail(frame_id, namespace)
        points = vertices_m[self._corners].astype(np.float64).tobytes()
        count = struct.pack('=I', len(self._corners))
        gap = b'\0' * (-(len(head) + len(count) - STAMP_OFFSET) % 8)
        before_colours = head + count + gap + points + count
        self._buffer = bytearray(before_colours)
        self._buffer += bytes(16 * len(self._corners)) + tail
        self._colours = np.frombuffer(
            self._buffer, np.float32, 4 * len(self._corners), len(before_colours)
        ).reshape(-1, 4)

    def serialise(self, stamp_ns: int, palette: np.ndarray, rows: np.ndarray) -> bytes:
        """The message, ready to be published.

        Args:
            palette: (P, 4) uint8 RGBA. rows: (V,) row of the palette for each vertex.
        """
        colours = (palette / np.float32(255.0)).astype(np.float32)
        np.take(colours, rows[self._corners], axis=0, out=self._colours, mode='clip')
        struct.pack_into('=iI', self._buffer, STAMP_OFFSET, *divmod(int(stamp_ns), 1_000_000_000))
        return bytes(self._buffer)


def _marker_head_and_tail(frame_id: str, namespace: str) -> tuple[bytes, bytes]:
    """The bytes of a serialised Marker before the count of its points, and after its colours.

    They are cut from a small marker that the middleware has serialised. Alignment behind the
    arrays stays the same, since a corner takes 40 bytes.
    """
    marker = white_marker(Marker.TRIANGLE_LIST, namespace, 0, frame_id)
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in SAMPLE_POINTS.tolist()]
    marker.colors = [ColorRGBA(r=r, g=g, b=b, a=a) for r, g, b, a in SAMPLE_COLOURS.tolist()]
    sample = serialize_message(marker)
    points = sample.index(SAMPLE_POINTS.tobytes())
    colours = sample.index(SAMPLE_COLOURS.tobytes())
    count = struct.pack('=I', len(SAMPLE_POINTS))
    return sample[: sample.rindex(count, 0, points)], sample[colours + SAMPLE_COLOURS.nbytes :]
