"""Node `run_recorder`: records a run in the layout of rosbag2, and reports lost messages."""

import itertools
import shutil
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

from paint_msgs.msg import Part, PoseProgress
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

from paint_deposition.errors import PaintError, RecordingError
from paint_deposition.files.provenance import provenance
from paint_deposition.files.recordings import messages as definitions
from paint_deposition.files.recordings.mcap_run import RunWriter
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.files.recordings.pose_topics import POSE_TYPE
from paint_deposition.nodes.bags.initial_messages import TF, InitialMessages
from paint_deposition.nodes.bags.recorded_topic import (
    MISSED_BEFORE_DISCOVERY,
    MOTION_TYPES,
    PARAMETER_EVENTS,
    PART_POSE,
    RECORDER,
    RecordedTopic,
    bag_qos,
    default_topics,
)
from paint_deposition.nodes.managed_node import ManagedNode
from paint_deposition.nodes.node import ERROR, OK, WARN, Status, Task
from paint_deposition.nodes.parameters import require_file_name
from paint_deposition.nodes.topics import (
    PART_TOPIC,
    POSE_TOPIC,
    PROGRESS,
    PROGRESS_TOPIC,
    STATE_TOPIC,
    gun_topic,
    header,
)

# The run of the part before takes what was sent for it until it has all, or none has come so long:
# a message that got lost comes with the third next heartbeat of its writer at the latest.
LATE_S = 10.0


class RunRecorder(ManagedNode):
    """Records serialised messages, byte by byte as they were published.

    Publishers are discovered as they appear, and each is heard as reliably, and as latched, as it
    offers. If the disk fails or is full, the node ends with an error, and
    `paint recover` reads the incomplete run.
    """

    NAME = 'run_recorder'
    PARAMETERS = RECORDER
    run: RunWriter
    runs = 0

    def _configure(self) -> Mapping[str, Task]:
        self._custom_data = provenance(self.values['mesh_file'], self.values['model_file'])
        guns, resolved = self.values['atomizers'] or [''], self.resolve_topic_name
        self._part_topic = resolved(PART_TOPIC)
        wanted = map(resolved, self.values['topics'] or default_topics(guns))
        self._wanted = list(dict.fromkeys([*wanted, self._part_topic]))
        motion = {
            gun: (resolved(gun_topic(gun, POSE_TOPIC)), resolved(gun_topic(gun, STATE_TOPIC)))
            for gun in guns
        }
        self._part_pose = resolved(PART_POSE)
        self._initial_messages = InitialMessages(motion, self._part_pose)
        # Also while the node is inactive, since they stay in force.
        self._always_heard = {PARAMETER_EVENTS, *(states for _, states in motion.values())}
        self.recorded: dict[str, RecordedTopic] = {}
        self._refused: set[str] = set()
        self._begun_ns = time.time_ns()
        # The run of the part before, while messages for it may come; until when, and by topic when
        # the last of them was sent. How many came even later.
        self.run_before: RunWriter | None = None
        self._open_until_s, self._too_late = 0.0, 0
        self._last_sent_ns: dict[str, int] = {}
        self._error: RecordingError | None = None
        self._progress = {
            poses: self.create_publisher(PoseProgress, gun_topic(gun, PROGRESS_TOPIC), PROGRESS)
            for gun, (poses, _) in motion.items()
        }
        self.create_service(Trigger, '~/stop', lambda *_: self._stop())
        self.create_steady_timer(0.1, self._discover)
        return {'recording': self.status}

    def _activate(self) -> None:
        # Only after a run of this node's own is another name chosen for one that exists.
        new_run = self._create_run('', self._custom_data, keep_name=not self.runs)
        self._begin_run(new_run, time.time_ns())
        self.runs += 1
        # Run and stamp of the part, as it was announced, and when.
        self._part: tuple[str, int] | None = None
        self._announced_ns = 0
        self._refused.clear()
        self._last_sent_ns.clear()
        self._too_late = 0
        self.create_steady_timer(0.1, lambda: self._guarded(self.run.close_old_chunk))
        self.create_steady_timer(0.2, self._report_progress)
        self.get_logger().info(f'recording {len(self._wanted)} topics into {self.run.folder}')

    def _create_run(self, name: str, custom_data: dict[str, str], keep_name: bool) -> RunWriter:
        """A run of this name, if any; with date and time if it exists, unless it keeps its name.

        Raises:
            PaintError: the name is none for a folder, or the run exists, or cannot be made.
        """
        folder = Path(self.values['output_directory'])
        name = name or self.values['name'] or time.strftime('run_%Y%m%d_%H%M%S')
        require_file_name('run', name)
        run = folder / name
        if run.exists() and not keep_name:
            dated = name + time.strftime('_%Y%m%d_%H%M%S')
            names = itertools.chain([dated], (f'{dated}_{n}' for n in itertools.count(2)))
            run = next(folder / each for each in names if not (folder / each).exists())
        return RunWriter(run, custom_data, compression=self.values['compression'])

    def destroy_node(self) -> None:
        for run in (self.run, self.run_before) if self.runs else ():
            if run is not None:
                run.abandon()
        super().destroy_node()

    # --- discovery

    def _discover(self) -> None:
        if self.run_before is not None and self._is_whole(self.run_before):
            self._drain()  # what is in the queues may be of that part
            if self._is_whole(self.run_before):
                self._guarded(self._end_run_before)
        for name in self._wanted:
            if not (self.active or name in self._always_heard):
                continue
            publishers = self.get_publishers_info_by_topic(name)
            if not publishers or name in self._refused or self._error is not None:
                continue
            types = sorted({publisher.topic_type for publisher in publishers})
            is_pose = types[0] == POSE_TYPE
            max_gap_ns = round(self.values['max_pose_gap_s'] * 1e9) if is_pose else None
            offered = [bag_qos(publisher.qos_profile) for publisher in publishers]
            try:
                if len(types) > 1:
                    raise RecordingError(f'{name} is published as {" and ".join(types)}')
                if name in self.recorded:
                    self.recorded[name].match_qos()
                    continue
                about = name, types[0], definitions.installed(types[0]), offered
                if self.active:
                    self._guarded(self.run.add_topic, *about)
                self.recorded[name] = RecordedTopic(
                    self, about, self._write, max_gap_ns, self._begun_ns,
                    depth=5000 if types[0] in MOTION_TYPES else 100,
                )  # fmt: skip
            except RecordingError as error:
                self._refused.add(name)
                self.get_logger().error(f'{name} is not recorded: {error}')

    # --- writing

    def _write(self, name: str, cdr: bytes, log_time_ns: int, sent_ns: int) -> None:
        if not self.active:
            self._initial_messages.add(name, cdr, log_time_ns, sent_ns)
            return
        if name == self._part_topic:
            self._change_part(deserialize_message(cdr, Part), log_time_ns, sent_ns)
        elif name == self._part_pose and sent_ns <= self._announced_ns:
            return  # where the part before stood, which its run says already
        elif sent_ns <= self._last_sent_ns.get(name, 0):
            self._guarded(self._write_late, name, cdr, log_time_ns, sent_ns)
            return
        elif self.run_before is not None and name == TF in self.run_before.counts:
            self._guarded(self.run_before.write, name, cdr, log_time_ns, sent_ns)
        self._initial_messages.add(name, cdr, log_time_ns, sent_ns)
        self._guarded(self.run.write, name, cdr, log_time_ns, sent_ns)
        if name in self._progress and self.recorded[name].messages % 50 == 0:
            self._report_progress()

    def _write_late(self, name: str, cdr: bytes, log_time_ns: int, sent_ns: int) -> None:
        """Write what was sent for the part before into its run, before what was not."""
        if name in self._progress:
            self._initial_messages.add_late(name, cdr, sent_ns)
        if self.run_before is None:
            self._too_late += 1
            return
        if name not in self.run_before.counts:
            self.run_before.add_topic(*self.recorded[name].about)
        before_ns = self._initial_messages.begin_ns - 1
        self.run_before.write(name, cdr, min(log_time_ns, before_ns), sent_ns)
        if name in self.run_before.kept:
            self.run_before.kept[name] += 1
        self._open_until_s = time.monotonic() + LATE_S

    def _is_whole(self, run_before: RunWriter) -> bool:
        """Whether a run has the last messages of its part, which come in order, or waits no more.

        Later transforms may still tell where the part was.
        """
        misses = any(
            t.sent_ns < self._last_sent_ns.get(name, 0) for name, t in self.recorded.items()
        )
        return not (misses or TF in run_before.counts) or time.monotonic() > self._open_until_s

    def _drain(self) -> None:
        """Take what is in the queues of all topics but that of the part."""
        for topic in self.recorded.values():
            if topic.name != self._part_topic:
                topic.take_pending()

    def _end_run_before(self) -> None:
        """Complete the run of the part before, if it still takes messages."""
        run_before, self.run_before = self.run_before, None
        if run_before is not None:
            run_before.finish()
            self.get_logger().info(_summary(run_before, self._losses_before))

    def _change_part(self, part: Part, log_time_ns: int, sent_ns: int) -> None:
        """Complete the run of the previous part, and begin that of the new one."""
        before, self._part = self._part, (part.run, stamp_ns(part.header))
        # The message is latched, and may be received again.
        if self._error is not None or self._part == before:
            return
        if not part.run and not any(self.run.counts.get(poses) for poses in self._progress):
            return  # a reset from before this recorder
        try:
            # The mesh file is one of the simulator's machine: it is not opened here.
            data = provenance('', self.values['model_file'])
            data |= {'mesh_file': part.mesh_file, 'mesh_id': part.mesh_id}
            data |= {'part_type': part.type, 'serial': part.serial, 'coat': str(part.coat)}
            if part.part_pose:
                data['part_pose'] = ' '.join(map(str, part.part_pose))
            new_run = self._create_run(part.run, data, keep_name=False)
            self._drain()
            self._end_run_before()
            # Some messages were sent for this part, and are in the run before, too.
            self._announced_ns = sent_ns
            self._last_sent_ns, early = self._initial_messages.begin_part(part, sent_ns)
            counts = self.run.counts
            self.run.kept |= {name: counts[name] - count for name, count in early.items()}
            self.run_before, self._losses_before = self.run, self._losses
            self._open_until_s = time.monotonic() + LATE_S
            self._begin_run(new_run, log_time_ns)
            self.get_logger().info(f'recording {part.run} into {self.run.folder}')
        except RecordingError as error:
            self._record_failure(error)
        except PaintError as error:
            self.get_logger().error(f'{self._part_topic}: {error}; the run continues')

    def _begin_run(self, run: RunWriter, log_time_ns: int) -> None:
        """Begin with what is in force."""
        self.run, self._begun_ns = run, time.time_ns()
        for topic in self.recorded.values():
            topic.reset_counts(self._begun_ns)
            run.add_topic(*topic.about)
        for message in self._initial_messages.begin_run(log_time_ns):
            if message.topic in run.counts:
                run.write(*message[:4])

    def _guarded(self, step: Callable[..., object], *arguments: object) -> None:
        """Write, unless writing has failed before; the first error ends the recording."""
        if self._error is not None:
            return
        try:
            step(*arguments)
        except RecordingError as error:
            self._record_failure(error)

    def _record_failure(self, error: RecordingError) -> None:
        self._error = error
        self.get_logger().error(str(error))
        self.finish(error)

    def _report_progress(self) -> None:
        for name in self._progress.keys() & self.recorded.keys():
            report = PoseProgress(reporter=self.get_fully_qualified_name())
            report.header = header('', self.recorded[name].newest_stamp_ns)
            report.poses_received = self.recorded[name].messages
            self._progress[name].publish(report)

    # --- ending

    def _stop(self) -> Trigger.Response:
        if self.active:
            self.trigger_deactivate()
        # The answer of a process that ends at once may be lost; its client would wait for ever.
        self._lasting.add(self.create_steady_timer(1.0, self.finish))
        if not self.runs:
            message = 'nothing was recorded: the recorder was never activated'
            return Trigger.Response(success=True, message=message)
        return Trigger.Response(success=self.run.complete, message=self.summary())

    def _deactivate(self) -> None:
        for topic in self.recorded.values():
            if topic.name in self._always_heard:
                topic.take_pending()
            else:
                topic.unsubscribe()
        self._initial_messages.end_motion()
        if self._error is not None:
            return
        self._guarded(self._end_run_before)
        self._guarded(self.run.finish)
        self.get_logger().info(self.summary())
        never = [name for name in self._wanted if name not in self.recorded]
        if never and self.values['topics']:
            self.get_logger().warning(f'never published: {" ".join(never)}')

    def summary(self) -> str:
        """One line on what was recorded and what was lost."""
        return _summary(self.run, self._losses)

    @property
    def _losses(self) -> str:
        topics = self.recorded.values()
        missed = sum(topic.lost for topic in topics)
        lost = f', {missed} missed' if missed else ''
        first = [f'{count} of {t.name}' for t in topics if (count := t.before_discovery.total())]
        lost += f', {" and ".join(first)} {MISSED_BEFORE_DISCOVERY}' if first else ''
        if any(topic.unnumbered for topic in topics):
            lost += ' (losses cannot be counted: this middleware does not number messages)'
        if self._too_late:
            lost += f', {self._too_late} poses and states came too late for the run before'
        return f'{lost}, {sum(topic.gaps for topic in topics)} gaps'

    def status(self) -> Status:
        if not self.active and self._error is None:
            return OK, f'inactive; {self.summary()}' if self.runs else 'inactive', {}
        try:
            size, free = self.run.path.stat().st_size, shutil.disk_usage(self.run.folder).free
        except OSError as error:
            reason = f'{self.run.path}: {error.strerror}; nothing more can be recorded there'
            if self._error is None:
                self._record_failure(RecordingError(reason))
            return ERROR, reason, {}
        topics = self.recorded.values()
        counts, unnumbered = Counter(self.run.counts), sum(t.unnumbered for t in topics)
        values = {
            'run': self.run.folder,
            'messages without a sequence number, whose losses cannot be counted': unnumbered,
            'bytes': size,
            'disk free bytes': free,
            'longest pose gap s': max((t.longest_gap_ns for t in topics), default=0) * 1e-9,
            **{t.name: f'{counts[t.name]} messages, {t.losses}, {t.gaps} gaps' for t in topics},
        }
        if self._error is not None:
            return ERROR, str(self._error), values
        if self._refused:
            return ERROR, f'not recorded: {" ".join(sorted(self._refused))}', values
        if free < 1_000_000_000:
            return WARN, 'the disk is almost full', values
        if self._too_late or any(topic.lost for topic in topics):
            return WARN, f'messages were missed{self._losses}', values
        return OK, 'recording', values


def _summary(run: RunWriter, losses: str) -> str:
    state = 'complete' if run.complete else 'INCOMPLETE'
    return f'{run.message_count} messages{losses}, file {state}: {run.folder}'
