"""Topics: names, quality of service, subscriptions that fit their publishers; and messages."""

import importlib
import math
import struct
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PoseStamped, TransformStamped, Vector3
from paint_msgs.msg import AtomizerState
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rclpy.subscription import Subscription
from rclpy.time import Time
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from paint_deposition.files.recordings.messages import nanoseconds

# Of a gun, whose name precedes them where there are several.
POSE_TOPIC, STATE_TOPIC = 'atomizer/pose', 'atomizer/state'
# On which every subscriber of the poses reports its progress.
PROGRESS_TOPIC = 'atomizer/progress'
PART_TOPIC = 'part'
TRUST_TOPIC = 'thickness/trust'

# Two seconds of a 250 Hz robot. A queue of ten loses a fifth of the poses while a callback
# builds one mesh marker, whatever the reliability: a full queue drops its oldest message.
POSE_DEPTH = 500
# Late subscribers get the newest message: meshes, statistics, the part.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Clouds, fields and other results that are drawn or recorded as they arrive.
RESULTS = QoSProfile(depth=10)
PROGRESS = QoSProfile(depth=100)
CLOCK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
# Of one topic, those that have left included.
MOST_PUBLISHERS = 1000
# Both ends of a new subscription know of each other after less; meanwhile others count, too.
OVERLAP_S = 1.0
# The stamp of a header follows the four bytes that give the encoding of the message.
STAMP_OFFSET = 4
# (stamp [ns], palette (P, 4) uint8 RGBA, (V,) row of the palette for each vertex) -> a serialised
# Marker, ready to be published.
MeshMessage = Callable[[int, np.ndarray, np.ndarray], bytes]
# In order the strictest, which is reliable and latched, comes first.
Quality = tuple[ReliabilityPolicy, DurabilityPolicy]
USUAL = ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE


def gun_topic(name: str, topic: str) -> str:
    """A topic of the named gun; '' is the only gun of a cell."""
    return f'{name}/{topic}' if name else topic


def node_name(info: TopicEndpointInfo) -> str:
    """The fully qualified name of the node of an endpoint."""
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


class AdaptiveSubscription:
    """Hears each publisher of a topic as reliably, and with `latched` as latched, as it offers.

    There is one subscription for each quality of service among the publishers: one that fits all
    would lose messages of the reliable ones, and what the latched ones keep, because of a weaker
    one. A message that several of them receive counts once.

    Args:
        take: called with each message and what the middleware says of it.
        depth: of the queue.
        raw: whether messages are taken serialised.
        polled: whether `take` is called by `take_pending` alone, which matches the quality of
            service as well; else by the executor, and `match_qos` is called now and then.

    Attributes:
        lost: messages missing after the first of each publisher, by the numbers they have; whoever
            counts anew sets it to 0.
    """

    def __init__(
        self,
        node: Node,
        message: type,
        topic: str,
        take: Callable[[Any, Mapping[str, Any]], None],
        *,
        depth: int,
        latched: bool = False,
        raw: bool = False,
        polled: bool = True,
    ) -> None:
        self._node, self._message, self._topic, self._take = node, message, topic, take
        self._depth, self._latched, self._raw, self._polled = depth, latched, raw, polled
        self._group = MutuallyExclusiveCallbackGroup() if polled else None
        self.lost = 0
        # Of each publisher its newest number; the one heard last is last.
        self._newest: dict[bytes, int] = {}
        # Times and publishers of messages that may come again, the newest last.
        self._taken: dict[tuple[int, bytes], None] = {}
        # The subscriptions, and when each was made and was last wanted.
        self._subscriptions: dict[Quality, Subscription] = {}
        self._made_s: dict[Quality, float] = {}
        self._wanted_s: dict[Quality, float] = {}
        self._offered: dict[bytes, Quality] = {}
        self.match_qos()

    def take_pending(self) -> None:
        """Take the messages that wait in the queues."""
        if self._polled and time.monotonic() - self._matched_s > 0.1:
            self.match_qos()
        for quality in sorted(self._subscriptions):
            self._drain(quality)

    def match_qos(self) -> None:
        """Subscribe by each quality of service that a publisher offers, and by no other."""
        self._matched_s = time.monotonic()
        topic = self._node.resolve_topic_name(self._topic)
        publishers = self._node.get_publishers_info_by_topic(topic)
        self._offered = {
            bytes(info.endpoint_gid): (
                info.qos_profile.reliability,
                info.qos_profile.durability if self._latched else USUAL[1],
            )
            for info in publishers
        }
        wanted = {*self._offered.values()} or {*self._subscriptions} or {USUAL}
        for quality in sorted(wanted - self._subscriptions.keys()):
            self._made_s[quality] = self._matched_s
            reliability, durability = quality
            subscription = self._subscriptions[quality] = self._node.create_subscription(
                self._message, self._topic, partial(self._on_message, quality),
                QoSProfile(depth=self._depth, reliability=reliability, durability=durability),
                callback_group=self._group, raw=self._raw,
            )  # fmt: skip
            if self._group is not None:
                # In a group that is busy for ever, what is polled does not wake the node.
                self._group.beginning_execution(subscription)
        self._wanted_s |= dict.fromkeys(wanted, self._matched_s)
        for quality in [*self._subscriptions]:
            if self._matched_s - self._wanted_s[quality] > OVERLAP_S:
                self._end(quality)

    def unsubscribe(self) -> None:
        """Take what is in the queues, and unsubscribe until the quality of service is matched.

        What is sent meanwhile is not counted as lost; what is latched is received again.
        """
        for quality in [*self._subscriptions]:
            self._end(quality)
        self._newest.clear()
        self._taken.clear()

    def _end(self, quality: Quality) -> None:
        self._drain(quality)
        self._node.destroy_subscription(self._subscriptions.pop(quality))

    def _drain(self, quality: Quality) -> None:
        handle = self._subscriptions[quality].handle
        with handle:
            # No more than what waits: whoever sends faster than this takes would hold the node.
            for _ in range(self._depth):
                if (taken := handle.take_message(self._message, self._raw)) is None:
                    break
                self._on_message(quality, *taken)

    def _on_message(self, heard_by: Quality, message: Any, info: Mapping[str, Any]) -> None:
        publisher = bytes((info.get('publisher_gid') or {'data': b''})['data'])
        offered = self._offered.get(publisher, heard_by)
        own_s, now_s = self._made_s[offered], time.monotonic()
        # Its own subscription, unless it is newer, has all and keeps the order.
        is_newer = self._made_s[heard_by] < own_s and now_s - own_s < OVERLAP_S
        if offered != heard_by and not is_newer:
            return
        # 0 where the middleware has none, or ROS, before Kilted, does not say whose it is.
        number = (publisher and info.get('publication_sequence_number')) or 0
        before = self._newest.pop(publisher, number)
        self._newest[publisher] = max(number, before)
        self.lost += max(number - before - 1, 0)
        if len(self._newest) > MOST_PUBLISHERS:
            del self._newest[next(iter(self._newest))]
        # Publisher and time identify a message.
        identity = info['source_timestamp'], publisher
        if identity in self._taken:
            return
        if identity[0]:
            self._taken[identity] = None
            # More than a publisher keeps for late subscribers, or sends to a new subscription.
            if len(self._taken) > 2000:
                del self._taken[next(iter(self._taken))]
        self._take(message, info)


def header(frame_id: str, stamp_ns: int) -> Header:
    return Header(frame_id=frame_id, stamp=Time(nanoseconds=stamp_ns).to_msg())


def pose_message(frame_id: str, stamp_ns: int, values: Iterable[float]) -> PoseStamped:
    """A pose x y z qx qy qz qw in a frame at a time."""
    pose = PoseStamped(header=header(frame_id, stamp_ns))
    p, q = pose.pose.position, pose.pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, values)
    return pose


def part_pose_message(
    parent_frame: str, frame_id: str, stamp_ns: int, values: Iterable[float]
) -> TransformStamped:
    """Where a part stands, x y z qx qy qz qw in another frame, from a time on."""
    placed = TransformStamped(header=header(parent_frame.lstrip('/'), stamp_ns))
    placed.child_frame_id = frame_id
    t, q = placed.transform.translation, placed.transform.rotation
    t.x, t.y, t.z, q.x, q.y, q.z, q.w = map(float, values)
    return placed


def state_message(**known: Any) -> AtomizerState:
    """A state of which these fields are known; its other numbers are NaN."""
    kinds = AtomizerState.get_fields_and_field_types()
    unknown = {name: math.nan for name, kind in kinds.items() if kind == 'double'}
    return AtomizerState(**unknown | known)


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


def coloured_mesh(
    vertices_m: np.ndarray, faces: np.ndarray, frame_id: str, namespace: str
) -> MeshMessage:
    """What makes the serialised TRIANGLE_LIST Markers of a mesh; only stamp and colours change.

    One of 100,000 triangles takes a second to build from Python objects. Here it is serialised
    once, and for each publication only its stamp and colours are rewritten in the bytes.

    Args:
        vertices_m: (V, 3) [m]. faces: (F, 3), at least one.
        frame_id: frame of the mesh.
        namespace: of the marker.
    """
    corners = faces.ravel()
    # The bytes before the count of the points and behind the colours are those of a small marker
    # that the middleware has serialised, whose points and colours occur nowhere else in it.
    # Alignment behind the arrays stays the same, since a corner takes 40 bytes.
    places = np.array([[3.1e1, 4.1e2, 5.9e3], [2.6e4, 5.3e5, 5.8e6], [9.7e7, 9.3e8, 2.3e9]])
    shades = np.arange(0.07, 0.9, 0.07, np.float32).reshape(3, 4)
    marker = white_marker(Marker.TRIANGLE_LIST, namespace, 0, frame_id)
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in places.tolist()]
    marker.colors = [ColorRGBA(r=r, g=g, b=b, a=a) for r, g, b, a in shades.tolist()]
    sample = serialize_message(marker)
    count = struct.pack('=I', len(places))
    head = sample[: sample.rindex(count, 0, sample.index(places.tobytes()))]
    tail = sample[sample.index(shades.tobytes()) + shades.nbytes :]
    points = vertices_m[corners].astype(np.float64).tobytes()
    count = struct.pack('=I', len(corners))
    gap = b'\0' * (-(len(head) + len(count) - STAMP_OFFSET) % 8)
    before_colours = head + count + gap + points + count
    buffer = bytearray(before_colours) + bytes(16 * len(corners)) + tail
    coloured = np.frombuffer(buffer, np.float32, 4 * len(corners), len(before_colours))

    def message(stamp_ns: int, palette: np.ndarray, rows: np.ndarray) -> bytes:
        colours = (palette / np.float32(255.0)).astype(np.float32)
        np.take(colours, rows[corners], axis=0, out=coloured.reshape(-1, 4), mode='clip')
        struct.pack_into('=iI', buffer, STAMP_OFFSET, *divmod(int(stamp_ns), 1_000_000_000))
        return bytes(buffer)

    return message
