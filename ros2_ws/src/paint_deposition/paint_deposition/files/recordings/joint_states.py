"""Forward kinematics of recorded joint states, by the URDF of the robot."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
from lxml import etree
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.recordings.bag_files import Bag, listed_topics
from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.files.recordings.message_definitions import JOINT_TYPE
from paint_deposition.motion.arm import Arm
from paint_deposition.motion.trajectory import Trajectory

DEFAULT_TIP = 'tool0'


@dataclass(frozen=True)
class Robot:
    """The kinematic chain from a robot's base link to its tip link, joints of pytransform3d."""

    path: Path
    base: str
    tip: str
    chain: list[Any]

    @staticmethod
    def read(path: Path, tip: str | None = None, base: str | None = None) -> 'Robot':
        """Read a URDF.

        ``tip`` is the link of the TCP, by default tool0 or the only last link; ``base`` is the
        frame of the poses, by default the root. Raises RecordingError without such links.
        """
        from pytransform3d.urdf import parse_urdf

        try:
            text = path.read_text(encoding='utf-8')
        except OSError as error:
            raise RecordingError(f'cannot read {path}: {error.strerror}') from None
        except UnicodeDecodeError as error:
            raise RecordingError(f'{path} is no URDF ({error})') from None
        if 'xacro:' in text:
            raise RecordingError(f'{path} is xacro; run: xacro {path} > robot.urdf')
        try:
            _, links, joints = parse_urdf(text)
        except Exception as error:  # whatever the XML provokes in the parser
            raise RecordingError(f'{path} is no URDF ({" ".join(str(error).split())})') from None
        parents = nx.DiGraph([(joint.child, joint.parent, {'joint': joint}) for joint in joints])
        parents.add_nodes_from(link.name for link in links)
        last = sorted(link for link in parents if not parents.in_degree(link))
        if tip is None and DEFAULT_TIP not in parents and len(last) != 1:
            raise RecordingError(f'{path} ends in {" ".join(last)}; name one as tip_link')
        tip = tip or (DEFAULT_TIP if DEFAULT_TIP in parents else last[0])
        base = base or next((link for link in parents if not parents.out_degree(link)), '')
        for name in (tip, base):
            if name not in parents:
                known = did_you_mean(name, sorted(parents))
                raise RecordingError(f"{path} has no link '{name}'; {known}")
        if tip == base or not nx.has_path(parents, tip, base):
            raise RecordingError(f"{path}: link '{tip}' does not hang on '{base}'; give base_link")
        way = nx.utils.pairwise(nx.shortest_path(parents, tip, base))
        return Robot(path, base, tip, [parents.edges[pair]['joint'] for pair in way][::-1])

    @property
    def moving_joints(self) -> list[str]:
        """Names of the joints that move."""
        return [joint.joint_name for joint in self.chain if joint.joint_type != 'fixed']

    @cached_property
    def arm(self) -> Arm:
        """The joints that move, with their limits."""
        moving, frames, frame = [], [], np.eye(4)
        for joint in self.chain:
            frame = frame @ joint.child2parent
            if joint.joint_type != 'fixed':
                moving.append(joint)
                frames.append(frame)
                frame = np.eye(4)
        axes = np.array([joint.joint_axis for joint in moving])
        lower, upper = np.array([joint.limits for joint in moving]).T
        return Arm(
            tuple(self.moving_joints), np.array([*frames, frame]),
            axes / np.linalg.norm(axes, axis=1, keepdims=True),
            np.array([joint.joint_type == 'prismatic' for joint in moving]), lower, upper,
            np.array([self._fastest().get(name, np.inf) for name in self.moving_joints]),
        )  # fmt: skip

    def _fastest(self) -> dict[str, float]:
        """Greatest speed of each joint that has one [rad/s or m/s]."""
        root = etree.parse(self.path).getroot()
        limits = {joint.get('name'): joint.find('limit') for joint in root.iter('joint')}
        speeds = {n: float(e.get('velocity', 0)) for n, e in limits.items() if e is not None}
        return {name: speed for name, speed in speeds.items() if speed > 0.0}

    def poses(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (N, 3) and quaternions (N, 4) of the tip, from (N, J) moving joints [rad or
        m].
        """
        positions, axes = self.arm.tips(values)
        return positions, Rotation.from_matrix(axes).as_quat()


def read_joint_poses(
    bag: Bag, robot: Robot, topic_name: str | None
) -> tuple[Trajectory, np.ndarray]:
    """The motion of a robot's tip from joint states, and their log times (N,) [ns].

    Joints in separate messages are interpolated at the times of the most frequent one. Raises
    RecordingError without joint states of all joints.
    """
    if not topic_name:
        topics = [topic for topic in bag.topics_of(JOINT_TYPE) if topic.message_count]
        if len(topics) != 1:
            listed = listed_topics(topics, 'JointState')
            raise RecordingError(f'{bag.path}: name a topic of joint states; {listed}')
        topic_name = topics[0].name
    topic = bag.choose(topic_name, (JOINT_TYPE,), 'JointState')
    rows: dict[str, list[tuple[int, int, float]]] = {name: [] for name in robot.moving_joints}
    seen: set[str] = set()
    for _, log_time_ns, message in bag.decoded([topic.name]):
        stamp = stamp_ns(message.header)
        seen.update(message.name)
        for name, value in zip(message.name, message.position, strict=False):
            if name in rows and (not rows[name] or stamp > rows[name][-1][0]):
                rows[name].append((stamp, log_time_ns, float(value)))
    missing = [name for name in rows if len(rows[name]) < 2]
    if missing or not rows:
        raise RecordingError(
            f'{topic.name} in {bag.path} has nothing of {" ".join(missing) or "any joint"} of '
            f'{robot.path.name}; its joints: {" ".join(sorted(seen)) or "none"}'
        )
    columns = {
        name: tuple(map(np.array, zip(*found, strict=True))) for name, found in rows.items()
    }
    clock = max(columns, key=lambda name: len(columns[name][0]))
    stamps, log_times, _ = columns[clock]
    begin = max(at[0] for at, _, _ in columns.values())
    end = min(at[-1] for at, _, _ in columns.values())
    known = (stamps >= begin) & (stamps <= end)
    stamps = stamps[known]
    values = [np.interp(stamps - begin, at - begin, v) for at, _, v in columns.values()]
    positions, quaternions = robot.poses(np.stack(values, axis=1))
    note = (
        f"joints: pose of '{robot.tip}' in '{robot.base}' by {robot.path.name}, from "
        f'{" ".join(robot.moving_joints)} on {topic.name}, {len(stamps)} poses'
    )
    trajectory = Trajectory(stamps, positions, quaternions, robot.base, notes=(note,))
    return trajectory, log_times[known]
