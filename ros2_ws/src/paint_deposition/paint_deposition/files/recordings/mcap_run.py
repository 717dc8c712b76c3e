"""Writing a run: serialised messages in the MCAP layout of rosbag2.

A folder `<run>/` with `<run>_0.mcap` and, once the run is complete, `metadata.yaml` (version 9).
The folder without `metadata.yaml` is an unfinished run, as it is for rosbag2.
"""

import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from io import BufferedWriter, FileIO
from pathlib import Path
from typing import Any

import yaml
from mcap.writer import CompressionType, IndexType, Writer
from rosbags import interfaces as ros
from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import dump_qos_v9

from paint_deposition.errors import RecordingError
from paint_deposition.files.atomic import write_text
from paint_deposition.files.recordings.bag_files import KEPT
from paint_deposition.files.recordings.messages import Definition

COMPRESSIONS = {kind.name.lower(): kind for kind in CompressionType}


def offered_qos(depth: int, latched: bool = False) -> Qos:
    """The QoS of a reliable topic as rosbag2 stores it; a latched one is transient local."""
    history, liveliness = ros.QosHistory.KEEP_LAST, ros.QosLiveliness.AUTOMATIC
    kept = ros.QosDurability.TRANSIENT_LOCAL if latched else ros.QosDurability.VOLATILE
    sent, forever = ros.QosReliability.RELIABLE, ros.QosTime(9223372036, 854775807)
    return Qos(history, depth, sent, kept, forever, forever, liveliness, forever, False)


class RunWriter(AbstractContextManager):
    """Writes serialised messages into a new run folder.

    A live recorder calls `close_old_chunk` a few times a second, so that a killed process loses
    at most the last half second and the time to the next call. Any OSError (a full disk) closes
    the file as it is and raises RecordingError; nothing is written after that, and `recover`
    reads the unfinished run. As a context manager, an exception leaves the run unfinished.

    Args:
        folder: the run to create; it must not exist.
        custom_data: text by name, kept in `metadata.yaml` and in the file (mesh hash, model).
        compression: a key of COMPRESSIONS.
        ros_distro: default is the environment's ROS_DISTRO.

    Attributes:
        counts: messages by topic.
        kept: how many of them, the first, are of the part of this run, where not all are.
    """

    def __init__(
        self,
        folder: Path | str,
        custom_data: Mapping[str, str] | None = None,
        compression: str = 'zstd',
        ros_distro: str | None = None,
    ) -> None:
        self.folder = Path(folder)
        self.path = self.folder / f'{self.folder.name}_0.mcap'
        self.custom_data = {key: str(value) for key, value in (custom_data or {}).items()}
        self.ros_distro = ros_distro or os.environ.get('ROS_DISTRO', 'unknown')
        self.counts: dict[str, int] = {}
        self.kept: dict[str, int] = {}
        self.complete = False
        # Of each topic, as rosbag2 has it.
        self._about: dict[str, dict[str, Any]] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._first_ns = 2**63 - 1
        self._last_ns = 0
        self._chunk_opened_s: float | None = None
        self._failure: str | None = None
        try:
            self.folder.parent.mkdir(parents=True, exist_ok=True)
            self.folder.mkdir()
            self._raw = FileIO(self.path, 'xb')
        except FileExistsError:
            raise RecordingError(f'{self.folder} already exists; choose another name') from None
        except OSError as error:
            raise RecordingError(f'cannot create {self.folder}: {error.strerror}') from None
        self._stream = BufferedWriter(self._raw)
        # A killed process loses its open chunk, so chunks are closed by size and by age. At 250 Hz
        # the default megabyte of mcap would hold half a minute of poses. With all indexes, mcap
        # writes the offset of an empty attachment group, which is invalid.
        self._writer = Writer(
            self._stream,
            64 * 1024,
            COMPRESSIONS[compression],
            index_types=IndexType.CHUNK | IndexType.MESSAGE | IndexType.METADATA,
        )
        with self._write_errors():
            self._writer.start(profile='ros2', library='paint_deposition')
            self._writer.add_metadata('rosbag2', {'serialized_metadata': _yaml(self._metadata())})
            self._writer.flush()

    @property
    def message_count(self) -> int:
        return sum(self.counts.values())

    def add_topic(
        self,
        name: str,
        message_type: str,
        definition: Definition,
        offered: Sequence[Qos] = (),
        encoding: str = 'ros2msg',
    ) -> None:
        """Add a topic, which is listed in the metadata even without messages.

        ``offered`` are the profiles of its publishers, ``encoding`` is that of the definition.
        """
        qos, (text, type_hash) = dump_qos_v9(list(offered)), definition
        with self._write_errors():
            if message_type not in self._schemas:
                self._schemas[message_type] = self._writer.register_schema(
                    message_type, encoding, text.encode()
                )
            about = {'offered_qos_profiles': _yaml(qos).strip(), 'topic_type_hash': type_hash}
            self._channels[name] = self._writer.register_channel(
                name, 'cdr', self._schemas[message_type], about
            )
        self._about[name] = {
            'name': name, 'type': message_type, 'serialization_format': 'cdr',
            'offered_qos_profiles': qos, 'type_description_hash': type_hash,
        }  # fmt: skip
        self.counts[name] = 0

    def write(self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int) -> None:
        """Append a message, with the times at which it was received and sent."""
        with self._write_errors():
            self._writer.add_message(
                self._channels[topic], log_time_ns, cdr, publish_time_ns, self.counts[topic]
            )
        self.counts[topic] += 1
        self._first_ns = min(self._first_ns, log_time_ns)
        self._last_ns = max(self._last_ns, log_time_ns)
        if self._chunk_opened_s is None:
            self._chunk_opened_s = time.monotonic()
        self.close_old_chunk()

    def close_old_chunk(self) -> None:
        """Hand the open chunk to the operating system if it is older than half a second."""
        opened = self._chunk_opened_s
        if opened is not None and time.monotonic() - opened >= 0.5:
            with self._write_errors():
                self._writer.flush()
            self._chunk_opened_s = None

    def finish(self) -> None:
        """Complete the run."""
        with self._write_errors():
            self._writer.flush()
            self._writer.add_metadata('rosbag2', {'serialized_metadata': _yaml(self._metadata())})
            self._writer.finish()
            self._stream.flush()
            os.fsync(self._stream.fileno())
            self._stream.close()
            information = {'rosbag2_bagfile_information': self._metadata()}
            write_text(self.folder / 'metadata.yaml', _yaml(information))
        self.complete = True

    def abandon(self) -> None:
        """Close the file as it is; the run stays unfinished."""
        self._raw.close()

    def __exit__(self, exception_type: type[BaseException] | None, *_: object) -> None:
        if exception_type is None:
            self.finish()
        else:
            self.abandon()

    @contextmanager
    def _write_errors(self) -> Iterator[None]:
        """Turn an OSError into a RecordingError; nothing can be written after the first."""
        if self._failure:
            raise RecordingError(self._failure)
        try:
            yield
        except OSError as error:
            self._failure = (
                f'{self.folder} is incomplete after {self.message_count} messages: '
                f'{error.strerror or error}; run `paint recover {self.folder}`'
            )
            # Closing the raw file discards the buffer, which cannot be written.
            self._raw.close()
            raise RecordingError(self._failure) from None

    def _metadata(self) -> dict:
        duration_ns = self._last_ns - self._first_ns if self.message_count else 0
        times = {
            'starting_time': {'nanoseconds_since_epoch': self._first_ns},
            'duration': {'nanoseconds': duration_ns},
            'message_count': self.message_count,
        }
        topics = [
            {'topic_metadata': about, 'message_count': self.counts[name]}
            for name, about in self._about.items()
        ]
        kept = ' '.join(f'{name}={count}' for name, count in self.kept.items())
        return {
            'version': 9, 'storage_identifier': 'mcap', **times,
            'topics_with_message_count': topics, 'compression_format': '', 'compression_mode': '',
            'relative_file_paths': [self.path.name],
            'files': [{'path': self.path.name, **times}],
            'custom_data': self.custom_data | ({KEPT: kept} if kept else {}),
            'ros_distro': self.ros_distro,
        }  # fmt: skip


def _yaml(value: object) -> str:
    # Equal values are repeated in full, as rosbag2 does, instead of with anchors.
    copied = json.loads(json.dumps(value))
    return yaml.safe_dump(copied, sort_keys=False, allow_unicode=True)
