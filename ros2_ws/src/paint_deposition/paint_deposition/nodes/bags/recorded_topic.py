"""What a recorder keeps: its parameters and topics, and the counts of each topic."""

import itertools
import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from paint_msgs.msg import Part
from rclpy.duration import Duration
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

from paint_deposition.files.provenance import provenance
from paint_deposition.files.recordings.mcap_run import COMPRESSIONS, RunTopic
from paint_deposition.nodes.runtime.managed_node import MANAGED
from paint_deposition.nodes.runtime.messages import (
    MOST_PUBLISHERS,
    SequenceNumbers,
    header_stamp_ns,
    message_class,
)
from paint_deposition.nodes.runtime.parameters import (
    FILE_NAME,
    FILE_NAME_RULE,
    NodeParameter,
    atomizers_parameter,
    fixed_while_configured,
    require_file_name,
)
from paint_deposition.nodes.runtime.topics import AdaptiveSubscription, gun_topic

POSES, STATES = 'atomizer/pose', 'atomizer/state'
STATIC_TF, PART_POSE, PARAMETER_EVENTS = '/tf_static', 'part_pose', '/parameter_events'
# Without the mesh markers: cloud and field hold the same in a fortieth of their size.
CELL_TOPICS = (
    'thickness/cloud',
    'thickness/field',
    'thickness/stats',
    'comparison/stats',
    'planned_path',
    # The pose of the part, for poses of the TCP in other frames.
    PART_POSE,
    '/tf',
    STATIC_TF,
    '/diagnostics',
    PARAMETER_EVENTS,
)

RECORDER = dict(
    **MANAGED,
    output_directory=NodeParameter(
        'runs',
        'Folder in which the run is created [path]',
        fixed_because='remote nodes must not choose where files are written; restart the node',
    ),
    **fixed_while_configured(
        'the run is made with it; clean the node up, or call ~/stop and start another recorder',
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
# (topic, serialised message, log time [ns], time sent [ns])
TakeMessage = Callable[[str, bytes, int, int], None]
MISSED_BEFORE_DISCOVERY = 'sent before the recorder heard their publisher'


def default_topics(guns: Sequence[str]) -> list[str]:
    """Motion, film, plan, diagnostics, parameter changes; of several guns the film of each."""
    motion = [gun_topic(gun, topic) for gun in guns for topic in (POSES, STATES)]
    shares = [gun_topic(gun, 'thickness/field') for gun in guns if len(guns) > 1]
    return [*motion, *shares, *CELL_TOPICS]


def part_data(part: Part, model_file: str) -> dict[str, str]:
    """The custom data of a part's run."""
    data = {'part_type': part.type, 'serial': part.serial, 'coat': str(part.coat)}
    if part.part_pose:
        data['part_pose'] = ' '.join(map(str, part.part_pose))
    # The mesh file of a simulator on another machine may not exist here.
    mesh_file = part.mesh_file if os.path.isfile(part.mesh_file) else ''
    return provenance(mesh_file, model_file) | data


def unused_name(folder: Path, run: str) -> str:
    """The name of a run, with date and time appended if it already exists."""
    require_file_name('run', run)
    dated = run + time.strftime('_%Y%m%d_%H%M%S')
    names = itertools.chain([run, dated], (f'{dated}_{number}' for number in itertools.count(2)))
    return next(name for name in names if not (folder / name).exists())


class FirstMessage:
    """How a publisher was first heard: the number of its message, and after how long [ns]."""

    def __init__(self, number: int, sent_ns: int, waited_ns: int) -> None:
        self._number, self._sent_ns, self._waited_ns = number, sent_ns, waited_ns
        self._period_ns = math.inf

    def add(self, number: int, sent_ns: int) -> None:
        """Take a later message: the first few tell how often the publisher sends."""
        if 0 < number - self._number <= 50:
            self._period_ns = (sent_ns - self._sent_ns) / (number - self._number)

    @property
    def before_discovery(self) -> int:
        """Messages sent before the first one, but not those from before the recording."""
        sent_meanwhile = max(self._waited_ns, 0) / max(self._period_ns, 1.0)
        return int(min(self._number - 1, sent_meanwhile))


class RecordedTopic:
    """Subscribes to the serialised messages of a topic.

    `max_gap_ns` is the longest interval between header stamps that is no gap; None: gaps are not
    counted. `begun_ns` is when the run began.

    Attributes:
        run_topic: the topic as the run stores it; name: of the topic.
        messages: number of messages received, in all runs.
        unnumbered: messages without a sequence number, whose losses cannot be counted.
        gaps, longest_gap_ns: intervals between header stamps above the limit.
        newest_stamp_ns: header stamp of the last message.
    """

    def __init__(
        self,
        node: Node,
        run_topic: RunTopic,
        take: TakeMessage,
        max_gap_ns: int | None,
        begun_ns: int,
    ) -> None:
        self.run_topic, self.name = run_topic, run_topic.name
        self.messages = 0
        self._sequence = SequenceNumbers()
        self.reset_counts(begun_ns)
        self._log_time_ns = 0
        self._node = node
        self._message_class = message_class(run_topic.type)
        self._take = take
        self._max_gap_ns = max_gap_ns
        self._subscription: AdaptiveSubscription | None = None

    def reset_counts(self, begun_ns: int) -> None:
        """Set the counts of the run, which began then, to zero."""
        self._begun_ns = begun_ns
        self._lost_before = self._sequence.lost
        self.unnumbered = self.gaps = 0
        self.longest_gap_ns = self.newest_stamp_ns = 0
        self._first_messages: dict[bytes, FirstMessage] = {}

    @property
    def missed(self) -> int:
        """Messages lost in the run after the first one of their publisher."""
        return self._sequence.lost - self._lost_before

    @property
    def before_discovery(self) -> int:
        """Messages sent while this was recording, before the first one of their publisher."""
        return sum(first.before_discovery for first in self._first_messages.values())

    @property
    def losses(self) -> str:
        """The number of lost messages, as text."""
        if self.unnumbered:
            return 'losses cannot be counted'
        first = self.before_discovery
        before = f', {first} {MISSED_BEFORE_DISCOVERY}' if first else ''
        return f'{self.missed} missed{before}'

    def subscribe(self, depth: int) -> None:
        """Subscribe, or match the quality of service to that of the publishers."""
        if self._subscription is not None:
            self._subscription.match_qos()
            return
        self._subscription = AdaptiveSubscription(
            self._node, self._message_class, self.name, self._on_message, depth=depth,
            latched=True, raw=True, polled=False,
        )  # fmt: skip

    def unsubscribe(self) -> None:
        """Take what is in the queue; what is sent until the next subscription is not missed."""
        if self._subscription is not None:
            self._subscription.destroy()
            self._subscription = None
        self._sequence.forget()

    def drain(self) -> None:
        """Take all messages in the queue, without the executor."""
        if self._subscription is not None:
            self._subscription.take_pending()

    def _on_message(self, cdr: bytes, info: Mapping[str, Any]) -> None:
        self.messages += 1
        self._count_missed(info)
        if self._max_gap_ns is not None:
            self._count_gap(header_stamp_ns(cdr), self._max_gap_ns)
        # Log times order the messages; times of receipt may go back a little under load.
        self._log_time_ns = max(self._log_time_ns, info['received_timestamp'])
        self._take(self.name, cdr, self._log_time_ns, info['source_timestamp'])

    def _count_missed(self, info: Mapping[str, Any]) -> None:
        number, gid = info.get('publication_sequence_number'), info.get('publisher_gid')
        if number is None or gid is None:
            self.unnumbered += 1
            return
        gid, sent_ns = gid['data'], info['source_timestamp']
        if self._sequence.take(gid, number) and len(self._first_messages) < MOST_PUBLISHERS:
            waited_ns = info['received_timestamp'] - self._begun_ns
            self._first_messages[gid] = FirstMessage(number, sent_ns, waited_ns)
        if gid in self._first_messages:
            self._first_messages[gid].add(number, sent_ns)

    def _count_gap(self, stamp_ns: int, max_gap_ns: int) -> None:
        gap_ns = stamp_ns - self.newest_stamp_ns
        if self.newest_stamp_ns and gap_ns > max_gap_ns:
            self.gaps += 1
            self.longest_gap_ns = max(self.longest_gap_ns, gap_ns)
        self.newest_stamp_ns = stamp_ns


def bag_qos(profile: QoSProfile) -> Qos:
    """A publisher's QoS profile in the form in which bags store it."""
    return Qos(
        QosHistory[profile.history.name],
        profile.depth,
        QosReliability[profile.reliability.name],
        QosDurability[profile.durability.name],
        _qos_time(profile.deadline),
        _qos_time(profile.lifespan),
        QosLiveliness[profile.liveliness.name],
        _qos_time(profile.liveliness_lease_duration),
        profile.avoid_ros_namespace_conventions,
    )


def _qos_time(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds, 10**9))
