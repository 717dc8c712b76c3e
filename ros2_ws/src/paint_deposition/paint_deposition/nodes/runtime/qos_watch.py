"""Publishers and subscribers whose quality of service does not fit, noticed and remembered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, qos_policy_name_from_kind
from rclpy.subscription import Subscription


class QosWatch:
    """Makes a node's publishers and subscriptions, and watches who is at their other end.

    Attributes:
        incompatible: by topic, what a publisher offers or a subscriber asks for that does not fit.
        lost_messages: messages that the middleware says it lost.
        newcomers: subscribers that the publishers have found so far, also those that left since.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self.incompatible: dict[str, str] = {}
        self.lost_messages = 0
        self.newcomers = 0

    def subscription(
        self, message: type, topic: str, take: Callable[[Any], None], profile: QoSProfile
    ) -> Subscription:
        """Subscribe, and watch the publishers."""
        callbacks = SubscriptionEventCallbacks(
            incompatible_qos=lambda event: self._note(
                topic, f'a publisher offers less {self._policy(event)} than is asked for'
            ),
            incompatible_type=lambda _: self._note(topic, 'a publisher has another type'),
            message_lost=self._count_lost,
        )
        return self._node.create_subscription(
            message, topic, take, profile, event_callbacks=callbacks
        )

    def publisher(self, message: type, topic: str, profile: QoSProfile) -> Publisher:
        """Make a publisher, and watch its subscribers."""
        callbacks = PublisherEventCallbacks(
            incompatible_qos=lambda event: self._note(
                topic, f'a subscriber asks for more {self._policy(event)} than is offered'
            ),
            incompatible_type=lambda _: self._note(topic, 'a subscriber has another type'),
            matched=self._count_newcomers,
        )
        return self._node.create_publisher(message, topic, profile, event_callbacks=callbacks)

    @staticmethod
    def _policy(event: Any) -> str:
        return qos_policy_name_from_kind(event.last_policy_kind).lower()

    def _note(self, topic: str, what: str) -> None:
        if topic not in self.incompatible:
            self._node.get_logger().error(f'{topic}: {what}; they will not hear each other')
        self.incompatible[topic] = what

    def _count_newcomers(self, event: Any) -> None:
        self.newcomers += event.total_count_change

    def _count_lost(self, event: Any) -> None:
        self.lost_messages += event.total_count_change
