"""Messages as data: their definitions, as rosbag2 stores them, and the numbers in them."""

import functools
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from paint_deposition.errors import RecordingError
from paint_deposition.motion.pose_stream import FARTHEST_M, TriggerChange
from paint_deposition.motion.trajectory import ONLY_BRUSH, relative_flow
from paint_deposition.request import is_pose

SEPARATOR = '=' * 80
# Definitions of the messages that are serialised without a ROS installation.
STANDARD_STORE = Stores.ROS2_KILTED
# Other messages with motion than PoseStamped.
JOINT_TYPE = 'sensor_msgs/msg/JointState'
TF_TYPES = ('tf2_msgs/msg/TFMessage', 'tf/msg/tfMessage')
# The state of the atomizer, as `paint_msgs` defines it.
STATE_TYPE = 'paint_msgs/msg/AtomizerState'
STATE_TEXT = """\
std_msgs/Header header
bool spraying
float64 flow
float64 shaping_air_l_per_min
float64 bell_speed_rpm
float64 voltage_kv
int32 brush
float64 flow_cm3_per_min
float64 programmed_speed_m_per_s
"""


# Of a message type: its .msg text and, behind separators, that of each type it uses; its hash,
# `RIHS01_...` of REP-2016, '' when unknown.
Definition = tuple[str, str]


@functools.cache
def installed(message_type: str) -> Definition:
    """Definition of `pkg/msg/Type` from the ROS installation.

    Raises RecordingError if it has no such message.
    """
    texts: dict[str, str] = {}  # each type once, depth first, as rosbag2 orders them

    def collect(name: str) -> None:
        texts[name] = _share_file(name, '.msg').read_text()
        _, fields = get_types_from_msg(texts[name], name)[name]
        used = set()
        for _, node in fields:
            while node[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE):
                node = node[1][0]
            used |= {node[1]} if node[0] == Nodetype.NAME else set()
        for other in sorted(used):
            if other not in texts:
                collect(other)

    collect(message_type)
    parts = [texts.pop(message_type)]
    for used, text in texts.items():
        package, _, name = used.split('/')
        parts.append(f'{SEPARATOR}\nMSG: {package}/{name}\n{text}')
    description = json.loads(_share_file(message_type, '.json').read_text())
    hashes = {entry['type_name']: entry['hash_string'] for entry in description['type_hashes']}
    return '\n'.join(parts), hashes.get(message_type, '')


@functools.cache
def own_types() -> Typestore:
    """Types of messages that can be written without ROS: the common ones and AtomizerState."""
    store = get_typestore(STANDARD_STORE)
    store.register(get_types_from_msg(STATE_TEXT, STATE_TYPE))
    return store


@functools.cache
def standard(message_type: str) -> Definition:
    """Definition of a message that can be written without ROS."""
    store = own_types()
    text, _ = store.generate_msgdef(message_type, ros_version=2)
    return text, store.hash_rihs01(message_type)


def _share_file(message_type: str, suffix: str) -> Path:
    # ROS is imported where it is used: reading and writing bags must work without it.
    try:
        from ament_index_python.packages import get_package_share_directory

        package, kind, name = message_type.split('/')
        path = Path(get_package_share_directory(package)) / kind / f'{name}{suffix}'
    except (ValueError, ModuleNotFoundError, LookupError):  # without ROS, or without the package
        raise RecordingError(
            f'{message_type} is not installed; source the workspace that defines it'
        ) from None
    if not path.is_file():
        raise RecordingError(f'{message_type} is not installed: {path} is missing')
    return path


# Of each topic and set of joints: stamps, log times [ns] and values, in the order of the names.
JointStreams = dict[tuple[str, tuple[str, ...]], list[tuple[int, int, list[float]]]]


def joint_streams(decoded: Iterable[tuple[str, int, Any]]) -> tuple[JointStreams, Counter]:
    """The streams in messages of JointState, given as topic, log time and message.

    A set of joints is one in whatever order the messages name them. Messages without a position
    for each joint are counted by topic and set.
    """
    streams: JointStreams = {}
    without: Counter[tuple[str, tuple[str, ...]]] = Counter()
    for topic, log_time_ns, message in decoded:
        order = sorted(range(len(message.name)), key=message.name.__getitem__)
        key = topic, tuple(message.name[k] for k in order)
        rows = streams.setdefault(key, [])
        if len(message.position) == len(order):
            values = [float(message.position[k]) for k in order]
            rows.append((stamp_ns(message.header), log_time_ns, values))
        else:
            without[key] += 1
    return streams, without


def stamp_ns(header: Any) -> int:
    """A header's stamp in integer nanoseconds; 0 is none, or one that is no time of ROS."""
    return nanoseconds(header.stamp.sec, header.stamp.nanosec)


def nanoseconds(sec: int, nanosec: int) -> int:
    """A time; 0 before 1970, and for a second or more of nanoseconds."""
    valid = sec >= 0 and nanosec < 1_000_000_000
    return sec * 1_000_000_000 + nanosec if valid else 0


def pose_of(message: Any) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) [m] and quaternion (4,) of a Pose or Transform.

    They are NaN where one is infinite or further off than any part.
    """
    is_pose_message = hasattr(message, 'position')
    p = message.position if is_pose_message else message.translation
    q = message.orientation if is_pose_message else message.rotation
    values = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    if not (np.abs(values) <= FARTHEST_M).all():
        values[:] = np.nan
    return values[:3], values[3:]


def transforms_of(
    transforms: Iterable[Any],
) -> Iterator[tuple[str, str, int, tuple[float, ...]]]:
    """Child, parent, stamp [ns] and pose x y z qx qy qz qw of each TransformStamped.

    One that is not finite, or whose quaternion is none, is passed over, as by tf2.
    """
    for placed in transforms:
        t, q = placed.transform.translation, placed.transform.rotation
        pose = t.x, t.y, t.z, q.x, q.y, q.z, q.w
        parent, child = placed.header.frame_id.lstrip('/'), placed.child_frame_id.lstrip('/')
        if is_pose(pose):
            yield child, parent, stamp_ns(placed.header), pose


def trigger_change(state: Any) -> TriggerChange:
    """What an AtomizerState says of the gun.

    Raises:
        RecordingError: it has no stamp, no possible flow or no possible number of a brush.
    """
    stamp, brush = stamp_ns(state.header), int(getattr(state, 'brush', ONLY_BRUSH))
    if stamp == 0:
        raise RecordingError('atomizer state without a stamp: stamp each state')
    flow = relative_flow(bool(state.spraying), state.flow)
    if flow > 0.0 and brush < ONLY_BRUSH:
        raise RecordingError(f'atomizer state with brush {brush}: give 0 or more')
    return TriggerChange(stamp, flow, brush)


MOST_FIELDS = 12
SYNTAX = re.compile(
    r'(?P<topic>[\w/~]+)(?P<path>(\.\w+|\[\d+\])*)\s*((?P<side>[<>])\s*(?P<level>[-+.\deE]+))?'
)
STEP = re.compile(r'\.(\w+)|\[(\d+)\]')


@dataclass(frozen=True)
class Signal:
    """A signal such as ``/io.states[3]``, ``/io.level > 12`` or ``/io.closed < 1``.

    ``path`` of the field is '' for the field ``data`` of std_msgs. The signal is on above
    ``level``, or under it if ``below`` is set.
    """

    topic: str
    path: str
    below: bool = False
    level: float = 0.0

    @staticmethod
    def parse(text: str) -> 'Signal | None':
        """Parse a signal, None for other text; raises RecordingError for an invalid level."""
        match = SYNTAX.fullmatch(text.strip())
        if match is None:
            return None
        try:
            level = float(match['level'] or 0.0)
        except ValueError:
            raise RecordingError(
                f"{text}: '{match['level']}' is no number; give a level such as 12"
            ) from None
        return Signal(match['topic'], match['path'], match['side'] == '<', level)

    def value(self, message: Any) -> float | None:
        """The number in a message, None where there is none."""
        value = message
        # The messages of std_msgs have one field.
        try:
            for name, index in STEP.findall(self.path) or [('data', '')]:
                value = getattr(value, name) if name else value[int(index)]
        except (AttributeError, IndexError, TypeError):
            return None
        known = isinstance(value, bool | int | float | np.bool_ | np.number)
        return float(value) if known else None

    def is_on(self, values: Any) -> Any:
        """Whether the signal is on at a value, or at each of an array."""
        return values < self.level if self.below else values > self.level


def numeric_fields(value: Any, path: str = '') -> Iterator[str]:
    """Paths to the numbers and Bools in a message."""
    if isinstance(value, bool | int | float | np.bool_ | np.number):
        yield path
    elif is_dataclass(value):
        for item in fields(value):
            if item.name not in ('header', '__msgtype__'):
                yield from numeric_fields(getattr(value, item.name), f'{path}.{item.name}')
    elif isinstance(value, list | np.ndarray):
        for index, inner in enumerate(value[: MOST_FIELDS + 1]):
            yield from numeric_fields(inner, f'{path}[{index}]')
