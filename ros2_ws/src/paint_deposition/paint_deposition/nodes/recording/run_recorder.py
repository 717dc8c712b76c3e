"""Node `run_recorder`: writes a run to disk as rosbag2 would, and says what it lost."""

from __future__ import annotations

import itertools
import shutil
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from paint_msgs.msg import Part, PoseProgress
from rcl_interfaces.msg import ParameterEvent
from rclpy.serialization import deserialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo

from paint_deposition.errors import PaintError, RecordingError
from paint_deposition.files.provenance import provenance
from paint_deposition.files.recordings import message_definitions as definitions
from paint_deposition.files.recordings.bags import POSE_TYPE
from paint_deposition.files.recordings.mcap_run import COMPRESSIONS, RunTopic, RunWriter
from paint_deposition.nodes.recording.recorded_topic import RecordedTopic, as_recorded
from paint_deposition.nodes.runtime.managed_node import MANAGED, ManagedNode
from paint_deposition.nodes.runtime.messages import header
from paint_deposition.nodes.runtime.node import ERROR, OK, WARN, Status, Task
from paint_deposition.nodes.runtime.parameters import (
    FILE_NAME,
    FILE_NAME_WORDS,
    NodeParameter,
    atomizer_names,
    read_to_configure,
    require_file_name,
)
from paint_deposition.nodes.runtime.topics import (
    PART_TOPIC,
    PROGRESS,
    PROGRESS_TOPIC,
    accepting,
    of_gun,
    weaker_policies,
)

DISCOVERY_PERIOD_S = 0.1
FLUSH_PERIOD_S = 0.1
PROGRESS_PERIOD_S = 0.2
POSES_A_REPORT = 50
POSE_QUEUE_DEPTH = 5000
QUEUE_DEPTH = 100
LOW_DISK_BYTES = 1_000_000_000
POSES, STATES = 'atomizer/pose', 'atomizer/state'
STATIC_FRAMES, PART_POSE, PARAMETERS = '/tf_static', 'part_pose', '/parameter_events'
# The mesh marker is left out: the cloud and the field say the same in a fortieth of its size.
OF_THE_CELL = (
    'thickness/cloud',
    'thickness/field',
    'thickness/stats',
    'comparison/stats',
    'planned_path',
    # Where the part stood, for poses that are not in its frame.
    PART_POSE,
    '/tf',
    STATIC_FRAMES,
    '/diagnostics',
    PARAMETERS,
)

RECORDER = dict(
    **MANAGED,
    output_directory=NodeParameter(
        'runs',
        'Folder to make the run in [path]',
        fixed_because='the network does not choose where files are written; restart the node',
    ),
    **read_to_configure(
        'the run is made with it; clean the node up, or call ~/stop and start another recorder',
        topics=NodeParameter(
            [],
            'Topics to record; empty: motion, film, plan, diagnostics and parameter changes '
            '[topics]',
            element=str,
        ),
        atomizers=atomizer_names('whose run is recorded'),
        name=NodeParameter(
            '',
            "Run's name; empty: run_<date>_<time> [text]",
            constraints=FILE_NAME_WORDS,
            allows=lambda value: not value or bool(FILE_NAME.fullmatch(value)),
        ),
        compression=NodeParameter(
            'zstd', 'Compression of the chunks in the file [name]', choices=tuple(COMPRESSIONS)
        ),
        max_pose_gap_s=NodeParameter(
            0.25, 'Longest interval between pose stamps that is no gap [s]', (0.001, 60.0)
        ),
        mesh_file=NodeParameter('', 'Mesh whose digest to keep with the run; empty: none [path]'),
        model_file=NodeParameter('', 'Model to keep with the run; empty: none [path]'),
    ),
)


def default_topics(guns: Sequence[str]) -> list[str]:
    """Motion, film, plan, diagnostics and parameter changes; of several guns the film of each."""
    motion = [of_gun(gun, topic) for gun in guns for topic in (POSES, STATES)]
    shares = [of_gun(gun, 'thickness/field') for gun in guns if len(guns) > 1]
    return [*motion, *shares, *OF_THE_CELL]


class RunRecorder(ManagedNode):
    """Records serialised messages, byte by byte as they were published.

    Publishers are found as they appear, and each topic's subscription is as reliable and as
    latched as its publishers allow. When the disk fails or fills up the run is left incomplete,
    the node says so and ends with an error; `paint recover` reads what is there.
    """

    PARAMETERS = RECORDER
    run: RunWriter
    runs = 0

    def __init__(self, **kwargs: Any):
        super().__init__('run_recorder', **kwargs)

    def _configure(self) -> None:
        guns = self.values['atomizers'] or ['']
        wanted = self.values['topics'] or default_topics(guns)
        self._part_topic = self.resolve_topic_name(PART_TOPIC)
        named = [self.resolve_topic_name(name) for name in wanted]
        self._wanted = list(dict.fromkeys([*named, self._part_topic]))
        # Topics of which the newest message holds until the next one, also in the next run.
        holding = (PART_POSE, *(of_gun(gun, STATES) for gun in guns))
        self._newest_holds = set(map(self.resolve_topic_name, holding))
        self._in_force: dict[object, tuple[str, bytes, int]] = {}
        self._error: RecordingError | None = None
        self._progress = {
            self.resolve_topic_name(of_gun(gun, POSES)): self.create_publisher(
                PoseProgress, of_gun(gun, PROGRESS_TOPIC), PROGRESS
            )
            for gun in guns
        }
        self.offer('~/stop', self._stop)

    def _activate(self) -> None:
        name = self.values['name'] or time.strftime('run_%Y%m%d_%H%M%S')
        # One that this node has recorded by itself gets a date behind it.
        name = _free_name(self._folder, name) if self.runs else name
        self.run = self._new_run(name, self._notes)
        self.runs += 1
        self._part_run = ''
        self._topics: dict[str, RecordedTopic] = {}
        self._refused: set[str] = set()
        self.create_steady_timer(DISCOVERY_PERIOD_S, self._discover)
        self.create_steady_timer(FLUSH_PERIOD_S, lambda: self._guarded(self.run.close_old_chunk))
        self.create_steady_timer(PROGRESS_PERIOD_S, self._report_progress)
        self.get_logger().info(f'recording {len(self._wanted)} topics into {self.run.folder}')

    def _prepare(self) -> None:
        self._notes = provenance(self.values['mesh_file'], self.values['model_file'])
        if self.values['name']:
            require_file_name('name', self.values['name'])

    @property
    def _folder(self) -> Path:
        return Path(self.values['output_directory'])

    def _new_run(self, name: str, notes: dict[str, str]) -> RunWriter:
        return RunWriter(self._folder / name, notes, compression=self.values['compression'])

    def destroy_node(self) -> None:
        if self.runs and not self.run.complete:
            self.run.abandon()
        super().destroy_node()

    # --- finding the publishers

    def _discover(self) -> None:
        for name in self._wanted:
            publishers = self.get_publishers_info_by_topic(name)
            if publishers and name not in self._refused and self._error is None:
                try:
                    self._follow(name, publishers)
                except RecordingError as error:
                    self._refused.add(name)
                    self.get_logger().error(f'{name} is not recorded: {error}')

    def _follow(self, name: str, publishers: list[TopicEndpointInfo]) -> None:
        types = sorted({publisher.topic_type for publisher in publishers})
        if len(types) > 1:
            raise RecordingError(f'{name} is published as {" and ".join(types)}')
        is_pose = types[0] == POSE_TYPE
        depth = POSE_QUEUE_DEPTH if is_pose else QUEUE_DEPTH
        profile = accepting([publisher.qos_profile for publisher in publishers], depth)
        topic = self._topics.get(name)
        if topic is None:
            max_gap_ns = round(self.values['max_pose_gap_s'] * 1e9) if is_pose else None
            offered = [as_recorded(publisher.qos_profile) for publisher in publishers]
            in_run = RunTopic(name, types[0], definitions.installed(types[0]), offered)
            topic = RecordedTopic(self, in_run, self._write, max_gap_ns)
            self._guarded(self.run.add_topic, in_run)
            self._topics[name] = topic
        if topic.profile is None or weaker_policies(profile, topic.profile):
            topic.subscribe(profile)

    # --- writing

    def _write(self, name: str, cdr: bytes, log_time_ns: int, sent_ns: int) -> None:
        if name == self._part_topic:
            self._follow_part(deserialize_message(cdr, Part), log_time_ns)
        self._note_in_force(name, cdr, sent_ns)
        self._guarded(self.run.write, name, cdr, log_time_ns, sent_ns)
        if name in self._progress and self._topics[name].messages % POSES_A_REPORT == 0:
            self._report_progress()

    def _note_in_force(self, name: str, cdr: bytes, sent_ns: int) -> None:
        """Keep a message that holds for later runs: newest state, place, parameters, frames."""
        key: object = name
        if name == PARAMETERS:
            event = deserialize_message(cdr, ParameterEvent)
            changed = (*event.new_parameters, *event.changed_parameters)
            key = event.node, *(parameter.name for parameter in changed)
        elif name == STATIC_FRAMES:
            key = cdr
        elif name not in self._newest_holds:
            return
        self._in_force.pop(key, None)
        self._in_force[key] = name, cdr, sent_ns

    def _follow_part(self, part: Part, log_time_ns: int) -> None:
        """Begin the run of a part; the one before is complete."""
        # The message is latched, and may come again.
        if self._error is not None or part.run == self._part_run:
            return
        try:
            name = _free_name(self._folder, part.run)
            following = self._new_run(name, _notes_on(part, self.values['model_file']))
            # The message overtakes others that wait; they belong to the part before.
            for recorded in self._topics.values():
                if recorded.name != self._part_topic:
                    recorded.drain()
            self.run.finish()
            self.get_logger().info(self.summary())
            self.run, self._part_run = following, part.run
            for topic in self._topics.values():
                topic.count_from_zero()
                self.run.add_topic(topic.in_run)
            for name, cdr, sent_ns in self._in_force.values():
                self.run.write(name, cdr, log_time_ns, sent_ns)
            self.get_logger().info(f'recording {part.run} into {self.run.folder}')
        except RecordingError as error:
            self._record_failure(error)
        except PaintError as error:
            self.get_logger().error(f'{self._part_topic}: {error}; the run continues')

    def _guarded(self, step: Callable[..., object], *arguments: object) -> None:
        """Write, unless writing has failed before; the first failure ends the recording."""
        if self._error is not None:
            return
        try:
            step(*arguments)
        except RecordingError as error:
            self._record_failure(error)

    def _record_failure(self, error: RecordingError) -> None:
        self._error = error
        self.get_logger().error(str(error))
        self.fail(error)

    def _report_progress(self) -> None:
        reporter = self.get_fully_qualified_name()
        for name in self._progress.keys() & self._topics.keys():
            topic = self._topics[name]
            report = PoseProgress(reporter=reporter, poses_received=topic.messages)
            report.header = header('', topic.newest_stamp_ns)
            self._progress[name].publish(report)

    # --- ending

    def _stop(self) -> tuple[bool, str]:
        if self.active:
            self.trigger_deactivate()
        self.finish()
        if not self.runs:
            return True, 'nothing was recorded: the recorder was never activated'
        return self.run.complete, self.summary()

    def _deactivate(self) -> None:
        if self._error is not None:
            return
        for topic in self._topics.values():
            topic.drain()
        self._guarded(self.run.finish)
        self.get_logger().info(self.summary())
        never = [name for name in self._wanted if name not in self._topics]
        if never and self.values['topics']:
            self.get_logger().warning(f'never published: {" ".join(never)}')

    def summary(self) -> str:
        """What was recorded and what was lost, in a line."""
        topics = self._topics.values()
        missed = sum(topic.missed for topic in topics)
        state = 'complete' if self.run.complete else 'INCOMPLETE'
        lost = f', {missed} missed' if missed else ''
        if any(topic.unnumbered for topic in topics):
            lost += ' (losses cannot be counted: this middleware does not number messages)'
        gaps = sum(topic.gaps for topic in topics)
        messages = self.run.message_count
        return f'{messages} messages{lost}, {gaps} gaps, file {state}: {self.run.folder}'

    def _tasks(self) -> Mapping[str, Task]:
        return {'recording': self._status}

    def _status(self) -> Status:
        if not self.active and self._error is None:
            return Status(OK, f'inactive; {self.summary()}' if self.runs else 'inactive')
        try:
            size, free = self.run.path.stat().st_size, shutil.disk_usage(self.run.folder).free
        except OSError as error:
            gone = f'{self.run.path}: {error.strerror}; nothing more can be recorded there'
            if self._error is None:
                self._record_failure(RecordingError(gone))
            return Status(ERROR, gone)
        topics = self._topics.values()
        counts, unnumbered = Counter(self.run.counts), sum(t.unnumbered for t in topics)
        values = {
            'run': self.run.folder,
            'messages without a number, whose losses cannot be counted': unnumbered,
            'bytes': size,
            'disk free bytes': free,
            'longest pose gap s': max((t.longest_gap_ns for t in topics), default=0) * 1e-9,
            **{t.name: f'{counts[t.name]} messages, {t.losses}, {t.gaps} gaps' for t in topics},
        }
        if self._error is not None:
            return Status(ERROR, str(self._error), values)
        if self._refused:
            return Status(ERROR, f'not recorded: {" ".join(sorted(self._refused))}', values)
        if free < LOW_DISK_BYTES:
            return Status(WARN, 'the disk is almost full', values)
        if any(topic.missed for topic in topics):
            return Status(WARN, 'messages were missed', values)
        return Status(OK, 'recording', values)


def _notes_on(part: Part, model_file: str) -> dict[str, str]:
    """What the run of a part is made with, by name."""
    notes = {'part_type': part.type, 'serial': part.serial, 'coat': str(part.coat)}
    if part.part_pose:
        notes['part_pose'] = ' '.join(map(str, part.part_pose))
    # The simulator may run on another machine, with files of its own.
    mesh_file = part.mesh_file if Path(part.mesh_file).is_file() else ''
    return provenance(mesh_file, model_file) | notes


def _free_name(folder: Path, run: str) -> str:
    """The name of a run, with date and time behind it where there is one of that name."""
    require_file_name('run', run)
    dated = run + time.strftime('_%Y%m%d_%H%M%S')
    names = itertools.chain([run, dated], (f'{dated}_{number}' for number in itertools.count(2)))
    return next(name for name in names if not (folder / name).exists())
