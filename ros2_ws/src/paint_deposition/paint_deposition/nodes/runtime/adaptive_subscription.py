"""A subscription that adapts its quality of service to that of its publishers."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from paint_deposition.nodes.runtime.messages import SequenceNumbers
from paint_deposition.nodes.runtime.topics import compatible_qos

QOS_PERIOD_S = 0.1
# More than a publisher keeps for late subscribers, or sends while a subscription is replaced.
REMEMBERED_MESSAGES = 2000
# Both ends of a new subscription know of each other after less; meanwhile the old one is there.
OVERLAP_S = 1.0


class PolledCallbackGroup(CallbackGroup):
    """A callback group that never runs: its subscriptions are polled and do not wake the node."""

    def can_execute(self, _entity: Any) -> bool:
        return False

    def beginning_execution(self, _entity: Any) -> bool:
        return False

    def ending_execution(self, _entity: Any) -> None:
        """Nothing is ever executed."""


class AdaptiveSubscription:
    """A subscription that is as reliable, and with `latched` as latched, as all publishers allow.

    It is replaced when they come and go; nothing is lost over that, and a message that is received
    twice counts once.

    Args:
        take: called with each message and what the middleware says of it.
        depth: of the queue.
        raw: whether messages are taken serialised.
        polled: whether `take` is called by `take_pending` alone, which matches the quality of
            service as well; else by the executor, and `match_qos` is called now and then.
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
        self._latched, self._raw, self._polled = latched, raw, polled
        self._group = PolledCallbackGroup() if polled else None
        self._numbers = SequenceNumbers()
        # Times and publishers of messages that may come again, the newest last.
        self._taken: dict[tuple[int, bytes], None] = {}
        self._profile = QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)
        # At once as the publishers that are known: they would report one that does not match.
        self._profile = self._best_profile()
        self._subscription = self._create_subscription()
        # The one that is replaced, and until when it is there, too.
        self._before: Subscription | None = None
        self._overlaps_s = self._matched_s = 0.0

    @property
    def lost(self) -> int:
        """Messages missing after the first of each publisher."""
        return self._numbers.lost

    def take_pending(self) -> None:
        """Take all messages in the queue."""
        if self._polled and time.monotonic() - self._matched_s > QOS_PERIOD_S:
            self.match_qos()
        self._drain()

    def match_qos(self) -> None:
        """Replace the subscription if another quality of service matches the publishers better."""
        self._matched_s = time.monotonic()
        if self._before is not None:
            if self._matched_s > self._overlaps_s:
                self._drain()
                self._node.destroy_subscription(self._before)
                self._before = None
            return
        best = self._best_profile()
        now = self._profile.reliability, self._profile.durability
        if (best.reliability, best.durability) != now:
            self._before, self._profile = self._subscription, best
            self._subscription = self._create_subscription()
            self._overlaps_s = self._matched_s + OVERLAP_S

    def destroy(self) -> None:
        """Take what is in the queue, and unsubscribe."""
        self._drain()
        for subscription in (self._before, self._subscription):
            if subscription is not None:
                self._node.destroy_subscription(subscription)

    def _best_profile(self) -> QoSProfile:
        topic = self._node.resolve_topic_name(self._topic)
        publishers = self._node.get_publishers_info_by_topic(topic)
        if not publishers:
            return self._profile
        best = compatible_qos([info.qos_profile for info in publishers], self._profile.depth)
        if not self._latched:
            best.durability = DurabilityPolicy.VOLATILE
        return best

    def _create_subscription(self) -> Subscription:
        return self._node.create_subscription(
            self._message, self._topic, self._on_message, self._profile,
            callback_group=self._group, raw=self._raw,
        )  # fmt: skip

    def _drain(self) -> None:
        for subscription in (self._before, self._subscription):
            if subscription is not None:
                handle = subscription.handle
                with handle:
                    while taken := handle.take_message(self._message, self._raw):
                        self._on_message(*taken)

    def _on_message(self, message: Any, info: Mapping[str, Any]) -> None:
        publisher = bytes((info.get('publisher_gid') or {'data': b''})['data'])
        # Some middleware does not number messages.
        self._numbers.take(publisher, info.get('publication_sequence_number') or 0)
        # Publisher and time identify a message.
        identity = info['source_timestamp'], publisher
        if identity in self._taken:
            return
        if identity[0] and (self._latched or self._before is not None):
            self._taken[identity] = None
            if len(self._taken) > REMEMBERED_MESSAGES:
                del self._taken[next(iter(self._taken))]
        self._take(message, info)
