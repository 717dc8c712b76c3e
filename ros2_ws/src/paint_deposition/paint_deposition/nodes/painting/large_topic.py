"""A large message for those who listen to it, as often as they can take it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.duration import Duration
from rclpy.qos import QoSProfile

from paint_deposition.nodes.runtime.qos_watch import QosWatch

# Of one core that making and sending such a message may take.
SHARE = 0.2
# A listener that acknowledges nothing for so long does not hold up the others.
PATIENCE_S = 5.0
AT_ONCE = Duration(nanoseconds=0)


class LargeTopic:
    """Publishes when somebody listens who does not have the newest edition yet.

    The next message waits until all reliable subscribers have acknowledged the last one: a slow
    link gets fewer of them, never a queue. It also waits for as long as keeps the work within
    ``SHARE`` of a core.

    Args:
        watch: makes the publisher.
        message: its type.
    """

    def __init__(self, watch: QosWatch, message: type, topic: str, profile: QoSProfile) -> None:
        self._watch = watch
        self._topic = topic
        self._publisher = watch.publisher(message, topic, profile)
        self._sent: object = None
        self._greeted = 0
        self._sent_s = self._rested_s = 0.0

    def offer(self, edition: object, make: Callable[[bool], Any]) -> None:
        """Publish an edition, if it is wanted and the link is free; otherwise offer it again.

        Args:
            edition: what the message would show; equal where it would show the same.
            make: the message, None where there is nothing to say; it is told whether somebody
                listens who has heard nothing yet.
        """
        newcomers = self._watch.newcomers[self._topic]
        # Not the publisher's own count: it grows before the newcomer is told of.
        if not self._watch.listeners[self._topic]:
            self._sent = None
            return
        if (edition == self._sent and newcomers == self._greeted) or not self._is_free():
            return
        began_s = time.monotonic()
        message = make(self._sent is None or newcomers > self._greeted)
        if message is not None:
            self._publisher.publish(message)
        self._sent, self._greeted = edition, newcomers
        self._sent_s = time.monotonic()
        self._rested_s = began_s + (self._sent_s - began_s) / SHARE

    def _is_free(self) -> bool:
        now_s = time.monotonic()
        if now_s < self._rested_s:
            return False
        return self._publisher.wait_for_all_acked(AT_ONCE) or now_s > self._sent_s + PATIENCE_S
