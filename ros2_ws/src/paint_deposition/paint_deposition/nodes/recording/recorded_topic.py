"""One topic of a recorder: its subscription to serialised messages, and what it counted."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from paint_deposition.errors import RecordingError
from paint_deposition.nodes.runtime.messages import header_stamp_ns

if TYPE_CHECKING:  # older distributions have no such name
    from rclpy.subscription import MessageInfo

# (topic, serialised message, time received [ns], time sent [ns])
TakeMessage = Callable[[str, bytes, int, int], None]


@dataclass
class TopicCounts:
    """Messages of a topic, and those that never arrived."""

    messages: int = 0
    missed: int = 0  # seen by the jumps of the publishers' sequence numbers
    gaps: int = 0  # intervals between header stamps above the limit
    longest_gap_ns: int = 0
    newest_stamp_ns: int = 0
    sequence: dict[bytes, int] = field(default_factory=dict)

    def count_sequence(self, info: MessageInfo) -> None:
        number, gid = info.get('publication_sequence_number'), info.get('publisher_gid')
        if number is None or gid is None:
            return
        previous = self.sequence.get(gid['data'])
        if previous is not None and number > previous:
            self.missed += number - previous - 1
        self.sequence[gid['data']] = number

    def count_stamp(self, stamp_ns: int, max_gap_ns: int) -> None:
        gap_ns = stamp_ns - self.newest_stamp_ns
        if self.newest_stamp_ns and gap_ns > max_gap_ns:
            self.gaps += 1
            self.longest_gap_ns = max(self.longest_gap_ns, gap_ns)
        self.newest_stamp_ns = stamp_ns


class RecordedTopic:
    """Subscribes to the bytes of a topic.

    `max_gap_ns` is the longest interval between header stamps that is no gap; None for topics
    whose intervals say nothing.
    """

    def __init__(
        self, node: Node, name: str, type_name: str, take: TakeMessage, max_gap_ns: int | None
    ):
        self.name = name
        self.counts = TopicCounts()
        self.profile: QoSProfile | None = None
        self._node = node
        self._message_class = message_class(type_name)
        self._take = take
        self._max_gap_ns = max_gap_ns
        self._subscription: Subscription | None = None

    def subscribe(self, profile: QoSProfile) -> None:
        """Subscribe, or subscribe anew, with this quality of service."""
        if self._subscription:
            self.drain()
            self._node.destroy_subscription(self._subscription)
        self.profile = profile
        self._subscription = self._node.create_subscription(
            self._message_class, self.name, self._on_message, profile, raw=True
        )

    def drain(self) -> None:
        """Take what waits in the queue; the executor would, but it is being stopped."""
        if self._subscription is None:
            return
        handle = self._subscription.handle
        with handle:
            while taken := handle.take_message(self._message_class, True):
                self._on_message(*taken)

    def _on_message(self, cdr: bytes, info: MessageInfo) -> None:
        self.counts.messages += 1
        self.counts.count_sequence(info)
        if self._max_gap_ns is not None:
            self.counts.count_stamp(header_stamp_ns(cdr), self._max_gap_ns)
        self._take(self.name, cdr, info['received_timestamp'], info['source_timestamp'])


def message_class(type_name: str) -> type:
    """The Python class of `pkg/msg/Type`."""
    try:
        package, kind, name = type_name.split('/')
        return getattr(importlib.import_module(f'{package}.{kind}'), name)
    except (ImportError, AttributeError, ValueError):
        raise RecordingError(
            f'{type_name} is not installed; source the workspace that defines it'
        ) from None
