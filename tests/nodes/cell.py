"""A small paint cell for tests: a panel, a motion over it, the robot and those who look on."""

import socket
import time
from pathlib import Path

import numpy as np
import trimesh
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, TransformStamped
from lifecycle_msgs.msg import TransitionEvent
from nav_msgs.msg import Path as Passes
from paint_msgs import msg as paint
from paint_msgs.msg import AtomizerState
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState, PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.motion.transforms import Rigid, moved
from paint_deposition.nodes.topics import (
    CLOCK,
    LATCHED,
    PROGRESS,
    RESULTS,
    TRUST_TOPIC,
    header,
    pose_message,
)
from scenes import START_NS, painted

# The tool's z axis along +y, toward a panel that looks to -y.
FACING_PANEL = np.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
PANEL_M = 0.8
TWO_PASSES_POSES = 600
ALL = QoSProfile(depth=500)
ALL_LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# What nodes publish, by the last two words of the topic, and how it is heard.
HEARD = {
    'atomizer/pose': (PoseStamped, ALL), 'joint_states': (JointState, ALL),
    'atomizer/state': (AtomizerState, ALL_LATCHED), 'part': (paint.Part, LATCHED),
    'part_pose': (TransformStamped, LATCHED), 'planned_path': (Passes, LATCHED),
    'atomizer/progress': (paint.PoseProgress, PROGRESS),
    'thickness/field': (paint.ThicknessField, RESULTS),
    'thickness/stats': (paint.ThicknessStats, LATCHED),
    'thickness/mesh': (Marker, LATCHED), 'thickness/legend': (MarkerArray, LATCHED),
    'thickness/cloud': (PointCloud2, RESULTS), TRUST_TOPIC: (DiagnosticStatus, LATCHED),
    'comparison/stats': (paint.ComparisonStats, LATCHED),
    'comparison/mesh': (Marker, LATCHED), 'comparison/legend': (MarkerArray, LATCHED),
    'deposition_simulator/transition_event': (TransitionEvent, ALL),
    'diagnostics': (DiagnosticArray, QoSProfile(depth=100)), 'clock': (Clock, CLOCK),
}  # fmt: skip
# A user's effect whose code is new for every number, so that no cache has it compiled. Before it
# is used it waits for a file `gate`; in a main thread, which poses may be waiting for, it fails.
OWN_EFFECT = """
import threading
import time
from pathlib import Path
from paint_deposition.effects.base import Effect, parameter

class Own(Effect):
    id = 'own'
    family = 'incidence'
    gain: float = parameter(0.0, low=-1.0, high=1.0, typical=0.1, unit='1', description='g')

    @staticmethod
    def flux_factor(ray, gain):
        return 1.0 + gain * ray.cos_incidence + {unique!r} * (1.0 - ray.cos_incidence)

    def on_film(self, film_um, points):
        gate = Path(__file__).with_name('gate')
        if threading.current_thread() is threading.main_thread() and not gate.exists():
            raise RuntimeError('tried out while poses wait')
        while not gate.exists():
            time.sleep(0.01)
        return film_um
"""


def write_own_model(folder: Path) -> Path:
    """A model file with an effect of the user's own that nobody has compiled yet."""
    (folder / 'own.py').write_text(OWN_EFFECT.format(unique=time.time() * 1e-20))
    path = folder / 'own.yaml'
    path.write_text('effects:\n  - {file: own.py, gain: 0.5}\n')
    return path


def write_panel(path: Path, reverse: bool = False, scale: float = 1.0) -> Path:
    """A square that stands in x-z and looks to -y, as STL."""
    half = scale * PANEL_M / 2
    corners = [[-half, 0, -half], [half, 0, -half], [half, 0, half], [-half, 0, half]]
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    trimesh.Trimesh(corners, faces[:, ::-1] if reverse else faces, process=False).export(path)
    return path


def two_passes(poses: int = TWO_PASSES_POSES, trigger: bool = True) -> Trajectory:
    """There at the height of 0.1 m and back at -0.1 m, 250 Hz; the gun is off at the turn."""
    share = np.linspace(0.0, 1.0, poses)
    across = np.interp(share, [0.0, 0.45, 0.55, 1.0], [-0.5, 0.5, 0.5, -0.5])
    height = np.interp(share, [0.45, 0.55], [0.1, -0.1])
    stamps = START_NS + 4_000_000 * np.arange(poses)
    switched_s = 0.004 * poses * np.array([0.02, 0.441, 0.561])
    return Trajectory(
        stamps_ns=stamps,
        positions_m=np.stack([across, np.full(poses, -0.25), height], axis=1),
        quaternions_xyzw=np.tile(FACING_PANEL, (poses, 1)),
        frame_id='part',
        trigger_stamps_ns=START_NS + np.round(switched_s * 1e9).astype(np.int64)
        if trigger
        else np.empty(0, dtype=np.int64),
        trigger_flow=np.array([1.0, 0.0, 1.0]) if trigger else np.empty(0),
    )


def turned(motion: Trajectory, degrees: float) -> Trajectory:
    """The motion turned about the vertical z."""
    turn = Rotation.from_euler('z', degrees, degrees=True).as_quat()
    return moved(motion, Rigid.of([0.0, 0.0, 0.0, *turn]), motion.frame_id)


def offline_um(
    node, trajectory: Trajectory, model: DepositionModel | None = None, precision: str = 'single'
) -> np.ndarray:
    """The film that an offline run has at the node's points."""
    return painted(node.points, trajectory, model, precision, node.surface).film_um


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    """A port of this machine that nobody listens on."""
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(('127.0.0.1', 0))
        return free.getsockname()[1]


def saved_um(table: Path | str) -> np.ndarray:
    """The film in a table that the simulator wrote."""
    return np.loadtxt(table, delimiter=',', skiprows=1)[:, 3]


def parameters(**values: object) -> list[Parameter]:
    """Parameter overrides by name."""
    return [Parameter(name, value=value) for name, value in values.items()]


class Robot(Node):
    """Publishes poses and states as a cell would."""

    def __init__(self, context, reliable: bool = True, latched: bool = False, **options) -> None:
        super().__init__('robot', context=context, **options)
        profile = QoSProfile(depth=2000)
        if not reliable:
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
        self.pose_publisher = self.create_publisher(PoseStamped, 'atomizer/pose', profile)
        kept = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        states = kept if latched else profile
        self.state_publisher = self.create_publisher(AtomizerState, 'atomizer/state', states)

    def is_subscribed_by(self, *nodes: Node) -> bool:
        """Both sides know of each other: what is sent from now on arrives."""
        topics = [
            publisher.topic_name for publisher in (self.pose_publisher, self.state_publisher)
        ]
        inputs = [s for node in nodes for s in node.subscriptions if s.topic_name in topics]
        return all(s.get_publisher_count() for s in inputs) and self.has_subscribers(len(nodes))

    def has_subscribers(self, count: int) -> bool:
        """Whether so many listen to the poses and to the states."""
        return all(
            publisher.get_subscription_count() >= count
            for publisher in (self.pose_publisher, self.state_publisher)
        )

    def hearers(self) -> tuple[int, int]:
        """How many listen as reliably as it sends, in this process and in others."""
        counts = []
        for publisher in (self.pose_publisher, self.state_publisher):
            topic = publisher.topic_name
            processes = [
                bytes(info.endpoint_gid[:12])
                for info in self.get_subscriptions_info_by_topic(topic)
                if info.qos_profile.reliability == publisher.qos_profile.reliability
            ]
            own = {bytes(i.endpoint_gid[:12]) for i in self.get_publishers_info_by_topic(topic)}
            here = sum(process in own for process in processes)
            counts.append((here, len(processes) - here))
        (poses_here, poses), (states_here, states) = counts
        return min(poses_here, states_here), min(poses, states)

    def send_pose(self, stamp_ns, position, quaternion, frame_id: str = 'part') -> None:
        message = pose_message(frame_id, int(stamp_ns), [*position, *quaternion])
        self.pose_publisher.publish(message)

    def send_state(self, stamp_ns, flow: float, brush: int = 0) -> None:
        self.send_fields(stamp_ns, spraying=bool(flow > 0.0), flow=float(flow), brush=brush)

    def send_fields(self, stamp_ns, **fields: object) -> None:
        """A state of which only these fields are filled."""
        message = AtomizerState(header=header('', int(stamp_ns)), **fields)
        self.state_publisher.publish(message)

    def send(self, trajectory: Trajectory, rows: slice = slice(None), frame_id='part') -> None:
        """Poses, and each state before the first pose that is newer."""
        for row in np.arange(len(trajectory))[rows]:
            stamp = trajectory.stamps_ns[row]
            before = trajectory.stamps_ns[row - 1] if row else 0
            for changed_ns, *gun in trajectory.triggers:
                if before < changed_ns <= stamp:
                    self.send_state(changed_ns, *gun)
            self.send_pose(
                stamp, trajectory.positions_m[row], trajectory.quaternions_xyzw[row], frame_id
            )


class Broadcaster(Node):
    """Sends transforms as tf2's broadcasters do."""

    def __init__(self, context) -> None:
        from tf2_msgs.msg import TFMessage

        super().__init__('broadcaster', context=context)
        self._kind = TFMessage
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._publishers_of = {
            True: self.create_publisher(TFMessage, '/tf_static', latched),
            False: self.create_publisher(TFMessage, '/tf', QoSProfile(depth=100)),
        }

    def send(self, stamp: int, static: bool = False, **poses: Rigid) -> None:
        """Poses by `parent_to_child`, in one message."""
        transforms = []
        for name, pose in poses.items():
            parent, child = name.split('_to_')
            transform = TransformStamped(header=header(parent, int(stamp)), child_frame_id=child)
            t, q = transform.transform.translation, transform.transform.rotation
            t.x, t.y, t.z, q.x, q.y, q.z, q.w = map(float, pose.values)
            transforms.append(transform)
        self._publishers_of[static].publish(self._kind(transforms=transforms))

    def has_subscribers(self, count: int = 1) -> bool:
        each = self._publishers_of.values()
        return all(publisher.get_subscription_count() >= count for publisher in each)


class Onlooker(Node):
    """Subscribes to topics and diagnostics and keeps the bytes of all that it hears."""

    def __init__(self, context, *topics: str, **options) -> None:
        super().__init__('onlooker', context=context, **options)
        self.types: dict[str, type] = {}
        self.heard: dict[str, list[bytes]] = {}
        for topic in (*topics, '/diagnostics'):
            self.heard[topic] = []
            words = topic.strip('/').split('/')
            self.types[topic], profile = HEARD['/'.join(words[-2:])]
            heard = self.heard[topic].append
            self.create_subscription(self.types[topic], topic, heard, profile, raw=True)

    def newest(self, topic: str):
        """The last message of a topic, None if there was none."""
        return self.decoded(topic, -1) if self.heard[topic] else None

    def shows(self, topic: str, condition) -> bool:
        """Whether the last message of a topic is there and meets a condition."""
        newest = self.newest(topic)
        return newest is not None and condition(newest)

    def all(self, topic: str) -> list:
        """The messages of a topic so far."""
        return [self.decoded(topic, row) for row in range(len(self.heard[topic]))]

    def decoded(self, topic: str, row: int):
        """A message of a topic, by its number."""
        return deserialize_message(self.heard[topic][row], self.types[topic])

    def status(self, name: str):
        """The last DiagnosticStatus of a task, None if there was none."""
        for data in reversed(self.heard['/diagnostics']):
            for status in deserialize_message(data, DiagnosticArray).status:
                if status.name == name:
                    return status
        return None

    def reports(self, name: str, text: str, level: bytes | None = None) -> bool:
        """Whether the last status of a task says that, at this level if one is given."""
        status = self.status(name)
        return status is not None and text in status.message and level in (None, status.level)

    def value(self, name: str, key: str) -> str | None:
        """A value of the last status of a task, None if there is none."""
        status = self.status(name)
        return {v.key: v.value for v in status.values}.get(key) if status else None
