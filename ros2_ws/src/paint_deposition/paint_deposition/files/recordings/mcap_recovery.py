"""Unfinished or damaged MCAP runs: what can still be read, as a whole rosbag2 folder."""

import mmap
import re
import shutil
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import IO, cast

import lz4.frame
import yaml
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Footer, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from rosbags.interfaces import Qos
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos

from paint_deposition.errors import RecordingError
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


def is_unfinished(path: Path) -> bool:
    """True for a file that begins as MCAP and does not end as one."""
    with path.open('rb') as stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            return False
        size = stream.seek(0, 2)
        if size < 2 * len(MCAP0_MAGIC):
            return True
        stream.seek(-len(MCAP0_MAGIC), 2)
        return stream.read() != MCAP0_MAGIC


def recover(
    path: Path | str,
    folder: Path | str,
    on_bytes: Callable[[int], None] = lambda count: None,
) -> Recovery:
    """Copy every readable message of `path` into the new run `folder`.

    Args:
        path: an .mcap file or the folder of a run (its files in the order of their numbers).
        folder: must not exist; QoS, type hashes, custom data and distribution come along.
        on_bytes: called with the number of bytes read, for a progress bar.

    Raises:
        RecordingError: `path` holds no MCAP file, `folder` exists or cannot be written, or no
            message could be read.
    """
    files = mcap_files(Path(path))
    _refuse_what_is_no_mcap(Path(path), files)
    surveys = [_survey(file) for file in files]
    information = next((s.information for s in reversed(surveys) if s.information), {})
    writer = RunWriter(
        folder,
        custom_data=information.get('custom_data') or {},
        ros_distro=information.get('ros_distro'),
    )
    recovery = Recovery(writer.folder)
    try:
        with writer:
            for file, survey in zip(files, surveys, strict=True):
                _copy(file, survey, writer, recovery, on_bytes)
            if not writer.message_count:
                reason = '; '.join(recovery.breaks) or 'no messages'
                raise RecordingError(f'nothing to recover in {path}: {reason}')
    except BaseException:
        shutil.rmtree(writer.folder, ignore_errors=True)
        raise
    recovery.counts = dict(writer.counts)
    return recovery


def mcap_files(path: Path) -> list[Path]:
    """The MCAP files of a run: those of the folder in their order, or the one file given.

    Raises RecordingError when the files of a folder belong to several runs.
    """
    if path.is_file():
        return [path]
    files = sorted((file for file in path.glob('*.mcap') if file.is_file()), key=_number)
    runs = {re.sub(r'_\d+$', '', file.stem) for file in files}
    if len(runs) > 1:
        names = ' '.join(file.name for file in files)
        raise RecordingError(f'{path} holds several recordings; name one of them: {names}')
    return files


def _refuse_what_is_no_mcap(path: Path, files: list[Path]) -> None:
    if not path.exists():
        raise RecordingError(f'{path} does not exist')
    if not files:
        raise RecordingError(f'{path} holds no .mcap file; only MCAP runs can be recovered')
    for file in files:
        with file.open('rb') as stream:
            if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                raise RecordingError(f'{file} is not an MCAP file; nothing to recover')


def _number(file: Path) -> tuple[int, str]:
    number = re.search(r'_(\d+)$', file.stem)
    return (int(number[1]) if number else 0, file.name)


@dataclass
class _Survey:
    """What a file says outside its chunks: rosbag2's newest metadata, the repeated channels."""

    information: dict = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)

    def note(self, record: McapRecord) -> None:
        if isinstance(record, Metadata) and record.name == 'rosbag2':
            self.information = _mapping(record) or self.information
        elif isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record


def _survey(file: Path) -> _Survey:
    survey = _Survey()
    with _content(file) as stream:
        for record in _records(file, stream, []):
            survey.note(record)
    return survey


@contextmanager
def _content(file: Path) -> Iterator[mmap.mmap]:
    """A file as bytes; a plain stream would take memory for what a damaged length asks for."""
    with file.open('rb') as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as all_:
        yield all_


def _mapping(record: Metadata) -> dict:
    try:
        content = yaml.safe_load(record.metadata.get('serialized_metadata', ''))
    except yaml.YAMLError:  # damaged; an older record, or none, has to do
        return {}
    return content if isinstance(content, dict) else {}


def _records(file: Path, stream: mmap.mmap, breaks: list[str]) -> Iterator[McapRecord]:
    """Records up to the break, which is noted; chunks are not opened."""
    size = file.stat().st_size
    reader = StreamReader(cast(IO[bytes], stream), emit_chunks=True, record_size_limit=size)
    record_at = len(MCAP0_MAGIC)
    try:
        for record in reader.records:
            yield record
            if isinstance(record, Footer):
                return
            record_at = stream.tell()
    except DAMAGE as error:
        cut = stream.tell() >= size or isinstance(error, RecordLengthLimitExceeded)
        stream.seek(record_at)
        beginning = _readable_beginning(stream.read(MAX_CHUNK_BYTES))
        if beginning:
            yield beginning
        reason = 'the end is missing' if cut else str(error)
        breaks.append(f'{file.name} breaks off at byte {record_at} of {size}: {reason}')


def _copy(
    file: Path,
    survey: _Survey,
    writer: RunWriter,
    recovery: Recovery,
    on_bytes: Callable[[int], None],
) -> None:
    with _content(file) as stream:
        position = 0
        for record in _records(file, stream, recovery.breaks):
            for inner in _opened(record, recovery):
                survey.note(inner)
                if isinstance(inner, Channel):
                    _is_kept(inner, survey, writer, recovery)
                elif isinstance(inner, Message):
                    # The chunk that introduced the channel may be among the damaged ones.
                    channel = survey.channels.get(inner.channel_id)
                    if channel and _is_kept(channel, survey, writer, recovery):
                        writer.write(channel.topic, inner.data, inner.log_time, inner.publish_time)
            on_bytes(stream.tell() - position)
            position = stream.tell()


def _opened(record: McapRecord, recovery: Recovery) -> list[McapRecord]:
    if not isinstance(record, Chunk):
        return [record]
    try:
        if record.uncompressed_size > MAX_CHUNK_BYTES:
            raise ValueError('no recorder makes chunks of that size')
        return breakup_chunk(record, validate_crc=True)
    except DAMAGE:
        recovery.damaged_chunks += 1
        return []


def _is_kept(channel: Channel, survey: _Survey, writer: RunWriter, recovery: Recovery) -> bool:
    """Make a channel's topic known to the writer, unless no rosbag2 folder can hold it."""
    schema = survey.schemas.get(channel.schema_id)
    text = _text(schema)
    if schema is None or text is None or channel.message_encoding != 'cdr':
        if channel.topic not in recovery.skipped_topics:
            recovery.skipped_topics.append(channel.topic)
        return False
    if channel.topic not in writer.counts:
        definition = Definition(text, channel.metadata.get('topic_type_hash', ''), schema.encoding)
        writer.add_topic(RunTopic(channel.topic, schema.name, definition, _qos(channel)))
    return True


def _text(schema: Schema | None) -> str | None:
    try:
        return schema.data.decode() if schema else None
    except UnicodeDecodeError:
        return None


def _qos(channel: Channel) -> list[Qos]:
    try:
        return parse_qos(channel.metadata.get('offered_qos_profiles', ''))
    except (ReaderError, KeyError, TypeError, AttributeError):
        return []  # damaged; players take their default then


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
    whole = data[:end]
    return (
        replace(chunk, compression='', data=whole, uncompressed_crc=0, uncompressed_size=end)
        if whole
        else None
    )
