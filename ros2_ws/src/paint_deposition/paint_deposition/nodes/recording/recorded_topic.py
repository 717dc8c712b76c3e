"""One topic of a recorder: its subscription to serialised messages, and what it counted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from paint_deposition.files.recordings.mcap_run import RunTopic
from paint_deposition.nodes.runtime.messages import header_stamp_ns, message_class

# (topic, serialised message, log time [ns], time sent [ns])
TakeMessage = Callable[[str, bytes, int, int], None]


class RecordedTopic:
    """Subscribes to the bytes of a topic.

    `max_gap_ns` is the longest interval between header stamps that is no gap; None for topics
    whose intervals say nothing.

    Attributes:
        in_run: what the run says of the topic; name: the topic's.
        messages: that came, in all runs.
        missed: that never arrived, by the jumps of the publishers' sequence numbers.
        unnumbered: messages that the middleware gave no number, whose losses nobody can count.
        gaps, longest_gap_ns: intervals between header stamps above the limit.
        newest_stamp_ns: header stamp of the last message.
    """

    def __init__(
        self, node: Node, in_run: RunTopic, take: TakeMessage, max_gap_ns: int | None
    ) -> None:
        self.in_run, self.name = in_run, in_run.name
        self.messages = 0
        self.count_from_zero()
        self._sequence: dict[bytes, int] = {}
        self._log_time_ns = 0
        self.profile: QoSProfile | None = None
        self._node = node
        self._message_class = message_class(in_run.type)
        self._take = take
        self._max_gap_ns = max_gap_ns
        self._subscription: Subscription | None = None

    def count_from_zero(self) -> None:
        """Another run begins."""
        self.missed = self.unnumbered = self.gaps = 0
        self.longest_gap_ns = self.newest_stamp_ns = 0

    @property
    def losses(self) -> str:
        """What never arrived, in words."""
        return 'losses cannot be counted' if self.unnumbered else f'{self.missed} missed'

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

    def _on_message(self, cdr: bytes, info: Mapping[str, Any]) -> None:
        self.messages += 1
        self._count_missed(info)
        if self._max_gap_ns is not None:
            self._count_gap(header_stamp_ns(cdr), self._max_gap_ns)
        # Readers order messages by it; a busy middleware's times of receipt go back a little.
        self._log_time_ns = max(self._log_time_ns, info['received_timestamp'])
        self._take(self.name, cdr, self._log_time_ns, info['source_timestamp'])

    def _count_missed(self, info: Mapping[str, Any]) -> None:
        number, gid = info.get('publication_sequence_number'), info.get('publisher_gid')
        if number is None or gid is None:
            self.unnumbered += 1
            return
        previous = self._sequence.get(gid['data'])
        if previous is not None and number > previous:
            self.missed += number - previous - 1
        self._sequence[gid['data']] = number

    def _count_gap(self, stamp_ns: int, max_gap_ns: int) -> None:
        gap_ns = stamp_ns - self.newest_stamp_ns
        if self.newest_stamp_ns and gap_ns > max_gap_ns:
            self.gaps += 1
            self.longest_gap_ns = max(self.longest_gap_ns, gap_ns)
        self.newest_stamp_ns = stamp_ns


def as_recorded(profile: QoSProfile) -> Qos:
    """A publisher's profile, as the middleware reports it, the way bags store it."""
    return Qos(
        QosHistory[profile.history.name],
        profile.depth,
        QosReliability[profile.reliability.name],
        QosDurability[profile.durability.name],
        _as_time(profile.deadline),
        _as_time(profile.lifespan),
        QosLiveliness[profile.liveliness.name],
        _as_time(profile.liveliness_lease_duration),
        profile.avoid_ros_namespace_conventions,
    )


def _as_time(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds, 10**9))
