"""A subscription that takes what its publishers offer, also what they said before it was there."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from paint_deposition.nodes.runtime.node import PaintNode
from paint_deposition.nodes.runtime.topics import accepting

FOLLOW_PERIOD_S = 0.1
# More than a publisher keeps for those who come late.
REMEMBERED = 1000


class Polled(CallbackGroup):
    """Of subscriptions whose messages do not wake the executor: they are taken now and then."""

    def can_execute(self, _entity: Any) -> bool:
        return False

    def beginning_execution(self, _entity: Any) -> bool:
        return False

    def ending_execution(self, _entity: Any) -> None:
        """Nothing is ever executed."""


class AtomizerTopic:
    """Subscribes reliably at first, and as the publishers offer once there are any.

    A best-effort publisher makes the subscription best effort for as long as anybody publishes.
    Where all publishers keep their messages for those who come late, these are heard too, if
    `latched`. A message that comes twice because the subscription changes counts once.

    Args:
        node: makes the subscription.
        take: gets each message, in `take_waiting`.
        depth: messages that may wait.

    Attributes:
        lost: messages that the middleware says it lost.
    """

    def __init__(
        self,
        node: PaintNode,
        message: type,
        topic: str,
        take: Callable[[Any], None],
        *,
        depth: int,
        latched: bool = False,
    ) -> None:
        self.lost = 0
        self._node, self._message, self._topic, self._take = node, message, topic, take
        self._latched = latched
        self._group = Polled()
        self._taken: deque[tuple[int, bytes]] = deque(maxlen=REMEMBERED)
        self._profile = QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)
        self._subscription = self._subscribed()
        node.create_steady_timer(FOLLOW_PERIOD_S, self._follow_publishers)

    def take_waiting(self) -> None:
        """Take what has come."""
        self._drain(self._subscription)

    def _follow_publishers(self) -> None:
        """Look who publishes, and subscribe anew if another quality of service serves better."""
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        best = accepting([info.qos_profile for info in publishers], self._profile.depth)
        if publishers:
            # More reliable in mid-stream would lose what is sent until both ends have met again.
            best.reliability = max(best.reliability, self._profile.reliability)
        if not (self._latched and publishers):
            best.durability = DurabilityPolicy.VOLATILE
        now = self._profile.reliability, self._profile.durability
        if (best.reliability, best.durability) != now:
            before, self._profile = self._subscription, best
            # The new one is there before the old one goes: nothing is lost between them.
            self._subscription = self._subscribed()
            self._drain(before)
            self._node.destroy_subscription(before)

    def _subscribed(self) -> Subscription:
        return self._node.create_subscription(
            self._message, self._topic, self._on_message, self._profile,
            callback_group=self._group,
            event_callbacks=SubscriptionEventCallbacks(message_lost=self._count_lost),
        )  # fmt: skip

    def _count_lost(self, event: Any) -> None:
        self.lost += event.total_count_change

    def _drain(self, subscription: Subscription) -> None:
        handle = subscription.handle
        with handle:
            while taken := handle.take_message(self._message, False):
                self._on_message(*taken)

    def _on_message(self, message: Any, info: Mapping[str, Any]) -> None:
        publisher = info.get('publisher_gid') or {'data': b''}
        # A message is known by who sent it and when.
        identity = info['source_timestamp'], bytes(publisher['data'])
        if identity in self._taken:
            return
        if self._latched and identity[0]:
            self._taken.append(identity)
        self._take(message)
