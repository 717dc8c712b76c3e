"""Forward kinematics of recorded joint states, by the URDF of the robot."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar
from xml.etree import ElementTree

import networkx as nx
import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError, did_you_mean, quoted, some
from paint_deposition.files.atomic import MOST_TEXT_MB, read_file
from paint_deposition.files.recordings.bag_files import Bag, listed_topics
from paint_deposition.files.recordings.messages import JOINT_TYPE, joint_streams
from paint_deposition.files.recordings.pose_topics import starts_again
from paint_deposition.files.tables.headings import ANGLES, LENGTHS
from paint_deposition.motion.arm import Arm
from paint_deposition.motion.stream_quality import RepeatedSamples, StreamQuality
from paint_deposition.motion.trajectory import Trajectory

DEFAULT_TIP = 'tool0'
# The n-th joint in the columns of a robot's log, without marks.
NUMBERED = re.compile(r'(?:j|joint|axis|a|rax|rj)(\d+)')
T = TypeVar('T')


@dataclass(frozen=True)
class Robot:
    """The kinematic chain from a robot's base link to its tip link.

    A recording may have ``joint_prefix`` before the names of the joints, or lack it, and have
    angles and lengths in other units than rad and m, where it does not say them itself.
    """

    path: Path
    base: str
    tip: str
    arm: Arm  # the joints that move
    joint_prefix: str = ''
    angle_unit: str | None = None
    length_unit: str | None = None

    @staticmethod
    def read(path: Path, tip: str | None = None, base: str | None = None) -> 'Robot':
        """Read a URDF.

        ``tip`` is the link of the TCP, by default tool0 or the only last link; ``base`` is the
        frame of the poses, by default the root. Raises RecordingError without such links.
        """
        from pytransform3d.urdf import parse_urdf

        try:
            text = read_file(path, RecordingError, MOST_TEXT_MB).decode('utf-8')
        except OSError as error:
            raise RecordingError(f'cannot read {path}: {error.strerror}') from None
        except UnicodeDecodeError as error:
            raise RecordingError(f'{path} is no URDF ({error})') from None
        if 'xacro:' in text:
            raise RecordingError(f'{path} is xacro; run: xacro {path} > robot.urdf')
        try:
            _, links, joints = parse_urdf(text)
            limits = {
                joint.get('name', ''): joint.find('limit')
                for joint in ElementTree.fromstring(text).iter('joint')
            }
        except Exception as error:  # whatever the XML provokes in the parser
            raise RecordingError(f'{path} is no URDF ({" ".join(str(error).split())})') from None
        parents = nx.DiGraph([(joint.child, joint.parent, {'joint': joint}) for joint in joints])
        parents.add_nodes_from(link.name for link in links)
        last = sorted(link for link in parents if not parents.in_degree(link))
        if tip is None and DEFAULT_TIP not in parents and len(last) != 1:
            raise RecordingError(f'{path} ends in {some(last, 20)}; name one as tip_link')
        tip = tip or (DEFAULT_TIP if DEFAULT_TIP in parents else last[0])
        base = base or next((link for link in parents if not parents.out_degree(link)), '')
        for name in (tip, base):
            if name not in parents:
                known = did_you_mean(name, sorted(parents))
                raise RecordingError(f"{path} has no link '{name}'; {known}")
        if tip == base or not nx.has_path(parents, tip, base):
            raise RecordingError(f"{path}: link '{tip}' does not hang on '{base}'; give base_link")
        way = nx.utils.pairwise(nx.shortest_path(parents, tip, base))
        chain = [parents.edges[pair]['joint'] for pair in way][::-1]
        if all(joint.joint_type == 'fixed' for joint in chain):
            raise RecordingError(
                f"{path}: no joint between '{base}' and '{tip}' moves; give base_link and tip_link"
            )
        return Robot(path, base, tip, _arm(path, chain, limits))

    def recorded_joints(
        self, names: Mapping[str, T], where: str, numbered: bool = False
    ) -> dict[str, T]:
        """What is recorded of each moving joint, from what is recorded by name.

        Case and marks do not count, as in joint1 for joint_1; with ``numbered``, J1 is the first
        joint that moves, if no name is known. Raises RecordingError that names the joints.
        """
        prefix = _plain(self.joint_prefix)
        plain = {_plain(name): value for name, value in names.items()}
        found: dict[str, T] = {}
        for joint in self.arm.joints:
            own = _plain(joint)
            ways = [own, prefix + own, own.removeprefix(prefix)][1 if prefix else 0 :]
            known = next((way for way in ways if way in plain), None)
            if joint in names and not prefix:
                found[joint] = names[joint]
            elif known is not None:
                found[joint] = plain[known]
        if numbered and not found:
            by_number = {int(m[1]): v for n, v in plain.items() if (m := NUMBERED.fullmatch(n))}
            joints = enumerate(self.arm.joints, start=1)
            found = {joint: by_number[k] for k, joint in joints if k in by_number}
        missing = [joint for joint in self.arm.joints if joint not in found]
        if missing or not found:
            raise RecordingError(
                f'{where} has nothing of {some(missing, 20) or "any joint"} of {self.path.name}; '
                f'its joints: {some(sorted(names), 20) or "none"}; where they have a prefix, give '
                '--joint-prefix'
            )
        return found

    def in_si(self, values: np.ndarray, where: str, units: Sequence[str] = ()) -> np.ndarray:
        """Recorded values (N, J) of the moving joints in rad and m; '' is a unit that is not said.

        Raises RecordingError for another unit, and for angles that can only be degrees.
        """
        arm, scales = self.arm, []
        furthest = np.nanmax(np.abs(values), axis=0, initial=0.0)
        for k, joint in enumerate(arm.joints):
            slides, its = arm.slides[k], units[k] if units else ''
            said = self.length_unit if slides else self.angle_unit
            known, unit = LENGTHS if slides else ANGLES, its or said
            if unit and unit not in known:
                wanted = 'm or mm' if slides else 'deg or rad'
                raise RecordingError(f'{joint} in {where} is in {unit}; give {wanted}')
            # A joint without limits that turns further is recorded in degrees.
            own = max(abs(arm.lower[k]), abs(arm.upper[k]))
            limit = max(2.0 * np.pi, own if np.isfinite(own) else 1e3)
            if not slides and not unit and furthest[k] > limit:
                raise RecordingError(
                    f'{joint} in {where} reaches {furthest[k]:.4g} and is read in rad; '
                    'give --angle-unit deg, or rad if it is'
                )
            scales.append(known[unit or ('m' if slides else 'rad')])
        return values * scales

    def trajectory(
        self, stamps_ns: np.ndarray, si: np.ndarray, recorded: Mapping[str, object], source: str
    ) -> Trajectory:
        """The motion of the tip from joints (N, J) [rad or m], with a note on where they are from.

        ``recorded`` is what is recorded of each joint.
        """
        named = ' '.join(
            joint if joint == its else f'{joint} ({its})' for joint, its in recorded.items()
        )
        note = (
            f"joints: pose of '{self.tip}' in '{self.base}' by {self.path.name}, from {named} on "
            f'{source}, {len(stamps_ns)} poses'
        )
        return Trajectory(stamps_ns, *self.poses(si), self.base, notes=(note,))

    def poses(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (N, 3) and quaternions (N, 4) of the tip, from (N, J) moving joints [rad or
        m].
        """
        positions, axes = self.arm.tips(values)
        return positions, Rotation.from_matrix(axes).as_quat()


def _arm(path: Path, chain: Sequence[Any], limits: Mapping[str, Any]) -> Arm:
    """The joints of a chain of pytransform3d that move, with the limits of the file."""
    moving, frames, fastest, frame = [], [], [], np.eye(4)
    for joint in chain:
        frame = frame @ joint.child2parent
        if joint.joint_type == 'fixed':
            continue
        name, limit = joint.joint_name, limits.get(joint.joint_name)
        if not 0.0 < np.linalg.norm(joint.joint_axis) < np.inf:
            axis = ' '.join(f'{value:g}' for value in joint.joint_axis)
            raise RecordingError(f"{path}: the axis of joint '{name}' is {axis}; give one")
        said, speed = '0' if limit is None else limit.get('velocity', '0'), np.nan
        with suppress(ValueError):
            speed = float(said)
        if not speed >= 0.0:
            raise RecordingError(
                f"{path}: the velocity of joint '{name}' is {quoted(said)}; give a number of 0 or "
                'more'
            )
        moving.append(joint)
        frames.append(frame)
        fastest.append(speed or np.inf)
        frame = np.eye(4)
    axes = np.array([joint.joint_axis for joint in moving])
    lower, upper = np.array([joint.limits for joint in moving]).T
    return Arm(
        tuple(joint.joint_name for joint in moving), np.array([*frames, frame]),
        axes / np.linalg.norm(axes, axis=1, keepdims=True),
        np.array([joint.joint_type == 'prismatic' for joint in moving]), lower, upper,
        np.array(fastest),
    )  # fmt: skip


def read_joint_poses(
    bag: Bag, robot: Robot, topic_names: str | None
) -> tuple[Trajectory, np.ndarray, str]:
    """The motion of a robot's tip from joint states, their log times (N,) [ns] and topics.

    Joints in separate messages, as those of a rail, are interpolated at the times of the most
    frequent one. Raises RecordingError without joint states of all joints at one time, with a
    joint on several topics of which none is named, or if the stream starts again.
    """
    named = (topic_names or '').split()
    topics = [bag.choose(name, (JOINT_TYPE,), 'JointState').name for name in named]
    topics = topics or [topic.name for topic in bag.topics_of(JOINT_TYPE) if topic.message_count]
    if not topics:
        listed = listed_topics([], 'JointState')
        raise RecordingError(f'{bag.path}: name a topic of joint states; {listed}')
    streams, without = joint_streams(bag.decoded(topics))
    on_all, all_joints = ' and '.join(topics), {n: n for _, names in streams for n in names}
    recorded = robot.recorded_joints(all_joints, f'{on_all} in {bag.path}')
    for joint, name in recorded.items():
        on = list(dict.fromkeys(topic for topic, names in streams if name in names))
        if len(on) > 1:
            raise RecordingError(
                f'{bag.path}: {joint} is on {" and ".join(on)}; name the topics to take, with '
                f'blanks between several, as --pose-topic {on[0]}'
            )
    columns: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    warnings: list[str] = []
    used: dict[str, tuple[str, tuple[str, ...]]] = {}
    for (topic, names), rows in streams.items():
        wanted = [column for column, name in enumerate(names) if name in recorded.values()]
        if not wanted:
            continue
        what = f'joint states on {topic}'
        bag.skipped[f'{what} without a position for each joint'] += without[topic, names]
        if not rows:
            continue
        stamps, logged = np.array([row[:2] for row in rows], np.int64).T
        values = np.array([row[2] for row in rows], dtype=float)
        if fault := starts_again(stamps, logged):
            raise RecordingError(f'{topic} in {bag.path}: {fault}')
        warnings += StreamQuality.of(stamps, values).repeats(topic)
        new = RepeatedSamples().are_new(stamps, values)
        later = np.diff(np.maximum.accumulate(stamps[new]), prepend=-1) > 0
        bag.skipped[f'{what} stamped no later than one before'] += np.count_nonzero(~later)
        new[new] = later
        stamps, logged, values = stamps[new], logged[new], values[new]
        finite = np.isfinite(values[:, wanted]).all(axis=1)
        bag.skipped[f'{what} with joints that are not finite'] += np.count_nonzero(~finite)
        for column in wanted:
            if np.count_nonzero(finite) > len(columns.get(names[column], ([],))[0]):
                columns[names[column]] = stamps[finite], logged[finite], values[finite, column]
                used[names[column]] = topic, names
    for topic, names in streams:
        if (topic, names) not in used.values() and not used.keys().isdisjoint(names):
            what = f'joint states on {topic} with another set of joints than most'
            bag.skipped[what] += len(streams[topic, names])
    bag.skipped = +bag.skipped
    short = [joint for joint, name in recorded.items() if len(columns.get(name, ([],))[0]) < 2]
    if short:
        raise RecordingError(
            f'{on_all} in {bag.path} has fewer than two positions of '
            f'{" ".join(short)} of {robot.path.name}; record them again'
        )
    clock, logged, _ = max(columns.values(), key=lambda column: len(column[0]))
    begin = max(at[0] for at, _, _ in columns.values())
    known = (clock >= begin) & (clock <= min(at[-1] for at, _, _ in columns.values()))
    if np.count_nonzero(known) < 2:
        ends = min(columns, key=lambda name: columns[name][0][-1])
        begins = max(columns, key=lambda name: columns[name][0][0])
        raise RecordingError(
            f'{bag.path}: its joints are not recorded at the same time: {ends} on '
            f'{used[ends][0]} until {1e-9 * columns[ends][0][-1]:.3f} s, {begins} on '
            f'{used[begins][0]} from {1e-9 * begin:.3f} s on; record all joints together'
        )
    each = [columns[recorded[joint]] for joint in robot.arm.joints]
    values = np.stack(
        [np.interp(clock[known] - begin, at - begin, v) for at, _, v in each], axis=1
    )
    on_used = ' and '.join(sorted({topic for topic, _ in used.values()}))
    si = robot.in_si(values, f'{on_used} in {bag.path}')
    trajectory = robot.trajectory(clock[known], si, recorded, on_used)
    return replace(trajectory, warnings=tuple(warnings)), logged[known], on_used


def _plain(name: str) -> str:
    """A name without case and marks."""
    return re.sub(r'[\W_]', '', name.casefold())
