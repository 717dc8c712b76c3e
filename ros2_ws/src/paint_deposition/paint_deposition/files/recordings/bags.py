"""The motion in a bag, poses and trigger, read and written.

A trigger is AtomizerState, Bool, or a number in a field of any message.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.typesys.store import Typestore

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.recordings import messages as definitions
from paint_deposition.files.recordings.bag_files import Bag, BagTopic
from paint_deposition.files.recordings.mcap_run import RunWriter, offered_qos
from paint_deposition.files.recordings.messages import STATE_TYPE, TF_TYPES, Signal, stamp_ns
from paint_deposition.files.recordings.pose_topics import (
    POSE_TYPE,
    POSES,
    read_poses,
    read_tf_poses,
)
from paint_deposition.files.tables.headings import LENGTHS
from paint_deposition.motion.pose_stream import TriggerChange
from paint_deposition.motion.stream_quality import StreamQuality, looks_like_mm
from paint_deposition.motion.trajectory import (
    ONLY_BRUSH,
    SPRAYS_NOTHING,
    Trajectory,
    relative_flow,
)
from paint_deposition.motion.transforms import Rigid

if TYPE_CHECKING:
    from paint_deposition.files.recordings.joint_states import Robot
    from paint_deposition.planning.driving import Drive

POSE_TOPIC = '/atomizer/pose'
STATE_TOPIC = '/atomizer/state'
JOINT_TRAJECTORY_TYPE = 'trajectory_msgs/msg/JointTrajectory'
JOINT_TOPIC = '/joint_trajectory'
BOOL_TYPE = 'std_msgs/msg/Bool'
# Of triggers; the first says more.
STATE_TYPES = STATE_TYPE, BOOL_TYPE
# Fields of AtomizerState that are summarised while the gun sprays.
SETTINGS = ('flow', 'shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv')
# A change of the trigger: its time, flow and brush from then on, and when it was logged [ns].
Change = tuple[int, float, int, int]
# For a trigger without stamps the log times are used, if those of the poses show that recorder and
# robot have the same clock.
MAX_CLOCK_OFFSET_S = 1.0


def trajectory_of(
    bag: Bag,
    pose_topic: str | None = None,
    state_topic: str | None = None,
    tf: Sequence[str] | None = None,
    robot: Robot | None = None,
    pose_unit: str | None = None,
) -> Trajectory:
    """The atomizer's motion from a bag: poses as recorded, unscreened, stamps in nanoseconds.

    Args:
        pose_topic: of poses, or the robot's joint states, several with blanks between them; None:
            the only one, or the joint states that have the robot's joints.
        state_topic: see ``with_trigger``; None: the gun always sprays, and a note lists the
            topics that could be its trigger.
        tf: [target, source] frames of the transforms to read instead of poses; source is the TCP.
        robot: the robot whose joint states to read instead of poses.
        pose_unit: of poses and transforms that are not in m.

    Raises:
        RecordingError: one line that names the bag, what is wrong and what to do.
    """
    trajectory, log_times_ns = motion_of(bag, pose_topic, tf, robot, pose_unit)
    if not state_topic:
        # AtomizerState is listed first, since a Bool may be anything.
        unused = [t for t in bag.topics_of(*STATE_TYPES) if t.message_count]
        if not unused:
            return trajectory
        named = ' and '.join(f'{topic.name} ({topic.type})' for topic in unused)
        note = (
            f'recording {bag.path}: {named} {"is" if len(unused) == 1 else "are"} not used, the '
            f'gun sprays whenever poses flow; add `state_topic: {unused[0].name}` (--state-topic) '
            'if that is the trigger'
        )
        return replace(trajectory, notes=(*trajectory.notes, note))
    return with_trigger(bag, state_topic, trajectory, log_times_ns)


def motion_of(
    bag: Bag,
    pose_topic: str | None = None,
    tf: Sequence[str] | None = None,
    robot: Robot | None = None,
    pose_unit: str | None = None,
) -> tuple[Trajectory, np.ndarray]:
    """The poses alone, as for ``trajectory_of``, and their log times (N,) int64 [ns]."""
    if robot:
        from paint_deposition.files.recordings.joint_states import read_joint_poses

        read, log_times_ns, name = read_joint_poses(bag, robot, pose_topic)
    else:
        if tf:
            read, log_times_ns = read_tf_poses(bag, *tf)
            name = f'transforms to {tf[1]}'
        else:
            read, log_times_ns, name = read_poses(bag, pose_topic)
        if not pose_unit and looks_like_mm(read.positions_m):
            far = (
                f'{name}: its positions reach {np.nanmax(np.abs(read.positions_m)):.4g} and are '
                'read in m, as ROS has them: no part is so far away; give --pose-unit mm, or m '
                'if it is'
            )
            read = replace(read, warnings=(*read.warnings, far))
        read = replace(read, positions_m=read.positions_m * LENGTHS[pose_unit or 'm'])
    poses = np.hstack([read.positions_m, read.quaternions_xyzw])
    faults = StreamQuality.of(read.stamps_ns, poses).faults(name)
    return replace(read, warnings=(*read.warnings, *faults)), log_times_ns


def with_trigger(bag: Bag, name: str, motion: Trajectory, log_times_ns: np.ndarray) -> Trajectory:
    """The motion, logged at (N,) int64, with the trigger of a topic.

    That is AtomizerState (header stamps) or Bool (log times), or a field of other messages, with
    the level beyond which the gun is on unless it is 0: ``/io.states[3]``, ``/io.level > 12``,
    ``/io.closed < 1``. Raises RecordingError if there is no such topic or field, if it is no
    number, or if it has no stamps and the clock of the robot is another than the recorder's.
    """
    signal, settings = Signal.parse(name), dict[str, float]()
    topic = bag.find(signal.topic) if signal else None
    is_state = topic is not None and topic.type in STATE_TYPES
    if signal is None or topic is None or (is_state and signal == Signal(signal.topic, '')):
        topic = bag.choose(name, STATE_TYPES, 'state')
        by_log_time = topic.type == BOOL_TYPE
        changes, settings, notes = _changes_of_states(bag, topic)
    else:
        changes, by_log_time, notes = _changes_of_signal(bag, topic, signal)
    offset_s = float(np.median(log_times_ns - motion.stamps_ns)) * 1e-9
    if by_log_time and abs(offset_s) > MAX_CLOCK_OFFSET_S:
        raise RecordingError(
            f'{name} in {bag.path} has no stamps, and the stream of poses was logged '
            f'{offset_s:.3g} s off its own stamps; record {STATE_TYPE} instead'
        )
    rows: np.ndarray = np.empty(0, np.int64)
    # Where the clock was set back, the order in which they came says of which stream they are; in
    # the run of a part it says so as it did to the simulator, which takes them as they were sent.
    if 'serial' in bag.custom_data or np.any(np.diff(motion.stamps_ns) < 0):
        sent = bag.sent_ns([each.name for each in (*bag.topics_of(*POSES), topic)])
        changes.sort(key=lambda change: sent.get(change[3], change[3]))
        came, told = (
            np.array([sent.get(logged, logged) for logged in times], np.int64)
            for times in (log_times_ns.tolist(), [change[3] for change in changes])
        )
        rows = np.searchsorted(np.maximum.accumulate(came), told)
    else:
        changes.sort(key=lambda change: change[0])
    return replace(
        motion, trigger_stamps_ns=np.array([change[0] for change in changes], np.int64),
        trigger_flow=np.array([change[1] for change in changes], float),
        trigger_brush=np.array([change[2] for change in changes], np.int64), trigger_rows=rows,
        settings=settings, notes=(*motion.notes, *notes),
    )  # fmt: skip


def _changes_of_signal(
    bag: Bag, topic: BagTopic, signal: Signal
) -> tuple[list[Change], bool, list[str]]:
    """The changes of a signal, whether they are by log time, and how it was interpreted."""
    rows: list[tuple[int, float, int, bool]] = []
    for _, log_time_ns, message in bag.decoded([topic.name]):
        stamp = stamp_ns(message.header) if hasattr(message, 'header') else 0
        value = signal.value(message)
        if value is None:
            found = [f'{topic.name}{path}' for path in definitions.numeric_fields(message)]
            listed = ' '.join(found[: definitions.MOST_FIELDS]) + (
                ' ...' if len(found) > definitions.MOST_FIELDS else ''
            )
            if not signal.path:
                raise RecordingError(
                    f'{topic.name} in {bag.path} is {topic.type}; name one of its fields: {listed}'
                )
            raise RecordingError(
                f'{topic.name} in {bag.path} has no number or Bool at {signal.path}; '
                + did_you_mean(topic.name + signal.path, found, f'there are: {listed or "none"}')
            )
        rows.append((stamp or log_time_ns, value, log_time_ns, bool(stamp)))
    known = [row for row in rows if math.isfinite(row[1])]
    if not known:
        raise RecordingError(f'{topic.name} in {bag.path} has no numbers; record it again')
    values = [value for _, value, *_ in known]
    note = (
        f'trigger {topic.name}{signal.path} is {min(values):.4g} to {max(values):.4g}: the gun '
        f'is on where it is {"below" if signal.below else "above"} {signal.level:g}'
    )
    if left_out := len(rows) - len(known):
        note += f'; {left_out} values that are no number are left out'
    changes = [(at, float(signal.is_on(v)), ONLY_BRUSH, logged) for at, v, logged, _ in known]
    return changes, not all(stamped for *_, stamped in rows), [note]


def _changes_of_states(
    bag: Bag, topic: BagTopic
) -> tuple[list[Change], dict[str, float], list[str]]:
    """The changes on a topic of AtomizerState or Bool, the median of each setting, and notes."""
    changes: list[Change] = []
    settings: dict[str, list[float]] = {}
    without_flow, refused = 0, []
    for _, log_time_ns, message in bag.decoded([topic.name]):
        if topic.type == BOOL_TYPE:
            change = TriggerChange(log_time_ns, relative_flow(bool(message.data)))
        else:
            try:
                change = definitions.trigger_change(message)
            except RecordingError as error:
                refused.append(str(error))
                continue
            without_flow += bool(message.spraying) and change.flow == 0.0
        changes.append((change.stamp_ns, change.flow, change.brush, log_time_ns))
        for name in SETTINGS if change.flow > 0.0 else ():
            value = getattr(message, name, np.nan)
            if np.isfinite(value) and value != 0.0:  # 0 is what is not filled
                settings.setdefault(name, []).append(value)
    if refused:
        bag.skipped[f'states on {topic.name}, the first of them an {refused[0]}'] = len(refused)
    notes = [f'trigger {topic.name} {SPRAYS_NOTHING} ({without_flow} states)'] * bool(without_flow)
    return changes, {name: float(np.median(values)) for name, values in settings.items()}, notes


def write_pose_bag(
    folder: Path | str,
    trajectory: Trajectory,
    custom_data: Mapping[str, str] | None = None,
    part: tuple[str, Rigid] | None = None,
    drive: Drive | None = None,
) -> Path:
    """Write a trajectory as a new rosbag2 folder (MCAP): PoseStamped and the trigger.

    The trigger is Bool, or AtomizerState for other flows than 0 and 1 and for numbered brushes.
    ``part`` is name and pose of the part's frame, for /tf_static; the joints of ``drive`` are
    written as one JointTrajectory.
    """
    poses = np.hstack([trajectory.positions_m, trajectory.quaternions_xyzw])
    broken = np.flatnonzero(~np.isfinite(poses).all(axis=1))
    if len(broken):
        raise RecordingError(
            f'pose {broken[0]} of {len(trajectory)} is not finite; nothing written'
        )
    types = definitions.own_types()
    levels = set(trajectory.trigger_flow.tolist()) - {0.0, 1.0}
    state_type = STATE_TYPE if levels or trajectory.trigger_brush.any() else BOOL_TYPE
    frame_id, poses = trajectory.frame_id, poses.tolist()
    # (time, rank at equal times, content): the trigger before the pose.
    entries: list[tuple[int, int, Any]] = [
        (time_ns, 0, gun) for time_ns, *gun in trajectory.triggers
    ]
    entries += [(time_ns, 1, row) for row, time_ns in enumerate(trajectory.stamps_ns.tolist())]
    with RunWriter(folder, custom_data, ros_distro='kilted') as run:

        def write(topic: str, time_ns: int, message: Any) -> None:
            cdr = types.serialize_cdr(message, message.__msgtype__)
            run.write(topic, bytes(cdr), time_ns, time_ns)

        _add_topic(run, POSE_TOPIC, POSE_TYPE)
        if len(trajectory.trigger_stamps_ns):
            _add_topic(run, STATE_TOPIC, state_type)
        if part:
            _add_topic(run, '/tf_static', TF_TYPES[0], latched=True)
            begin_ns, (child, place) = min(time_ns for time_ns, *_ in entries), part
            transform = _pose_message(types, 'Transform', 'Vector3', place.values)
            stamped = types.types['geometry_msgs/msg/TransformStamped']
            placed = stamped(_header(types, begin_ns, frame_id), child, transform)
            write('/tf_static', begin_ns, types.types[TF_TYPES[0]]([placed]))
        if drive:
            begin_ns = int(trajectory.stamps_ns[0])
            _add_topic(run, JOINT_TOPIC, JOINT_TRAJECTORY_TYPE)
            point = types.types['trajectory_msgs/msg/JointTrajectoryPoint']
            duration, none = types.types['builtin_interfaces/msg/Duration'], np.empty(0)
            times_ns = np.rint(drive.seconds * 1e9).astype(np.int64).tolist()
            seconds = [duration(*divmod(at_ns, 10**9)) for at_ns in times_ns]
            points = [
                point(position, speed, none, none, at)
                for position, speed, at in zip(drive.joints, drive.speeds, seconds, strict=True)
            ]
            joints = _header(types, begin_ns, ''), list(drive.arm.joints), points
            write(JOINT_TOPIC, begin_ns, types.types[JOINT_TRAJECTORY_TYPE](*joints))
        for time_ns, is_pose, content in sorted(entries, key=lambda entry: entry[:2]):
            header = _header(types, time_ns, frame_id)
            if is_pose:
                pose = _pose_message(types, 'Pose', 'Point', poses[content])
                write(POSE_TOPIC, time_ns, types.types[POSE_TYPE](header, pose))
            elif state_type == BOOL_TYPE:
                write(STATE_TOPIC, time_ns, types.types[BOOL_TYPE](content[0] > 0.0))
            else:
                # Neither set-points nor a programmed speed.
                (flow, brush), unknown = content, float('nan')
                settings = flow, unknown, unknown, unknown, brush, unknown, unknown
                state = types.types[STATE_TYPE](header, flow > 0.0, *settings)
                write(STATE_TOPIC, time_ns, state)
    return run.folder


def _add_topic(run: RunWriter, name: str, message_type: str, latched: bool = False) -> None:
    qos = [offered_qos(1 if latched else 500, latched=latched)]
    run.add_topic(name, message_type, definitions.standard(message_type), qos)


def _pose_message(types: Typestore, kind: str, place: str, values: Sequence[float]) -> Any:
    """A Pose with a Point, or a Transform with a Vector3, from x y z qx qy qz qw."""
    turn = types.types['geometry_msgs/msg/Quaternion'](*values[3:])
    at = types.types[f'geometry_msgs/msg/{place}'](*values[:3])
    return types.types[f'geometry_msgs/msg/{kind}'](at, turn)


def _header(types: Typestore, time_ns: int, frame_id: str) -> Any:
    stamp = types.types['builtin_interfaces/msg/Time'](*divmod(time_ns, 1_000_000_000))
    return types.types['std_msgs/msg/Header'](stamp, frame_id)
