"""The transforms of a bag, so that its poses find the part again in a replay."""

from __future__ import annotations

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message

from paint_deposition.files.recordings.bag_files import Bag, RawMessage
from paint_deposition.files.recordings.message_definitions import TF_TYPES
from paint_deposition.files.recordings.transforms import (
    PART_POSE_TYPE,
    STATIC,
    StaticFrames,
    part_pose_topics,
)

TF_DEPTH = 100


class ReplayedTransforms:
    """Publishes `/tf` and `/tf_static`; a recorded `part_pose` goes out as a static transform.

    Where tf2_msgs is not installed nothing is published, and a warning says what to give the
    simulator instead.

    Attributes:
        topics: of the bag, whose messages are to be published.
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
                f'replayed{_instead(bag)}'
            )
            return
        self._message = TFMessage
        for static in (False, True):
            durability = DurabilityPolicy.TRANSIENT_LOCAL if static else DurabilityPolicy.VOLATILE
            self._publishers[static] = node.create_publisher(
                TFMessage,
                f'/{STATIC}' if static else '/tf',
                QoSProfile(depth=TF_DEPTH, durability=durability),
            )

    def publish(self, message: RawMessage) -> None:
        """Publish a message of one of the topics."""
        cdr = message.cdr
        if message.type == PART_POSE_TYPE:
            placed = deserialize_message(cdr, TransformStamped)
            cdr = serialize_message(self._message(transforms=[placed]))
        static = message.type == PART_POSE_TYPE or message.topic.endswith(STATIC)
        self._publishers[static].publish(cdr)


def _instead(bag: Bag) -> str:
    """The parameters of the simulator that stand for what the bag tells of the part."""
    for parent, child, place in StaticFrames.in_bag(bag).places:
        if child == 'part':
            values = ', '.join(f'{value:.9g}' for value in place.values)
            return f"; give the simulator part_parent_frame: '{parent}' and part_pose: [{values}]"
    return '; give the simulator part_parent_frame and part_pose'
