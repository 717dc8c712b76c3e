"""A large message for those who listen to it, as often as they can take it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.duration import Duration
from rclpy.qos import QoSProfile

from paint_deposition.nodes.runtime.topics import QosWatch

# Of one core that making and sending such a message may take.
SHARE = 0.2
# A listener that acknowledges nothing for so long does not hold up the others.
PATIENCE_S = 5.0
# What is sent in pieces is sent again so long after the last one, then after twice as long, ...
REPEAT_S = 1.0
AT_ONCE = Duration(nanoseconds=0)


class LargeTopic:
    """Publishes when somebody listens who does not have the newest edition yet.

    The next message waits until all reliable subscribers have acknowledged the last one: a slow
    link gets fewer of them, never a queue. It also waits for as long as keeps the work within
    ``SHARE`` of a core.

    A middleware acknowledges what it has received, before the listener takes it: the next
    message then takes its place in a full queue. Where each message shows all there is, the
    newest is enough. Where each shows a piece, all are sent again when the film rests, after
    pauses that double, so that a listener that lost some has them in the end.

    Args:
        watch: makes the publisher.
        message: its type.
        in_pieces: whether a message shows only a piece, or what changed.
    """

    def __init__(
        self,
        watch: QosWatch,
        message: type,
        topic: str,
        profile: QoSProfile,
        in_pieces: bool = False,
    ) -> None:
        self._watch = watch
        self._topic = topic
        self._publisher = watch.publisher(message, topic, profile)
        self.in_pieces = in_pieces
        self._edition: object = None
        self._complete = False
        self._greeted = 0
        self._pause_s = REPEAT_S
        self._sent_s = self._rested_s = 0.0

    def offer(self, edition: object, make: Callable[[bool], Any]) -> None:
        """Publish an edition, if it is wanted and the link is free; otherwise offer it again.

        Args:
            edition: what the message would show; equal where it would show the same.
            make: the message, None where there is nothing left to show; its argument says whether
                all is to be shown, to somebody who is new or once more.
        """
        # Not the publisher's own count: it grows before the newcomer is counted.
        if not self._watch.listeners[self._topic]:
            self._edition = None
            return
        newcomers = self._watch.newcomers[self._topic]
        known = edition == self._edition and self._complete
        rested = time.monotonic() - self._sent_s > self._pause_s
        repeat = known and self.in_pieces and rested
        whole = self._edition is None or newcomers > self._greeted or repeat
        if (known and not whole) or not self._is_free():
            return
        if repeat:
            self._pause_s *= 2.0
        elif edition != self._edition:
            self._pause_s = REPEAT_S
        began_s = time.monotonic()
        message = make(whole)
        if message is not None:
            self._publisher.publish(message)
            self._sent_s = time.monotonic()
            self._rested_s = began_s + (self._sent_s - began_s) / SHARE
        self._edition, self._greeted = edition, newcomers
        self._complete = message is None or not self.in_pieces

    def _is_free(self) -> bool:
        now_s = time.monotonic()
        if now_s < self._rested_s:
            return False
        return self._publisher.wait_for_all_acked(AT_ONCE) or now_s > self._sent_s + PATIENCE_S
