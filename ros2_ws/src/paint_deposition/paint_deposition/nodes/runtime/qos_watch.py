"""Partners on a topic that will never hear each other, noticed and remembered."""

from __future__ import annotations

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import qos_policy_name_from_kind


class QosWatch:
    """Makes the event callbacks of a node's publishers and subscriptions.

    Attributes:
        incompatible: by topic, what somebody there offers or asks for that does not fit.
        lost_messages: messages that the middleware says it lost.
        newcomers: subscribers that the publishers have found so far, also those that left since.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self.incompatible: dict[str, str] = {}
        self.lost_messages = 0
        self.newcomers = 0

    def subscription(self, topic: str) -> SubscriptionEventCallbacks:
        """Callbacks for a subscription."""
        return SubscriptionEventCallbacks(
            incompatible_qos=lambda event: self._note(
                topic, f'a publisher offers less {self._policy(event)} than is asked for'
            ),
            incompatible_type=lambda _: self._note(topic, 'a publisher has another type'),
            message_lost=self._count_lost,
        )

    def publisher(self, topic: str) -> PublisherEventCallbacks:
        """Callbacks for a publisher."""
        return PublisherEventCallbacks(
            incompatible_qos=lambda event: self._note(
                topic, f'a subscriber asks for more {self._policy(event)} than is offered'
            ),
            incompatible_type=lambda _: self._note(topic, 'a subscriber has another type'),
            matched=self._count_newcomers,
        )

    @staticmethod
    def _policy(event) -> str:
        return qos_policy_name_from_kind(event.last_policy_kind).lower()

    def _note(self, topic: str, what: str) -> None:
        if topic not in self.incompatible:
            self._node.get_logger().error(f'{topic}: {what}; they will not hear each other')
        self.incompatible[topic] = what

    def _count_newcomers(self, event) -> None:
        self.newcomers += event.total_count_change

    def _count_lost(self, event) -> None:
        self.lost_messages += event.total_count_change
