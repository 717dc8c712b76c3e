"""Reading bags of every kind alike: ROS 1 .bag, rosbag2 folder (sqlite3, MCAP), lone .mcap.

Only the types of the topics that are read are parsed: one exotic topic, such as the service
events that rosbags does not understand, does not make the poses beside it unreadable.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings import message_definitions as definitions
from paint_deposition.files.recordings.mcap_recovery import is_unfinished, mcap_files

ROS2_SUFFIXES = ('.mcap', '.db3')


class BagTopic(NamedTuple):
    """A topic of a bag; `type` is written as ROS 2 does (`pkg/msg/Type`), for ROS 1 as well."""

    name: str
    type: str
    message_count: int


class RawMessage(NamedTuple):
    """A message as the middleware carries it: CDR, also for bags of ROS 1."""

    topic: str
    type: str
    log_time_ns: int
    cdr: bytes


class Bag:
    """An open bag; made by `open_bag`."""

    def __init__(self, path: Path, reader: Ros1Reader | Ros2Reader) -> None:
        self.path = path
        self.is_ros1 = isinstance(reader, Ros1Reader)
        self._reader = reader

    @functools.cached_property
    def topics(self) -> list[BagTopic]:
        """Topics in order of their names, those without messages included."""
        counts: dict[tuple[str, str], int] = {}
        for connection in self._reader.connections:
            key = (connection.topic, connection.msgtype)
            counts[key] = counts.get(key, 0) + connection.msgcount
        return [BagTopic(name, type_, count) for (name, type_), count in sorted(counts.items())]

    def topics_of(self, message_type: str) -> list[str]:
        return [topic.name for topic in self.topics if topic.type == message_type]

    def find(self, name: str) -> BagTopic | None:
        """The topic of that name, given with or without a leading slash."""
        for topic in self.topics:
            if topic.name.lstrip('/') == name.lstrip('/'):
                return topic
        return None

    def type_hash(self, name: str) -> str:
        """RIHS01 hash of a topic's type as the bag defines it."""
        with _reading(self.path):
            connection = self._connection(name)
            return self._types(connection).hash_rihs01(connection.msgtype)

    def decode(self, message: RawMessage) -> Any:
        """The message object of rosbags for one of this bag's messages."""
        with _reading(self.path):
            connection = self._connection(message.topic)
            types = self._ros2_types(connection) if self.is_ros1 else self._types(connection)
            return types.deserialize_cdr(message.cdr, message.type)

    def _connection(self, topic: str) -> Connection:
        return next(c for c in self._reader.connections if c.topic == topic)

    def messages(self, topics: Sequence[str] = ()) -> Iterator[RawMessage]:
        """Messages of these topics (all, if none are named) in the order of their log time."""
        with _reading(self.path):
            for connection, log_time_ns, data in self._raw(topics):
                if self.is_ros1:
                    types = self._ros2_types(connection)
                    data = bytes(types.ros1_to_cdr(data, connection.msgtype))
                yield RawMessage(connection.topic, connection.msgtype, log_time_ns, bytes(data))

    def decoded(self, topics: Sequence[str]) -> Iterator[tuple[str, int, Any]]:
        """(topic, log time [ns], message object of rosbags) of these topics."""
        with _reading(self.path):
            for connection, log_time_ns, data in self._raw(topics):
                types = self._types(connection)
                decode = types.deserialize_ros1 if self.is_ros1 else types.deserialize_cdr
                yield connection.topic, log_time_ns, decode(data, connection.msgtype)

    def _raw(self, topics: Sequence[str]) -> Iterator[tuple[Connection, int, bytes]]:
        chosen = [c for c in self._reader.connections if not topics or c.topic in topics]
        return self._reader.messages(connections=chosen)

    @functools.cached_property
    def _stores(self) -> dict[str, Typestore]:
        return {}

    def _types(self, connection: Connection) -> Typestore:
        store = self._stores.get(connection.msgtype)
        if store is None:
            store = get_typestore(Stores.EMPTY)
            store.register(self._definitions(connection))
            self._stores[connection.msgtype] = store
        return store

    @functools.cached_property
    def _converter(self) -> Typestore:
        return get_typestore(definitions.STANDARD_STORE)

    def _ros2_types(self, connection: Connection) -> Typestore:
        """ROS 2's layout of a ROS 1 type: its header has no sequence number."""
        store = self._converter
        if connection.msgtype not in store.fielddefs:
            own = self._definitions(connection)
            store.register({name: own[name] for name in own if name not in store.fielddefs})
        return store

    def _definitions(self, connection: Connection) -> dict:
        kind, text = connection.msgdef
        if kind == MessageDefinitionFormat.MSG:
            return get_types_from_msg(text, connection.msgtype)
        if kind == MessageDefinitionFormat.IDL:
            return get_types_from_idl(text)
        standard = get_typestore(definitions.STANDARD_STORE)
        if connection.msgtype in standard.fielddefs:
            return dict(standard.fielddefs)
        # Older sqlite3 bags hold no definitions at all.
        return get_types_from_msg(
            definitions.installed(connection.msgtype).text, connection.msgtype
        )


@contextmanager
def open_bag(path: Path | str) -> Iterator[Bag]:
    """Open a bag for reading.

    Raises RecordingError with one line and the remedy when there is none at `path`, when it is
    something else, and when it is unfinished or damaged; the latter while it is read, too.
    """
    path = Path(path)
    _refuse_what_is_no_bag(path)
    with _reading(path):
        reader = Ros1Reader(path) if path.suffix == '.bag' else Ros2Reader(path)
        reader.open()
    try:
        yield Bag(path, reader)
    finally:
        reader.close()


def _refuse_what_is_no_bag(path: Path) -> None:
    if not path.exists():
        raise RecordingError(f'no bag at {path}')
    if path.is_dir():
        if not any(file.suffix in ROS2_SUFFIXES or _compressed(file) for file in path.iterdir()):
            raise RecordingError(f'{path} is not a rosbag2 folder: it holds no .mcap or .db3 file')
        for file in mcap_files(path):
            _refuse_unfinished(file, path)
        if not (path / 'metadata.yaml').is_file():
            raise RecordingError(_unfinished(path, 'it has no metadata.yaml'))
        return
    if path.suffix not in ('.bag', *ROS2_SUFFIXES):
        raise RecordingError(
            f'{path} is not a bag; give a ROS 1 .bag, a rosbag2 folder, or an .mcap file'
        )
    if path.stat().st_size == 0:
        raise RecordingError(f'{path} is empty')
    if path.suffix == '.mcap':
        _refuse_unfinished(path, path)


def _compressed(file: Path) -> bool:
    return file.suffix == '.zstd' and file.with_suffix('').suffix in ROS2_SUFFIXES


def _refuse_unfinished(file: Path, named: Path) -> None:
    if is_unfinished(file):
        raise RecordingError(_unfinished(named, f'{file.name} has no end'))


def _unfinished(path: Path, reason: str) -> str:
    remedy = _remedy(path) or f'; run: ros2 bag reindex {path}'
    return f'{path} is an unfinished recording ({reason}){remedy}'


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Whatever the readers raise on a file that is not as it should be becomes one line."""
    try:
        yield
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f'cannot read {path}: {error.strerror or error}') from None
    except Exception as error:
        reason = ' '.join(str(error).split()).rstrip('.')
        raise RecordingError(f'{path} is damaged ({reason}){_remedy(path)}') from None


def _remedy(path: Path) -> str:
    if path.suffix == '.bag':
        return f'; run: rosbag reindex {path}'
    if path.suffix == '.mcap' or any(path.glob('*.mcap')):
        return f'; run: paint recover {path}'
    return ''
