"""What a recorder keeps: its parameters and topics, and the counts of each topic."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from paint_deposition.files.recordings.mcap_run import COMPRESSIONS
from paint_deposition.files.recordings.messages import JOINT_TYPE, STATE_TYPE, TF_TYPES, Definition
from paint_deposition.files.recordings.pose_topics import POSE_TYPE
from paint_deposition.nodes.managed_node import MANAGED
from paint_deposition.nodes.parameters import (
    CONFIGURED,
    FILE_NAME,
    FILE_NAME_RULE,
    NodeParameter,
    atomizers_parameter,
    fixed,
)
from paint_deposition.nodes.topics import (
    MOST_PUBLISHERS,
    POSE_TOPIC,
    STATE_TOPIC,
    TRUST_TOPIC,
    AdaptiveSubscription,
    gun_topic,
    header_stamp_ns,
    message_class,
)

# A message of these that is lost is lost motion, or paint.
MOTION_TYPES = {POSE_TYPE, STATE_TYPE, JOINT_TYPE, *TF_TYPES}
STATIC_TF, PART_POSE, PARAMETER_EVENTS = '/tf_static', 'part_pose', '/parameter_events'

RECORDER = dict(
    **MANAGED,
    output_directory=NodeParameter(
        'runs',
        'Folder in which the run is created [path]',
        fixed_because='remote nodes must not choose where files are written; restart the node',
    ),
    **fixed(
        'the run is made with it; clean the node up, or call ~/stop and start another recorder',
        CONFIGURED,
        topics=NodeParameter(
            [],
            'Topics to record; empty: motion, film, plan, diagnostics and parameter changes '
            '[topics]',
            element=str,
        ),
        atomizers=atomizers_parameter('whose run is recorded'),
        name=NodeParameter(
            '',
            "Run's name; empty: run_<date>_<time> [text]",
            constraints=FILE_NAME_RULE,
            allows=lambda value: not value or bool(FILE_NAME.fullmatch(value)),
        ),
        compression=NodeParameter(
            'zstd', 'Compression of the chunks in the file [name]', choices=tuple(COMPRESSIONS)
        ),
        max_pose_gap_s=NodeParameter(
            0.25, 'A longer interval between pose stamps counts as a gap [s]', (0.001, 60.0)
        ),
        mesh_file=NodeParameter('', 'Mesh whose digest to keep with the run; empty: none [path]'),
        model_file=NodeParameter('', 'Model to keep with the run; empty: none [path]'),
    ),
)
MISSED_BEFORE_DISCOVERY = 'sent before the recorder heard their publisher'


def default_topics(guns: Sequence[str]) -> list[str]:
    """Motion, film, plan, diagnostics, parameter changes; of several guns the film of each.

    Without the mesh markers: cloud and field hold the same in a fortieth of their size.
    """
    motion = [gun_topic(gun, topic) for gun in guns for topic in (POSE_TOPIC, STATE_TOPIC)]
    shares = [gun_topic(gun, 'thickness/field') for gun in guns if len(guns) > 1]
    return [
        *motion, *shares, 'thickness/cloud', 'thickness/field', 'thickness/stats', TRUST_TOPIC,
        'comparison/stats', 'planned_path', PART_POSE, '/tf', STATIC_TF, '/diagnostics',
        PARAMETER_EVENTS,
    ]  # fmt: skip


class RecordedTopic(AdaptiveSubscription):
    """A subscription to the serialised messages of a topic, which counts what a run lacks.

    `take` is called with topic, message, log time and time sent [ns]. `max_gap_ns` is the longest
    interval between header stamps that is no gap; None: gaps are not counted. `begun_ns` is when
    the run began.

    Attributes:
        about: what a run stores of the topic, as for `RunWriter.add_topic`; name: of the topic.
        messages: number of messages received, in all runs.
        before_discovery: messages of each publisher sent in this run before the first one heard.
        unnumbered: messages without a sequence number, whose losses cannot be counted.
        gaps, longest_gap_ns: intervals between header stamps above the limit.
        newest_stamp_ns: header stamp of the last message.
        sent_ns: when the last message was sent.
    """

    def __init__(
        self,
        node: Node,
        about: tuple[str, str, Definition, Sequence[Qos]],
        take: Callable[[str, bytes, int, int], None],
        max_gap_ns: int | None,
        begun_ns: int,
        depth: int,
    ) -> None:
        self.about, self.name = about, about[0]
        self.messages = self._log_time_ns = self.sent_ns = 0
        # How each publisher was first heard: number of the message, when it was sent, and how
        # long after the begin of the run; and how many came before, by its rate.
        self._first: dict[bytes, tuple[int, int, int]] = {}
        self.before_discovery: Counter[bytes] = Counter()
        self._pass_on, self._max_gap_ns = take, max_gap_ns
        self.reset_counts(begun_ns)
        super().__init__(
            node, message_class(about[1]), self.name, self._record, depth=depth,
            latched=True, raw=True, polled=False,
        )  # fmt: skip

    def reset_counts(self, begun_ns: int) -> None:
        """Set the counts of the run, which began then, to zero."""
        self._begun_ns = begun_ns
        self.lost = self.unnumbered = self.gaps = 0
        self.longest_gap_ns = self.newest_stamp_ns = 0
        self._first = {gid: (number, sent, 0) for gid, (number, sent, _) in self._first.items()}
        self.before_discovery.clear()

    def unsubscribe(self) -> None:
        super().unsubscribe()
        self._first.clear()

    @property
    def losses(self) -> str:
        """The number of lost messages, as text."""
        if self.unnumbered:
            return 'losses cannot be counted'
        first = self.before_discovery.total()
        before = f', {first} {MISSED_BEFORE_DISCOVERY}' if first else ''
        return f'{self.lost} missed{before}'

    def _record(self, cdr: bytes, info: Mapping[str, Any]) -> None:
        self.messages += 1
        number, publisher = info.get('publication_sequence_number'), info.get('publisher_gid')
        if number is None or publisher is None:
            self.unnumbered += 1
        else:
            # What it sent in the run before it was heard is told by how often it sends.
            gid, sent_ns = publisher['data'], info['source_timestamp']
            if gid not in self._first and len(self._first) < MOST_PUBLISHERS:
                waited_ns = max(info['received_timestamp'] - self._begun_ns, 0)
                self._first[gid] = number, sent_ns, waited_ns
            first, first_sent_ns, waited_ns = self._first.get(gid, (number, 0, 0))
            # The first few tell.
            if 0 < number - first <= 50:
                period_ns = max((sent_ns - first_sent_ns) / (number - first), 1.0)
                self.before_discovery[gid] = int(min(first - 1, waited_ns / period_ns))
        if self._max_gap_ns is not None:
            before_ns, self.newest_stamp_ns = self.newest_stamp_ns, header_stamp_ns(cdr)
            gap_ns = self.newest_stamp_ns - before_ns
            if before_ns and gap_ns > self._max_gap_ns:
                self.gaps += 1
                self.longest_gap_ns = max(self.longest_gap_ns, gap_ns)
        # Log times order the messages; times of receipt may go back a little under load.
        self._log_time_ns = max(self._log_time_ns, info['received_timestamp'])
        self.sent_ns = info['source_timestamp']
        self._pass_on(self.name, cdr, self._log_time_ns, self.sent_ns)


def bag_qos(profile: QoSProfile) -> Qos:
    """A publisher's QoS profile in the form in which bags store it."""
    deadline, lifespan, lease = (
        QosTime(*divmod(duration.nanoseconds, 10**9))
        for duration in (profile.deadline, profile.lifespan, profile.liveliness_lease_duration)
    )
    return Qos(
        QosHistory[profile.history.name],
        profile.depth,
        QosReliability[profile.reliability.name],
        QosDurability[profile.durability.name],
        deadline,
        lifespan,
        QosLiveliness[profile.liveliness.name],
        lease,
        profile.avoid_ros_namespace_conventions,
    )
