"""Message definitions as rosbag2 stores them: text with dependencies, and type hash."""

import functools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from paint_deposition.errors import RecordingError

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


@dataclass(frozen=True)
class Definition:
    """A message type: its .msg text and, behind separators, that of each type it uses.

    ``type_hash`` is `RIHS01_...` of REP-2016, '' when unknown; ``encoding`` that of the schema.
    """

    text: str
    type_hash: str = ''
    encoding: str = 'ros2msg'


@functools.cache
def installed(message_type: str) -> Definition:
    """Definition of `pkg/msg/Type` from the ROS installation.

    Raises RecordingError if it has no such message.
    """
    texts: dict[str, str] = {}  # each type once, depth first, as rosbag2 orders them

    def collect(name: str) -> None:
        texts[name] = _share_file(name, '.msg').read_text()
        for used in sorted(_used_types(texts[name], name)):
            if used not in texts:
                collect(used)

    collect(message_type)
    parts = [texts.pop(message_type)]
    for used, text in texts.items():
        package, _, name = used.split('/')
        parts.append(f'{SEPARATOR}\nMSG: {package}/{name}\n{text}')
    description = json.loads(_share_file(message_type, '.json').read_text())
    hashes = {entry['type_name']: entry['hash_string'] for entry in description['type_hashes']}
    return Definition('\n'.join(parts), hashes.get(message_type, ''))


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
    return Definition(text, store.hash_rihs01(message_type))


def _used_types(text: str, message_type: str) -> set[str]:
    _, fields = get_types_from_msg(text, message_type)[message_type]
    used = set()
    for _, description in fields:
        node: Any = description
        while node[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            node = node[1][0]
        if node[0] == Nodetype.NAME:
            used.add(node[1])
    return used


def _share_file(message_type: str, suffix: str) -> Path:
    # ROS is imported where it is used: reading and writing bags must work without it.
    from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

    try:
        package, kind, name = message_type.split('/')
        path = Path(get_package_share_directory(package)) / kind / f'{name}{suffix}'
    except (ValueError, PackageNotFoundError):
        raise RecordingError(
            f'{message_type} is not installed; source the workspace that defines it'
        ) from None
    if not path.is_file():
        raise RecordingError(f'{message_type} is not installed: {path} is missing')
    return path
