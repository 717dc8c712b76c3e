"""A subscription that adapts its quality of service to that of its publishers."""

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from paint_deposition.nodes.runtime.messages import SequenceNumbers
from paint_deposition.nodes.runtime.node import PaintNode
from paint_deposition.nodes.runtime.topics import compatible_qos

QOS_PERIOD_S = 0.1
# More than a publisher keeps for late subscribers.
REMEMBERED_MESSAGES = 1000


class PolledCallbackGroup(CallbackGroup):
    """A callback group that never runs: its subscriptions are polled and do not wake the node."""

    def can_execute(self, _entity: Any) -> bool:
        return False

    def beginning_execution(self, _entity: Any) -> bool:
        return False

    def ending_execution(self, _entity: Any) -> None:
        """Nothing is ever executed."""


class AdaptiveSubscription:
    """A polled subscription, reliable unless there is, or appears, a best-effort publisher.

    It then stays best effort as long as there is any publisher. With `latched` it is transient
    local where all publishers are. A message received twice, because the subscription was
    replaced, counts once.

    Args:
        take: called by `take_pending` with each message and the time at which it was sent [ns].
        depth: of the queue.
    """

    def __init__(
        self,
        node: PaintNode,
        message: type,
        topic: str,
        take: Callable[[Any, int], None],
        *,
        depth: int,
        latched: bool = False,
    ) -> None:
        self._node, self._message, self._topic, self._take = node, message, topic, take
        self._latched = latched
        self._group = PolledCallbackGroup()
        self._numbers = SequenceNumbers()
        self._taken: deque[tuple[int, bytes]] = deque(maxlen=REMEMBERED_MESSAGES)
        self._profile = QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)
        # At once as the publishers that are known: they would report one that does not match.
        self._profile = self._best_profile()
        self._subscription = self._create_subscription()
        node.create_steady_timer(QOS_PERIOD_S, self._match_qos)

    @property
    def lost(self) -> int:
        """Messages missing after the first of each publisher."""
        return self._numbers.lost

    def take_pending(self) -> None:
        """Take all messages in the queue."""
        self._drain(self._subscription)

    def _best_profile(self) -> QoSProfile:
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        best = compatible_qos([info.qos_profile for info in publishers], self._profile.depth)
        if publishers:
            # A switch to reliable would lose what is sent until both ends are matched again.
            best.reliability = max(best.reliability, self._profile.reliability)
        if not (self._latched and publishers):
            best.durability = DurabilityPolicy.VOLATILE
        return best

    def _match_qos(self) -> None:
        """Replace the subscription if another quality of service matches the publishers better."""
        best = self._best_profile()
        now = self._profile.reliability, self._profile.durability
        if (best.reliability, best.durability) != now:
            before, self._profile = self._subscription, best
            # The new one is created before the old one is destroyed, so that nothing is lost.
            self._subscription = self._create_subscription()
            self._drain(before)
            self._node.destroy_subscription(before)

    def _create_subscription(self) -> Subscription:
        return self._node.create_subscription(
            self._message, self._topic, self._on_message, self._profile,
            callback_group=self._group,
        )  # fmt: skip

    def _drain(self, subscription: Subscription) -> None:
        handle = subscription.handle
        with handle:
            while taken := handle.take_message(self._message, False):
                self._on_message(*taken)

    def _on_message(self, message: Any, info: Mapping[str, Any]) -> None:
        publisher = bytes((info.get('publisher_gid') or {'data': b''})['data'])
        # Some middleware does not number messages.
        self._numbers.take(publisher, info.get('publication_sequence_number') or 0)
        # Publisher and time identify a message.
        identity = info['source_timestamp'], publisher
        if identity in self._taken:
            return
        if self._latched and identity[0]:
            self._taken.append(identity)
        self._take(message, identity[0])
