"""Small recordings for tests, built by name."""

from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from paint_deposition.motion.trajectory import Trajectory

# A stamp that a float could only hold to 256 ns.
START_NS = 1_760_000_000_123_456_789
POSE = 'geometry_msgs/msg/PoseStamped'
BOOL = 'std_msgs/msg/Bool'
TF = 'tf2_msgs/msg/TFMessage'
STATE_TYPES = {
    'paint_msgs/msg/AtomizerState': (
        'std_msgs/Header header\nbool spraying\nfloat64 flow\nfloat64 shaping_air_l_per_min\n'
        'float64 bell_speed_rpm\nfloat64 voltage_kv\n'
    )
}


def straight_pass(count: int = 50, triggers: bool = True, frame_id: str = 'door') -> Trajectory:
    """A metre along x in `count` poses at uneven intervals around 4 ms; gun on in the middle."""
    rng = np.random.default_rng(5)
    steps_ns = rng.integers(1_300_000, 24_000_000, count - 1)
    stamps_ns = START_NS + np.concatenate([[0], np.cumsum(steps_ns)])
    positions_m = np.zeros((count, 3))
    positions_m[:, 0] = np.linspace(0.0, 1.0, count)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    if not triggers:
        return Trajectory(stamps_ns, positions_m, quaternions, frame_id)
    switched_ns, flow = stamps_ns[[count // 4, 3 * count // 4]], np.array([1.0, 0.0])
    return Trajectory(stamps_ns, positions_m, quaternions, frame_id, switched_ns, flow)


class Messages:
    """Messages of rosbags' types for one ROS version, ready to be written."""

    def __init__(self, ros1: bool = False, state_types: dict[str, str] | None = None) -> None:
        self.ros1 = ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        if ros1:  # not among the standard ones of rosbags
            text = 'geometry_msgs/TransformStamped[] transforms'
            self.store.register(get_types_from_msg(text, TF))
        else:
            for name, text in (state_types or STATE_TYPES).items():
                self.store.register(get_types_from_msg(text, name))

    def header(self, stamp_ns: int, frame_id: str = 'door'):
        types = self.store.types
        time = types['builtin_interfaces/msg/Time'](*divmod(int(stamp_ns), 10**9))
        header = types['std_msgs/msg/Header']
        return header(0, time, frame_id) if self.ros1 else header(time, frame_id)

    def pose(self, stamp_ns: int, position_m, quaternion_xyzw, frame_id: str = 'door'):
        types = self.store.types
        at = types['geometry_msgs/msg/Point'](*map(float, position_m))
        turn = types['geometry_msgs/msg/Quaternion'](*map(float, quaternion_xyzw))
        pose = types['geometry_msgs/msg/Pose'](at, turn)
        return types[POSE](self.header(stamp_ns, frame_id), pose)

    def trigger(self, value: bool):
        return self.store.types[BOOL](value)

    def state(self, stamp_ns: int, spraying: bool, flow: float, voltage_kv: float = 0.0):
        state = self.store.types['paint_msgs/msg/AtomizerState']
        return state(self.header(stamp_ns), spraying, flow, 0.0, 0.0, voltage_kv)

    def joints(self, stamp_ns: int, names, positions):
        """A JointState."""
        none = np.empty(0)
        state = self.store.types['sensor_msgs/msg/JointState']
        values = np.array(positions, dtype=float)
        return state(self.header(stamp_ns, ''), list(names), values, none, none)

    def transforms(self, *rows: tuple[int, str, str, object]):
        """A TFMessage of (stamp, parent, child, x y z qx qy qz qw) each."""
        types, made = self.store.types, []
        for stamp, parent, child, values in rows:
            shift = types['geometry_msgs/msg/Vector3'](*map(float, values[:3]))
            turn = types['geometry_msgs/msg/Quaternion'](*map(float, values[3:]))
            transform = types['geometry_msgs/msg/Transform'](shift, turn)
            stamped = types['geometry_msgs/msg/TransformStamped']
            made.append(stamped(self.header(stamp, parent), child, transform))
        return types[TF](made)

    def serialised(self, message) -> bytes:
        kind = message.__msgtype__
        if self.ros1:
            return self.store.serialize_ros1(message, kind)
        return self.store.serialize_cdr(message, kind)


def write_bag(
    path: Path, entries: list[tuple], storage: str = 'mcap', messages: Messages | None = None
) -> Path:
    """Write (topic, log time, message) as 'ros1', 'sqlite3' or 'mcap'."""
    messages = messages or Messages(ros1=storage == 'ros1')
    plugin = StoragePlugin.SQLITE3 if storage == 'sqlite3' else StoragePlugin.MCAP
    ros1 = storage == 'ros1'
    made = Ros1Writer(path) if ros1 else Ros2Writer(path, version=9, storage_plugin=plugin)
    with made as writer:
        connections = {}
        for topic, log_time_ns, message in entries:
            if topic not in connections:
                told = topic, message.__msgtype__
                connections[topic] = writer.add_connection(*told, typestore=messages.store)
            writer.write(connections[topic], int(log_time_ns), messages.serialised(message))
    return path


def pose_entries(
    trajectory: Trajectory, topic: str = '/atomizer/pose', ros1: bool = False, delay_ns: int = 0
) -> list[tuple[str, int, object]]:
    """A trajectory's poses, logged `delay_ns` after their stamps."""
    messages, frame_id = Messages(ros1), trajectory.frame_id
    poses = zip(trajectory.positions_m, trajectory.quaternions_xyzw, strict=True)
    return [
        (topic, stamp + delay_ns, messages.pose(stamp, *pose, frame_id))
        for stamp, pose in zip(trajectory.stamps_ns.tolist(), poses, strict=True)
    ]
