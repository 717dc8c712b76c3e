"""Unfinished or damaged MCAP runs: what can still be read, as a whole rosbag2 folder."""

import shutil
import struct
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path

import lz4.frame
import yaml
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Footer, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.bag_files import mcap_files
from paint_deposition.files.recordings.mcap_run import RunTopic, RunWriter
from paint_deposition.files.recordings.message_definitions import Definition

MAX_CHUNK_BYTES = 256 * 1024 * 1024
RECORD_HEAD = struct.Struct('<BQ')  # opcode and length
# What the readers raise on bytes that are not what they should be.
DAMAGE = (
    McapError, struct.error, zstandard.ZstdError, ValueError, EOFError, RuntimeError,
    OverflowError,
)  # fmt: skip


@dataclass
class Recovery:
    """What came out of a damaged run.

    Attributes:
        folder: the new run.
        counts: messages by topic.
        damaged_chunks: chunks left out because their content is broken.
        breaks: where and why reading stopped, one line a file; empty for whole files.
        skipped_topics: topics that no rosbag2 folder can hold (not CDR, or without a schema).
    """

    folder: Path
    counts: dict[str, int] = field(default_factory=dict)
    damaged_chunks: int = 0
    breaks: list[str] = field(default_factory=list)
    skipped_topics: list[str] = field(default_factory=list)

    @property
    def message_count(self) -> int:
        return sum(self.counts.values())


def recover(
    path: Path | str,
    folder: Path | str,
    on_bytes: Callable[[int], None] = lambda count: None,
    topics: Collection[str] = (),
) -> Recovery:
    """Copy every readable message of `path` into the new run `folder`.

    Args:
        path: an .mcap file or the folder of a run (its files in the order of their numbers).
        folder: must not exist; QoS, type hashes, custom data and distribution come along.
        on_bytes: called with the number of bytes read, for a progress bar.
        topics: to copy; all, if none are named.

    Raises:
        RecordingError: `path` holds no MCAP file, `folder` exists or cannot be written, or no
            message could be read.
    """
    path, recovery = Path(path), Recovery(Path(folder))
    if not path.exists():
        raise RecordingError(f'{path} does not exist')
    files = mcap_files(path)
    if not files:
        raise RecordingError(f'{path} holds no .mcap file; only MCAP runs can be recovered')
    # The chunk that introduces a channel may be damaged; outside the chunks it stands again.
    outside = [record for file in files for record, _ in _records(file, Recovery(path))]
    information = _information(outside)
    writer = RunWriter(
        folder,
        custom_data=information.get('custom_data') or {},
        ros_distro=information.get('ros_distro'),
    )
    try:
        with writer:
            for file in files:
                known = [record for record, _ in _records(file, Recovery(path))]
                _copy(file, known, writer, recovery, on_bytes, topics)
            if not writer.message_count:
                reason = '; '.join(recovery.breaks) or 'no messages'
                raise RecordingError(f'nothing to recover in {path}: {reason}')
    except BaseException:
        shutil.rmtree(writer.folder, ignore_errors=True)
        raise
    recovery.counts = dict(writer.counts)
    return recovery


def _information(records: list[McapRecord]) -> dict:
    """What rosbag2 noted last of a run; {} where there is nothing that can be read."""
    for record in reversed(records):
        if isinstance(record, Metadata) and record.name == 'rosbag2':
            try:
                content = yaml.safe_load(record.metadata.get('serialized_metadata', ''))
            except yaml.YAMLError:
                continue
            if isinstance(content, dict):
                return content
    return {}


def _records(
    file: Path, recovery: Recovery, chunks: bool = False
) -> Iterator[tuple[McapRecord, int]]:
    """Records up to the break, which is noted, and the byte up to which the file was read.

    Those of chunks are among them if they are asked for.
    """
    size, start = file.stat().st_size, len(MCAP0_MAGIC)
    with file.open('rb') as stream:
        if stream.read(start) != MCAP0_MAGIC:
            raise RecordingError(f'{file} is not an MCAP file; nothing to recover')
        stream.seek(0)
        reader = StreamReader(stream, emit_chunks=True, record_size_limit=size)
        try:
            for record in reader.records:
                if not isinstance(record, Chunk):
                    yield record, stream.tell()
                elif chunks:
                    yield from ((inner, stream.tell()) for inner in _opened(record, recovery))
                if isinstance(record, Footer):
                    return
                start = stream.tell()
        except DAMAGE as error:
            cut = stream.tell() >= size or isinstance(error, RecordLengthLimitExceeded)
            stream.seek(start)
            if chunks and (beginning := _readable_beginning(stream.read(MAX_CHUNK_BYTES))):
                yield from ((inner, size) for inner in _opened(beginning, recovery))
            reason = 'the end is missing' if cut else str(error)
            recovery.breaks.append(f'{file.name} breaks off at byte {start} of {size}: {reason}')


def _opened(chunk: Chunk, recovery: Recovery) -> list[McapRecord]:
    try:
        if chunk.uncompressed_size > MAX_CHUNK_BYTES:
            raise ValueError('no recorder makes chunks of that size')
        return breakup_chunk(chunk, validate_crc=True)
    except DAMAGE:
        recovery.damaged_chunks += 1
        return []


def _copy(
    file: Path,
    known: list[McapRecord],
    writer: RunWriter,
    recovery: Recovery,
    on_bytes: Callable[[int], None],
    topics: Collection[str],
) -> None:
    schemas = {record.id: record for record in known if isinstance(record, Schema)}
    channels = {record.id: record for record in known if isinstance(record, Channel)}
    position = 0
    for record, at in _records(file, recovery, chunks=True):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
        if isinstance(record, Channel | Message):
            channel = record if isinstance(record, Channel) else channels.get(record.channel_id)
            if channel is not None and (not topics or channel.topic in topics):
                kept = _is_kept(channel, schemas.get(channel.schema_id), writer, recovery)
                if kept and isinstance(record, Message):
                    writer.write(channel.topic, record.data, record.log_time, record.publish_time)
        on_bytes(at - position)
        position = at


def _is_kept(
    channel: Channel, schema: Schema | None, writer: RunWriter, recovery: Recovery
) -> bool:
    """Make a channel's topic known to the writer, unless no rosbag2 folder can hold it."""
    if channel.topic in writer.counts:
        return True
    try:
        text = schema.data.decode() if schema else ''
        offered = channel.metadata.get('offered_qos_profiles', '')
        qos = parse_qos(offered) if offered else []
    except UnicodeDecodeError:
        text = ''
    except (ReaderError, KeyError, TypeError, AttributeError):
        qos = []  # damaged; players take their default then
    if schema is None or not text or channel.message_encoding != 'cdr':
        if channel.topic not in recovery.skipped_topics:
            recovery.skipped_topics.append(channel.topic)
        return False
    definition = Definition(text, channel.metadata.get('topic_type_hash', ''), schema.encoding)
    writer.add_topic(RunTopic(channel.topic, schema.name, definition, qos))
    return True


def _readable_beginning(record: bytes) -> Chunk | None:
    """An uncompressed chunk of the whole messages in a cut chunk record, None if there are none.

    Recorders that close a chunk at a megabyte leave half a minute of poses in the last, cut one.
    Its checksum covers all of it and cannot be checked any more.
    """
    if record[:1] != bytes([Opcode.CHUNK]):
        return None
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(record[RECORD_HEAD.size :])))
        data = chunk.data
        if chunk.compression == 'zstd':
            data = zstandard.ZstdDecompressor().decompressobj().decompress(data)
        elif chunk.compression == 'lz4':
            data = lz4.frame.LZ4FrameDecompressor().decompress(data)
    except DAMAGE:
        return None
    end = 0
    while end + RECORD_HEAD.size <= len(data):
        length = RECORD_HEAD.size + RECORD_HEAD.unpack_from(data, end)[1]
        if end + length > len(data):
            break
        end += length
    whole = replace(
        chunk, compression='', data=data[:end], uncompressed_crc=0, uncompressed_size=end
    )
    return whole if end else None
