"""Reading a trajectory, poses and trigger, from a bag, and writing one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.typesys.store import Typestore

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings import messages as definitions
from paint_deposition.files.recordings.bag_files import Bag
from paint_deposition.files.recordings.mcap_run import RunTopic, RunWriter, offered_qos
from paint_deposition.files.recordings.messages import STATE_TYPE, TF_TYPES
from paint_deposition.files.recordings.pose_topics import POSE_TYPE, read_poses
from paint_deposition.files.recordings.triggers import BOOL_TYPE, with_trigger
from paint_deposition.files.tables.headings import LENGTHS
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.motion.stream_quality import StreamQuality, looks_like_mm
from paint_deposition.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from paint_deposition.files.recordings.joint_states import Robot
    from paint_deposition.planning.driving import Drive

POSE_TOPIC = '/atomizer/pose'
STATE_TOPIC = '/atomizer/state'
JOINT_TRAJECTORY_TYPE = 'trajectory_msgs/msg/JointTrajectory'
JOINT_TOPIC = '/joint_trajectory'


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
        unused = [t for t in bag.topics_of(STATE_TYPE, BOOL_TYPE) if t.message_count]
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
            from paint_deposition.files.recordings.pose_topics import read_tf_poses

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
            write(JOINT_TOPIC, begin_ns, _joint_trajectory(types, begin_ns, drive))
        for time_ns, is_pose, content in sorted(entries, key=lambda entry: entry[:2]):
            header = _header(types, time_ns, frame_id)
            if is_pose:
                pose = _pose_message(types, 'Pose', 'Point', poses[content])
                write(POSE_TOPIC, time_ns, types.types[POSE_TYPE](header, pose))
            else:
                write(STATE_TOPIC, time_ns, _state(types, state_type, header, *content))
    return run.folder


def _joint_trajectory(types: Typestore, begin_ns: int, drive: Drive) -> Any:
    point = types.types['trajectory_msgs/msg/JointTrajectoryPoint']
    duration = types.types['builtin_interfaces/msg/Duration']
    none, rows = np.empty(0), zip(drive.seconds.tolist(), drive.joints, drive.speeds, strict=True)
    points = [
        point(position, speed, none, none, duration(int(time_s), round(time_s % 1.0 * 1e9)))
        for time_s, position, speed in rows
    ]
    header = _header(types, begin_ns, '')
    return types.types[JOINT_TRAJECTORY_TYPE](header, list(drive.arm.joints), points)


def _add_topic(run: RunWriter, name: str, message_type: str, latched: bool = False) -> None:
    qos = [offered_qos(1 if latched else 500, latched=latched)]
    run.add_topic(RunTopic(name, message_type, definitions.standard(message_type), qos))


def _state(types: Typestore, kind: str, header: Any, flow: float, brush: int) -> Any:
    """A Bool or an AtomizerState with relative flow and brush."""
    if kind == BOOL_TYPE:
        return types.types[BOOL_TYPE](flow > 0.0)
    # Neither set-points nor a programmed speed.
    unknown = float('nan')
    return types.types[STATE_TYPE](
        header, flow > 0.0, flow, *(unknown,) * 3, brush, unknown, unknown
    )


def _pose_message(types: Typestore, kind: str, place: str, values: Sequence[float]) -> Any:
    """A Pose with a Point, or a Transform with a Vector3, from x y z qx qy qz qw."""
    turn = types.types['geometry_msgs/msg/Quaternion'](*values[3:])
    at = types.types[f'geometry_msgs/msg/{place}'](*values[:3])
    return types.types[f'geometry_msgs/msg/{kind}'](at, turn)


def _header(types: Typestore, time_ns: int, frame_id: str) -> Any:
    stamp = types.types['builtin_interfaces/msg/Time'](*divmod(time_ns, 1_000_000_000))
    return types.types['std_msgs/msg/Header'](stamp, frame_id)
