"""The messages that a bag player publishes: poses, states of the atomizer, transforms."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from heapq import merge
from itertools import groupby
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped
from paint_msgs.msg import AtomizerState
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Bool, Header

from paint_deposition.files.recordings import message_definitions as definitions
from paint_deposition.files.recordings.bag_files import Bag, BagTopic, RawMessage
from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.files.recordings.message_definitions import STATE_TYPE, TF_TYPES
from paint_deposition.files.recordings.transforms import (
    PART_POSE_TYPE,
    STATIC,
    part_pose_topics,
    read_frames,
)
from paint_deposition.files.recordings.triggers import BOOL_TYPE
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.motion.trigger import ONLY_BRUSH, relative_flow
from paint_deposition.nodes.runtime.messages import header, header_stamp_ns

STATE_FIELDS = AtomizerState.get_fields_and_field_types()
DOUBLES = [name for name, kind in STATE_FIELDS.items() if kind == 'double']


class ReplayMessage(NamedTuple):
    """A serialised message and the stamp of its header; for tf only `transform` is set."""

    log_time_ns: int
    is_pose: bool
    stamp_ns: int
    cdr: bytes
    transform: RawMessage | None = None


def replay_messages(
    bag: Bag,
    pose_topic: str,
    states: BagTopic | None,
    transforms: Sequence[str] = (),
    poses: Iterable[RawMessage] = (),
) -> Iterator[ReplayMessage]:
    """Poses, states and transforms by log time; at equal times, poses last.

    `poses` are those of a bag that has no topic of poses: `pose_topic` is ''.
    """
    own = pose_topic, states.name if states else ''
    names = [*(name for name in own if name), *transforms]
    as_state, logged = _state_converter(bag, states), attrgetter('log_time_ns')
    messages = merge(bag.messages(names) if names else (), poses, key=logged)
    for _, simultaneous in groupby(messages, key=logged):
        for message in sorted(simultaneous, key=lambda message: message.topic == pose_topic):
            if message.topic in transforms:
                yield ReplayMessage(message.log_time_ns, False, 0, b'', message)
                continue
            is_pose = message.topic == pose_topic
            cdr = message.cdr if is_pose else as_state(message)
            yield ReplayMessage(message.log_time_ns, is_pose, header_stamp_ns(cdr), cdr)


def pose_messages(motion: Trajectory, log_times_ns: np.ndarray) -> Iterator[RawMessage]:
    """Serialised poses of a motion that is no topic of its own; log times (N,) never go back."""
    logged_ns = np.maximum.accumulate(log_times_ns).tolist()
    poses = np.hstack([motion.positions_m, motion.quaternions_xyzw]).tolist()
    for stamp, at_ns, values in zip(motion.stamps_ns.tolist(), logged_ns, poses, strict=True):
        pose = PoseStamped(header=header(motion.frame_id, stamp))
        p, q = pose.pose.position, pose.pose.orientation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = values
        yield RawMessage('', '', at_ns, serialize_message(pose))


def _state_converter(bag: Bag, states: BagTopic | None) -> Callable[[RawMessage], bytes]:
    if states is None or states.type == BOOL_TYPE:
        return _bool_as_state
    if bag.type_hash(states) == definitions.installed(STATE_TYPE).type_hash:
        return lambda message: message.cdr
    # Recorded with another version of the message: fields of the same name are copied.
    return lambda message: _converted_state(bag.decode(message))


def _bool_as_state(message: RawMessage) -> bytes:
    spraying = deserialize_message(message.cdr, Bool).data
    return _serialised_state(
        header('', message.log_time_ns), spraying, {'flow': relative_flow(spraying)}
    )


def _converted_state(recorded: Any) -> bytes:
    known = {name: float(getattr(recorded, name)) for name in DOUBLES if hasattr(recorded, name)}
    at = header(recorded.header.frame_id, stamp_ns(recorded.header))
    brush = int(getattr(recorded, 'brush', ONLY_BRUSH))
    return _serialised_state(at, bool(recorded.spraying), known, brush)


def _serialised_state(
    at: Header, spraying: bool, known: Mapping[str, float], brush: int = ONLY_BRUSH
) -> bytes:
    """A serialised state; unknown fields are NaN."""
    doubles = dict.fromkeys(DOUBLES, math.nan) | dict(known)
    return serialize_message(AtomizerState(header=at, spraying=spraying, brush=brush, **doubles))


class ReplayedTransforms:
    """Publishes `/tf` and `/tf_static`; a recorded `part_pose` becomes a static transform.

    Without tf2_msgs nothing is published, and a warning names the parameters of the simulator to
    set instead.

    Attributes:
        topics: the topics of the bag to pass to `publish`.
    """

    def __init__(self, node: Node, bag: Bag) -> None:
        self.topics = [topic.name for topic in bag.topics_of(*TF_TYPES)] + part_pose_topics(bag)
        self._publishers: dict[bool, Publisher] = {}
        if not self.topics:
            return
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            self.topics = []
            node.get_logger().warning(
                f'{bag.path} has transforms, and tf2_msgs is not installed: they are not '
                f'replayed{_part_pose_hint(bag)}'
            )
            return
        self._message = TFMessage
        for static in (False, True):
            durability = DurabilityPolicy.TRANSIENT_LOCAL if static else DurabilityPolicy.VOLATILE
            profile = QoSProfile(depth=100, durability=durability)
            topic = f'/{STATIC}' if static else '/tf'
            self._publishers[static] = node.create_publisher(TFMessage, topic, profile)

    def publish(self, message: RawMessage) -> None:
        """Publish a message of one of the topics."""
        cdr = message.cdr
        if message.type == PART_POSE_TYPE:
            placed = deserialize_message(cdr, TransformStamped)
            cdr = serialize_message(self._message(transforms=[placed]))
        static = message.type == PART_POSE_TYPE or message.topic.endswith(STATIC)
        self._publishers[static].publish(cdr)


def _part_pose_hint(bag: Bag) -> str:
    """The parameters of the simulator that replace the transforms, for a warning."""
    if placed := read_frames(bag).placed('part'):
        parent, place = placed
        values = ', '.join(f'{value:.9g}' for value in place.values)
        return f"; set part_parent_frame: '{parent}' and part_pose: [{values}] of the simulator"
    return "; set the simulator's part_parent_frame and part_pose"
