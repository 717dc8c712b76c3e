"""Recovery of unfinished or damaged MCAP runs into a complete rosbag2 folder."""

import math
import shutil
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from io import BytesIO
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import IO, Any, cast

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Footer, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos

from paint_deposition.errors import RecordingError
from paint_deposition.files.atomic import load_yaml, require_file
from paint_deposition.files.recordings.bag_files import MOST_CHUNK_BYTES, expanded, mcap_files
from paint_deposition.files.recordings.mcap_run import RunWriter

# Exceptions of the readers on damaged data.
DAMAGE = (
    McapError, struct.error, zstandard.ZstdError, ValueError, EOFError, RuntimeError,
    OverflowError, KeyError,
)  # fmt: skip
Lost = dict[str, Any]  # what could not be read, by its name in the figures


def recover(
    path: Path | str,
    folder: Path | str,
    on_bytes: Callable[[int], None] = lambda count: None,
) -> tuple[RunWriter, Lost]:
    """Copy every readable message of an .mcap file or a run's folder into the new run `folder`.

    QoS, type hashes, custom data and distribution are copied as well.

    Args:
        on_bytes: called with the number of bytes read, for a progress bar.

    Returns:
        The new run, and what could not be read: the number of ``damaged_chunks``; ``breaks``,
        where and why reading stopped, one line for each incomplete file; ``skipped_topics``,
        which a rosbag2 folder cannot hold (not CDR, or without a schema).

    Raises:
        RecordingError: `path` holds no MCAP file, `folder` exists or cannot be written, or no
            message could be read.
    """
    path = Path(path)
    if not path.exists():
        raise RecordingError(f'{path} does not exist')
    require_file(path, RecordingError, math.inf)
    files = mcap_files(path)
    if not files:
        raise RecordingError(f'{path} holds no .mcap file; only MCAP runs can be recovered')
    run = RunWriter(folder)
    lost: Lost = {'damaged_chunks': 0, 'breaks': [], 'skipped_topics': []}
    try:
        with run:
            for file in files:
                _copy(file, run, lost, on_bytes)
            if not run.message_count:
                reason = '; '.join(lost['breaks']) or 'no messages'
                raise RecordingError(f'nothing to recover in {path}: {reason}')
    except BaseException:
        shutil.rmtree(run.folder, ignore_errors=True)
        raise
    return run, lost


def _copy(file: Path, run: RunWriter, lost: Lost, on_bytes: Callable[[int], None]) -> None:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    # The summary, if any, repeats all channels, in case the chunk that defines one is damaged.
    with suppress(*DAMAGE, OSError), _mapped(file) as stream:
        reader = SeekingReader(stream, record_size_limit=file.stat().st_size)
        if summary := reader.get_summary():
            schemas, channels = dict(summary.schemas), dict(summary.channels)
    for record in _records(file, lost, on_bytes):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Metadata) and record.name == 'rosbag2':
            # An older record, or none, has to do where this one is damaged.
            with suppress(Exception):
                text = record.metadata.get('serialized_metadata', '')
                content = load_yaml(text)
                custom = content.get('custom_data') or {}
                run.custom_data = {key: str(value) for key, value in custom.items()}
                run.ros_distro = content.get('ros_distro') or run.ros_distro
        elif isinstance(record, Channel):
            channels[record.id] = record
        if isinstance(record, Channel | Message):
            channel = record if isinstance(record, Channel) else channels.get(record.channel_id)
            if channel is not None:
                kept = _ensure_topic(channel, schemas.get(channel.schema_id), run, lost)
                if kept and isinstance(record, Message):
                    run.write(channel.topic, record.data, record.log_time, record.publish_time)


def _records(file: Path, lost: Lost, on_bytes: Callable[[int], None]) -> Iterator[McapRecord]:
    """The records up to the break, which is noted, including those in chunks."""
    size, start = file.stat().st_size, len(MCAP0_MAGIC)
    with _mapped(file) as stream:
        reader = StreamReader(stream, emit_chunks=True, record_size_limit=size)
        try:
            for record in reader.records:
                yield from _chunk_records(record, lost) if isinstance(record, Chunk) else [record]
                if isinstance(record, Footer):
                    return
                on_bytes(stream.tell() - start)
                start = stream.tell()
        except DAMAGE as error:
            cut = stream.tell() >= size or isinstance(error, RecordLengthLimitExceeded)
            reason = 'the end is missing' if cut else str(error)
            lost['breaks'].append(f'{file.name} breaks off at byte {start} of {size}: {reason}')
            stream.seek(start)
            yield from _truncated_chunk_records(stream.read(MOST_CHUNK_BYTES))


@contextmanager
def _mapped(file: Path) -> Iterator[IO[bytes]]:
    """The file to read from: as mapped memory it gives what is there, and no more is asked for."""
    with file.open('rb') as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as content:
        yield cast(IO[bytes], content)


def _chunk_records(chunk: Chunk, lost: Lost) -> list[McapRecord]:
    try:
        data = chunk.data
        if chunk.compression:
            data = expanded(
                chunk.compression, data, min(chunk.uncompressed_size, MOST_CHUNK_BYTES)
            )
        if len(data) != chunk.uncompressed_size:
            raise ValueError('a chunk has another size than it says')
        return breakup_chunk(replace(chunk, compression='', data=data), validate_crc=True)
    except DAMAGE:
        lost['damaged_chunks'] += 1
        return []


def _truncated_chunk_records(record: bytes) -> Iterator[McapRecord]:
    """The complete records in a truncated chunk, whose checksum cannot be verified.

    With chunks of a megabyte, the last one may hold half a minute of poses.
    """
    if record[:1] != bytes([Opcode.CHUNK]):
        return
    try:
        # Behind the opcode and the length of the record.
        chunk = Chunk.read(ReadDataStream(BytesIO(record[9:])))
        data = expanded(chunk.compression, chunk.data) if chunk.compression else chunk.data
        reader = StreamReader(BytesIO(data), skip_magic=True, record_size_limit=len(data))
        yield from reader.records
    except DAMAGE:
        return


def _ensure_topic(channel: Channel, schema: Schema | None, run: RunWriter, lost: Lost) -> bool:
    """Add a channel's topic to the run; False if a rosbag2 folder cannot hold it."""
    if channel.topic in run.counts:
        return True
    if schema is None or channel.message_encoding != 'cdr':
        if channel.topic not in lost['skipped_topics']:
            lost['skipped_topics'].append(channel.topic)
        return False
    text = schema.data.decode(errors='replace')
    try:
        qos = parse_qos(channel.metadata.get('offered_qos_profiles', ''))
    except (ReaderError, KeyError, TypeError, AttributeError):
        qos = []  # damaged; players take their default then
    definition = text, channel.metadata.get('topic_type_hash', '')
    run.add_topic(channel.topic, schema.name, definition, qos, schema.encoding)
    return True
