"""One interface to all bags: ROS 1 .bag, rosbag2 folder (sqlite3, MCAP), single .mcap.

Only the types of the topics that are read are parsed: a topic that rosbags does not support, such
as service events, does not make the others unreadable.
"""

import bz2
import math
import re
import shutil
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import gettempdir
from types import SimpleNamespace
from typing import Any, BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC
from rosbags.interfaces import MessageDefinitionFormat, Nodetype
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag1 import reader as ros1_reader
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2 import metadata as ros2_metadata
from rosbags.rosbag2 import reader as ros2_reader
from rosbags.rosbag2 import storage_mcap
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from ruamel.yaml import YAML

from paint_deposition.errors import LONGEST_REASON, RecordingError, shortened
from paint_deposition.files.atomic import MOST_YAML_MB, load_yaml, read_file, require_file
from paint_deposition.files.recordings import messages as definitions

# The key under which the custom data of a plan's bag names its trigger topic.
TRIGGER = 'trigger_topic'
# The key under which a run says how many messages of a topic are of its part, if not all.
KEPT = 'messages_of_the_part'
ROS2_SUFFIXES = ('.mcap', '.db3')
# Of a chunk, expanded; recorders make chunks of some megabytes. Of a file compressed as a whole.
MOST_CHUNK_BYTES, MOST_FILE_BYTES = 256 * 1024 * 1024, 20_000_000_000
# Elements of the arrays of fixed length in a type, other than arrays of numbers.
MOST_FIXED = 10_000


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag; `type` is written as ROS 2 does (`pkg/msg/Type`), for ROS 1 as well."""

    name: str
    type: str
    message_count: int


class RawMessage(NamedTuple):
    """A serialised message, in CDR also for ROS 1 bags."""

    topic: str
    type: str
    log_time_ns: int
    cdr: bytes


class Bag:
    """An open bag; made by `open_bag`.

    Attributes:
        custom_data: see the function of that name.
        warnings: what it lacks.
        skipped: how many messages are left out as the nodes leave them out, by what they are.
    """

    def __init__(self, path: Path, reader: Ros1Reader | Ros2Reader) -> None:
        self.path = path
        self._reader = reader
        self._is_ros1 = isinstance(reader, Ros1Reader)
        self._stores: dict[str, Typestore] = {}
        counts: Counter[tuple[str, str]] = Counter()
        for connection in reader.connections:
            counts[connection.topic, connection.msgtype] += connection.msgcount
        self.custom_data, names = _metadata(path)
        kept = self.custom_data.get(KEPT, '').split()
        self.warnings: tuple[str, ...] = ()
        self.skipped: Counter[str] = Counter()
        if names and len(names) > 1 and path.name in names:
            several = f'{path.name} is one of the {len(names)} files of a split bag'
            self.warnings = (f'{several}; give its folder, {path.parent}, for all of it',)
        self._kept = {name: int(n) for name, _, n in (entry.partition('=') for entry in kept)}
        # Sorted by name, topics without messages included.
        self.topics = [
            BagTopic(*key, min(count, self._kept.get(key[0], count)))
            for key, count in sorted(counts.items())
        ]

    def topics_of(self, *types: str) -> list[BagTopic]:
        """Topics of these types, those of the first type first."""
        return [topic for type_ in types for topic in self.topics if topic.type == type_]

    def find(self, name: str) -> BagTopic | None:
        """The topic of that name, given with or without a leading slash."""
        wanted = name.lstrip('/')
        return next((topic for topic in self.topics if topic.name.lstrip('/') == wanted), None)

    def choose(self, name: str, types: Sequence[str], kind: str) -> BagTopic:
        """The named topic, which must have one of these types; the error lists those that do."""
        listed = listed_topics(self.topics_of(*types), kind)
        topic = self.find(name)
        if topic is None:
            raise RecordingError(f'{self.path} has no topic {name}; {listed}')
        if topic.type not in types:
            raise RecordingError(
                f'{topic.name} in {self.path} is {topic.type}, not {" or ".join(types)}; {listed}'
            )
        return topic

    def decode(self, message: RawMessage) -> Any:
        """The message object of rosbags for one of this bag's messages."""
        with _read_errors(self.path):
            return self._types(message.topic).deserialize_cdr(message.cdr, message.type)

    def messages(self, topics: Sequence[str]) -> Iterator[RawMessage]:
        """Messages of these topics in the order of their log time."""
        left = dict(self._kept)
        with _read_errors(self.path):
            chosen = [c for c in self._reader.connections if c.topic in topics]
            if not chosen:  # of which the readers would give all
                return
            for connection, log_time_ns, data in self._reader.messages(connections=chosen):
                topic, type_ = connection.topic, connection.msgtype
                if topic in left:
                    if not left[topic]:
                        continue
                    left[topic] -= 1
                cdr = self._types(topic).ros1_to_cdr(data, type_) if self._is_ros1 else data
                yield RawMessage(topic, type_, log_time_ns, bytes(cdr))

    def decoded(self, topics: Sequence[str]) -> Iterator[tuple[str, int, Any]]:
        """(topic, log time [ns], message object of rosbags) of these topics."""
        # Entered once: for each message it takes as long as decoding.
        with _read_errors(self.path):
            for topic, type_, log_time_ns, cdr in self.messages(topics):
                yield topic, log_time_ns, self._types(topic).deserialize_cdr(cdr, type_)

    def sent_ns(self, topics: Sequence[str]) -> dict[int, int]:
        """When messages of these topics were sent by when they were logged; empty if not known."""
        sent: dict[int, int] = {}
        for file in (each for each in mcap_files(self.path) if each.suffix == '.mcap'):
            with _read_errors(self.path), file.open('rb') as stream:
                read = make_reader(stream).iter_messages(topics)
                sent |= {message.log_time: message.publish_time for *_, message in read}
        return sent

    def _types(self, topic: str) -> Typestore:
        """The types of a topic's messages; headers of ROS 1 as in ROS 2, without `seq`."""
        if topic not in self._stores:
            connection = next(c for c in self._reader.connections if c.topic == topic)
            store = get_typestore(definitions.STANDARD_STORE if self._is_ros1 else Stores.EMPTY)
            form, text = connection.msgdef
            standard = definitions.own_types().fielddefs
            if form == MessageDefinitionFormat.IDL:
                types = get_types_from_idl(text)
            elif form == MessageDefinitionFormat.MSG:
                types = get_types_from_msg(text, connection.msgtype)
            elif connection.msgtype in standard:  # older sqlite3 bags hold no definitions at all
                types = dict(standard)
            else:
                text, _ = definitions.installed(connection.msgtype)
                types = get_types_from_msg(text, connection.msgtype)
            # Of the project's own types earlier versions have fewer fields.
            for name in [n for n in types.keys() & standard.keys() if 'paint_msgs' not in n]:
                found = {field for field, _ in types[name][1]}
                if lacking := [field for field, _ in standard[name][1] if field not in found]:
                    raise RecordingError(f'{topic}: its definition of {name} lacks {lacking[0]}')
            # For each element of these rosbags would write a line of code.
            entries: list[Any] = [*types.values()]
            fields = (kind for _, of in entries for _, kind in of)
            arrays = (of for kind, of in fields if kind == Nodetype.ARRAY)
            texts = ('string', 'wstring')
            long = sum(n for (kind, of), n in arrays if kind != Nodetype.BASE or of[0] in texts)
            if long > MOST_FIXED:
                raise RecordingError(
                    f'{topic} has a type with arrays of {long} elements, over {MOST_FIXED}'
                )
            store.register({name: types[name] for name in types if name not in store.fielddefs})
            self._stores[topic] = store
        return self._stores[topic]


def expanded(compression: str, data: bytes, most_bytes: int = MOST_CHUNK_BYTES) -> bytes:
    """A chunk as it was before it was compressed, cut where it holds more than it may."""
    if compression == 'zstd':
        return zstandard.ZstdDecompressor().stream_reader(data).read(most_bytes + 1)
    of_kind = {'lz4': lz4.frame.LZ4FrameDecompressor, 'bz2': bz2.BZ2Decompressor}
    return of_kind[compression]().decompress(data, most_bytes + 1)


def _small(compression: str, data: bytes, size: int = MOST_CHUNK_BYTES) -> bytes:
    content = expanded(compression, data, min(size, MOST_CHUNK_BYTES))
    if len(content) > MOST_CHUNK_BYTES:
        raise ValueError('a chunk is larger than any recorder makes')
    return content


@contextmanager
def _small_file(file: BinaryIO, mode: str) -> Iterator[Any]:
    """A file that was compressed as a whole, expanded while it is read."""
    left = most = min(MOST_FILE_BYTES, shutil.disk_usage(gettempdir()).free // 2)
    stream = zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)

    def read(size: int) -> bytes:
        nonlocal left
        block = stream.read(size)
        left -= len(block)
        if left < 0:
            raise RecordingError(
                f'{file.name}: it holds over {most / 1e9:.3g} GB, more than there is room for in '
                f'{gettempdir()} or than any run has; expand it where there is room (zstd -d)'
            )
        return block

    yield SimpleNamespace(read=read)


# rosbags expands chunks, messages and files to any size, and reads YAML by a parser in C.
for of_rosbags in (ros2_metadata, ros2_reader):
    vars(of_rosbags)['YAML'] = lambda **kind: SimpleNamespace(
        load=load_yaml, dump=YAML(**kind).dump
    )
vars(ros2_reader)['zstd'] = SimpleNamespace(open=_small_file, decompress=partial(_small, 'zstd'))
storage_mcap.DECOMPRESSORS.update({c: partial(_small, c) for c in ('lz4', 'zstd')})
ros1_reader.decompressors.update({c: partial(_small, c) for c in ('lz4', 'bz2')})


def listed_topics(topics: Sequence[BagTopic], kind: str) -> str:
    """The topics of a kind, for a message."""
    if not topics:
        return f'it has no {kind} topic'
    return f'its {kind} topics: {" ".join(topic.name for topic in topics)}'


@contextmanager
def open_bag(path: Path | str) -> Iterator[Bag]:
    """Open a bag; errors, also while it is read, are RecordingErrors with a remedy."""
    path = Path(path)
    _require_bag(path)
    with _read_errors(path):
        if (path / 'metadata.yaml').is_file():
            require_file(path / 'metadata.yaml', RecordingError, MOST_YAML_MB)
        reader = Ros1Reader(path) if path.suffix == '.bag' else Ros2Reader(path)
        reader.open()
    try:
        with _read_errors(path):
            bag = Bag(path, reader)
        yield bag
    finally:
        reader.close()


def custom_data(path: Path) -> dict[str, str]:
    """The custom data in the metadata.yaml of a rosbag2 folder, or of one of its files."""
    return _metadata(path)[0]


def _metadata(path: Path) -> tuple[dict[str, str], list[str] | None]:
    """Custom data, and the names of the files as they are when they are expanded, None if unsaid.

    They are those in a rosbag2 folder, or beside a file if they name it; none if unreadable.
    """
    folder = path if path.is_dir() else path.parent
    try:
        text = read_file(folder / 'metadata.yaml', RecordingError, MOST_YAML_MB).decode('utf-8')
        metadata = load_yaml(text)
        told = dict(metadata['rosbag2_bagfile_information'])
    except Exception:  # damaged, or no bag, which reading it reports
        return {}, None
    listed, custom = told.get('relative_file_paths'), told.get('custom_data')
    names = None
    if isinstance(listed, list):
        names = [Path(str(name)).name.removesuffix('.zstd') for name in listed]
    if not (path.is_dir() or path.name in (names or ())):
        return {}, None
    known = custom if isinstance(custom, dict) else {}
    return {str(key): str(value) for key, value in known.items()}, names


def mcap_files(path: Path) -> list[Path]:
    """The MCAP files of a run in order, or the single file; several runs are refused."""
    if path.is_file():
        return [path]

    def place(file: Path) -> tuple[int, str]:
        number = re.search(r'_(\d+)$', file.stem)
        return (int(number[1]) if number else 0, file.name)

    files = sorted((file for file in path.glob('*.mcap') if file.is_file()), key=place)
    if len({re.sub(r'_\d+$', '', file.stem) for file in files}) > 1:
        names = ' '.join(file.name for file in files)
        raise RecordingError(f'{path} holds several recordings; name one of them: {names}')
    return files


def _require_bag(path: Path) -> None:
    """Refuse what is no bag, and one that its recorder has not finished."""
    if not path.exists():
        raise RecordingError(
            f'{path}: no such file; give a bag, a table of poses or a RAPID module'
        )
    for file in path.iterdir() if path.is_dir() else [path]:
        require_file(file, RecordingError, math.inf)
    names = [file.name.removesuffix('.zstd') for file in path.iterdir()] if path.is_dir() else []
    stored = {name for name in names if name.endswith(ROS2_SUFFIXES)}
    if path.is_dir() and not stored:
        raise RecordingError(f'{path} is not a rosbag2 folder: it holds no .mcap or .db3 file')
    if path.is_file() and path.suffix not in ('.bag', *ROS2_SUFFIXES):
        raise RecordingError(
            f'{path} is not a bag; give a ROS 1 .bag, a rosbag2 folder, or an .mcap file'
        )
    if path.is_file() and path.stat().st_size == 0:
        raise RecordingError(f'{path} is empty')
    unfinished = ''
    for file in mcap_files(path):
        with file.open('rb') as stream:
            begins = stream.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC
            stream.seek(max(stream.seek(0, 2) - len(MCAP0_MAGIC), len(MCAP0_MAGIC)))
            if begins and stream.read() != MCAP0_MAGIC:
                unfinished = unfinished or f'{file.name} has no end'
    if path.is_dir() and not (path / 'metadata.yaml').is_file():
        unfinished = unfinished or 'it has no metadata.yaml'
    # A recorder that splits its bag and is killed has not named the last file yet.
    _, known = _metadata(path)
    others = set() if known is None else stored - {*known}
    if path.is_dir() and others:
        named = ', '.join(sorted(others))
        unfinished = unfinished or f'its metadata.yaml does not name {named}'
    if unfinished:
        remedy = _remedy(path) or f'; run: ros2 bag reindex {path}'
        raise RecordingError(f'{path} is an unfinished recording ({unfinished}){remedy}')


@contextmanager
def _read_errors(path: Path) -> Iterator[None]:
    """Turn whatever the readers raise into a RecordingError of one line."""
    try:
        yield
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f'cannot read {path}: {error.strerror or error}') from None
    except Exception as error:
        reason = shortened(str(error), LONGEST_REASON).rstrip('.') or type(error).__name__
        if isinstance(error, MemoryError):
            reason = 'a record claims more than there is memory'
        raise RecordingError(f'{path} is damaged ({reason}){_remedy(path)}') from None


def _remedy(path: Path) -> str:
    if path.suffix == '.bag':
        return f'; run: rosbag reindex {path}'
    if path.suffix == '.mcap' or any(path.glob('*.mcap')):
        return f'; run: paint recover {path}'
    return ''
