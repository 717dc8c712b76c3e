"""The messages that a bag player publishes: poses, states of the atomizer, transforms."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from heapq import merge
from itertools import groupby
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import TransformStamped
from paint_msgs.msg import AtomizerState
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Bool

from paint_deposition.files.recordings import message_definitions as definitions
from paint_deposition.files.recordings.bag_files import Bag, BagTopic, RawMessage
from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.files.recordings.message_definitions import STATE_TYPE, TF_TYPES
from paint_deposition.files.recordings.pose_topics import (
    PART_POSE_TYPE,
    STATIC,
    part_pose_topics,
    read_frames,
)
from paint_deposition.files.recordings.triggers import BOOL_TYPE
from paint_deposition.motion.trajectory import ONLY_BRUSH, Trajectory, relative_flow
from paint_deposition.nodes.runtime.messages import header, header_stamp_ns, pose_message

DOUBLES = [
    name for name, kind in AtomizerState.get_fields_and_field_types().items() if kind == 'double'
]


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
        yield RawMessage(
            '', '', at_ns, serialize_message(pose_message(motion.frame_id, stamp, values))
        )


def _state_converter(bag: Bag, states: BagTopic | None) -> Callable[[RawMessage], bytes]:
    """What makes the bytes of an AtomizerState from a recorded Bool or state."""
    is_bool = states is None or states.type == BOOL_TYPE
    own_hash = definitions.installed(STATE_TYPE).type_hash
    if states is not None and not is_bool and bag.type_hash(states) == own_hash:
        return lambda message: message.cdr

    def as_state(message: RawMessage) -> bytes:
        state = AtomizerState(**dict.fromkeys(DOUBLES, math.nan))  # unknown
        if is_bool:
            state.header = header('', message.log_time_ns)
            state.spraying = deserialize_message(message.cdr, Bool).data
            state.flow = relative_flow(state.spraying)
        else:  # another version of the message: fields of the same name are copied
            recorded = bag.decode(message)
            state.header = header(recorded.header.frame_id, stamp_ns(recorded.header))
            state.spraying = bool(recorded.spraying)
            state.brush = int(getattr(recorded, 'brush', ONLY_BRUSH))
            for name in DOUBLES:
                setattr(state, name, float(getattr(recorded, name, math.nan)))
        return serialize_message(state)

    return as_state


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
            self.topics, place = [], 'part_parent_frame and part_pose'
            if placed := read_frames(bag).placed('part'):
                values = ', '.join(f'{value:.9g}' for value in placed[1].values)
                place = f"part_parent_frame: '{placed[0]}' and part_pose: [{values}]"
            node.get_logger().warning(
                f'{bag.path} has transforms, and tf2_msgs is not installed: they are not '
                f'replayed; set {place} of the simulator'
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
