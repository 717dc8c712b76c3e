"""Names and quality of service of the topics, and who does not fit at their other end."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

# Every node that takes poses reports here how far it has come.
PROGRESS_TOPIC = 'atomizer/progress'
# The part in the cell, for those who record.
PART_TOPIC = 'part'

# Two seconds of a 250 Hz robot. A queue of ten loses a fifth of the poses while a callback
# builds one mesh marker, whatever the reliability: a full queue drops its oldest message.
POSE_DEPTH = 500
# The newest message is kept for subscribers that come later: meshes, statistics, run status.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Clouds, fields and other results that are drawn or recorded as they come.
RESULTS = QoSProfile(depth=10)
# Progress reports of the nodes that take poses; the newest one says all.
PROGRESS = QoSProfile(depth=100)
DIAGNOSTICS = QoSProfile(depth=10)
CLOCK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def of_gun(name: str, topic: str) -> str:
    """A topic of the gun of this name; '' is the only gun of a cell."""
    return f'{name}/{topic}' if name else topic


def accepting(offered: Sequence[QoSProfile], depth: int) -> QoSProfile:
    """Subscription that all these publishers match, as reliable and as latched as they allow."""
    all_reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in offered)
    all_latched = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in offered)
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if all_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if all_latched else DurabilityPolicy.VOLATILE,
    )


def weaker_policies(offered: QoSProfile, wanted: QoSProfile) -> list[str]:
    """The policies in which an offer does not meet a request; the weaker is the larger number."""
    return [
        name
        for name in ('reliability', 'durability')
        if getattr(offered, name) > getattr(wanted, name)
    ]


def endpoint_name(info: TopicEndpointInfo) -> str:
    """The full name of the node at a topic's other end."""
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


class QosWatch:
    """Makes a node's publishers and subscriptions, and watches who is at their other end.

    Attributes:
        lost_messages: messages that the middleware says it lost.
        listeners: subscribers that each topic's publisher has now.
        newcomers: those that it has found so far, also those that left since.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._inputs: dict[str, Subscription] = {}
        self._outputs: dict[str, Publisher] = {}
        self._reported: dict[str, str] = {}
        self.lost_messages = 0
        self.listeners: Counter[str] = Counter()
        self.newcomers: Counter[str] = Counter()

    def subscription(
        self,
        message: type,
        topic: str,
        take: Callable[..., None],
        profile: QoSProfile,
        group: CallbackGroup | None = None,
    ) -> Subscription:
        """Subscribe, and watch the publishers."""
        # The graph is asked who does not fit; the middleware's own notices come once and stay.
        callbacks = SubscriptionEventCallbacks(
            message_lost=self._count_lost, use_default_callbacks=False
        )
        self._inputs[topic] = self._node.create_subscription(
            message, topic, take, profile, event_callbacks=callbacks, callback_group=group
        )
        return self._inputs[topic]

    def destroy_subscription(self, subscription: Subscription) -> None:
        """Destroy a subscription whose topic another one follows by now."""
        self._node.destroy_subscription(subscription)

    def publisher(self, message: type, topic: str, profile: QoSProfile) -> Publisher:
        """Make a publisher, and watch its subscribers."""
        callbacks = PublisherEventCallbacks(
            matched=partial(self._count_listeners, topic), use_default_callbacks=False
        )
        self._outputs[topic] = self._node.create_publisher(
            message, topic, profile, event_callbacks=callbacks
        )
        return self._outputs[topic]

    def publishers_of(self, topic: str) -> list[TopicEndpointInfo]:
        """Who publishes a topic that is subscribed to, with the type that is expected."""
        expected = _type_name(self._inputs[topic].msg_type) if topic in self._inputs else None
        return [
            info
            for info in self._node.get_publishers_info_by_topic(topic)
            if expected in (None, info.topic_type)
        ]

    def misfits(self) -> dict[str, str]:
        """By topic, who is there now and cannot be heard, or cannot hear; new ones are logged."""
        every: defaultdict[str, list[str]] = defaultdict(list)
        for topic, own in self._inputs.items():
            for info in self._node.get_publishers_info_by_topic(topic):
                why = _misfit(info, own.msg_type, info.qos_profile, own.qos_profile)
                if why:
                    every[topic].append(f'{endpoint_name(info)} publishes {why}')
        for topic, publisher in self._outputs.items():
            for info in self._node.get_subscriptions_info_by_topic(topic):
                why = _misfit(info, publisher.msg_type, publisher.qos_profile, info.qos_profile)
                if why:
                    every[topic].append(f'{endpoint_name(info)} asks for {why}')
        found = {topic: ', '.join(sorted(set(what))) for topic, what in every.items()}
        for topic, what in found.items():
            if self._reported.get(topic) != what:
                self._node.get_logger().error(f'{topic}: {what}; they do not hear each other')
        self._reported = found
        return found

    def _count_listeners(self, topic: str, event: Any) -> None:
        self.listeners[topic] = event.current_count
        self.newcomers[topic] += event.total_count_change

    def _count_lost(self, event: Any) -> None:
        self.lost_messages += event.total_count_change


def _misfit(
    info: TopicEndpointInfo, expected: type, offered: QoSProfile, wanted: QoSProfile
) -> str:
    """What does not fit, '' if all does."""
    if info.topic_type != _type_name(expected):
        return f'the type {info.topic_type}, not {_type_name(expected)}'
    policies = weaker_policies(offered, wanted)
    return f'another {" and ".join(policies)}' if policies else ''


def _type_name(message: type) -> str:
    package, kind = message.__module__.split('.')[:2]
    return f'{package}/{kind}/{message.__name__}'
