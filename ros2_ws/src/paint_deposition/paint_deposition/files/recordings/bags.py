"""A bag's poses and trigger as a trajectory, and a trajectory as a bag."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import get_typestore
from rosbags.typesys.store import Typestore

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings import message_definitions as definitions
from paint_deposition.files.recordings.bag_files import Bag, BagTopic, open_bag
from paint_deposition.files.recordings.mcap_run import RunTopic, RunWriter, offered_qos
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.motion.trigger import relative_flow

POSE_TYPE = 'geometry_msgs/msg/PoseStamped'
STATE_TYPE = 'paint_msgs/msg/AtomizerState'
BOOL_TYPE = 'std_msgs/msg/Bool'
POSE_TOPIC = '/atomizer/pose'
STATE_TOPIC = '/atomizer/state'
# What a state tells of the process while the gun sprays.
SETTINGS = ('flow', 'shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv')
# A Bool has no stamp; the time it was logged at stands in for it as long as the poses show that
# the recorder's clock is the robot's.
MAX_CLOCK_OFFSET_S = 1.0
WRITTEN_DEPTH = 500


def read_trajectory(
    path: Path | str, pose_topic: str | None = None, state_topic: str | None = None
) -> Trajectory:
    """Read the atomizer's motion from a bag.

    Args:
        path: ROS 1 .bag, rosbag2 folder (sqlite3 or MCAP, split or not) or lone .mcap.
        pose_topic: its PoseStamped topic, leading slash or not; None takes the only one.
        state_topic: paint_msgs/AtomizerState, which counts from its header stamp, or
            std_msgs/Bool, which counts from its log time. None: the gun always sprays, and
            topics that could be its trigger are noted.

    Returns:
        The poses as recorded, unscreened, with stamps in integer nanoseconds.

    Raises:
        RecordingError: one line that names the bag, what is wrong and what to do.
    """
    with open_bag(path) as bag:
        poses = choose_pose_topic(bag, pose_topic)
        state = choose_state_topic(bag, state_topic) if state_topic else None
        notes = () if state else _unused_triggers(bag)
        trajectory, log_times_ns = _read_poses(bag, poses)
        changes, settings = _read_states(bag, state) if state else ([], {})
        if state and state.type == BOOL_TYPE:
            offset_ns = float(np.median(log_times_ns - trajectory.stamps_ns))
            _refuse_other_clock(bag, state, poses, offset_ns * 1e-9)
    return replace(
        trajectory,
        trigger_stamps_ns=np.array([stamp for stamp, _ in changes], dtype=np.int64),
        trigger_flow=np.array([flow for _, flow in changes], dtype=float),
        notes=notes,
        settings=settings,
    )


def choose_pose_topic(bag: Bag, name: str | None) -> BagTopic:
    """The named PoseStamped topic of a bag, or its only one; the errors list those there are."""
    if not name:
        candidates = bag.topics_of(POSE_TYPE)
        if len(candidates) != 1:
            listed = _listed(candidates, 'PoseStamped')
            raise RecordingError(f'{bag.path}: name a pose topic; {listed}')
        name = candidates[0].name
    topic = _choose_topic(bag, name, (POSE_TYPE,), 'PoseStamped')
    if topic.message_count == 0:
        raise RecordingError(f'{topic.name} in {bag.path} has no messages; record it again')
    return topic


def choose_state_topic(bag: Bag, name: str) -> BagTopic:
    """The named trigger topic of a bag."""
    return _choose_topic(bag, name, (STATE_TYPE, BOOL_TYPE), 'state')


def _choose_topic(bag: Bag, name: str, types: tuple[str, ...], kind: str) -> BagTopic:
    listed = _listed(bag.topics_of(*types), kind)
    topic = bag.find(name)
    if topic is None:
        raise RecordingError(f'{bag.path} has no topic {name}; {listed}')
    if topic.type not in types:
        raise RecordingError(
            f'{topic.name} in {bag.path} is {topic.type}, not {" or ".join(types)}; {listed}'
        )
    return topic


def stamp_ns(header: Any) -> int:
    """A header's stamp in integer nanoseconds, which a float could not hold."""
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def _listed(candidates: list[BagTopic], kind: str) -> str:
    if not candidates:
        return f'it has no {kind} topic'
    return f'its {kind} topics: {" ".join(topic.name for topic in candidates)}'


def _unused_triggers(bag: Bag) -> tuple[str, ...]:
    """One note that names the topics that could be the trigger; none where there are none."""
    # States say what they are, a Bool may be anything: the first is the likeliest trigger.
    topics = [topic for topic in bag.topics_of(STATE_TYPE, BOOL_TYPE) if topic.message_count]
    if not topics:
        return ()
    named = ' and '.join(f'{topic.name} ({topic.type})' for topic in topics)
    return (
        f'recording {bag.path}: {named} {"is" if len(topics) == 1 else "are"} not used, the gun '
        f'sprays whenever poses flow; add `state_topic: {topics[0].name}` (--state-topic) if '
        'that is the trigger',
    )


def _read_poses(bag: Bag, topic: BagTopic) -> tuple[Trajectory, np.ndarray]:
    """The poses of a topic, and the times (N,) int64 at which they were logged [ns]."""
    stamps, log_times, rows = [], [], []
    frames: Counter[str] = Counter()
    for _, log_time_ns, message in bag.decoded([topic.name]):
        p, q = message.pose.position, message.pose.orientation
        stamps.append(stamp_ns(message.header))
        log_times.append(log_time_ns)
        rows.append((p.x, p.y, p.z, q.x, q.y, q.z, q.w))
        frames[message.header.frame_id.lstrip('/')] += 1
    if len(rows) != topic.message_count:
        raise RecordingError(
            f'{bag.path} lists {topic.message_count} messages on {topic.name} and holds '
            f'{len(rows)}; run: paint recover {bag.path}'
        )
    if len(frames) > 1:
        found = ', '.join(f"'{frame}' ({count})" for frame, count in sorted(frames.items()))
        raise RecordingError(f'{topic.name} in {bag.path} mixes frames {found}; record one frame')
    if len(stamps) > 1 and len(set(stamps)) == 1:
        raise RecordingError(
            f'all {len(stamps)} poses on {topic.name} in {bag.path} are stamped {stamps[0]} ns; '
            'let the publisher stamp each pose'
        )
    values = np.array(rows, dtype=float)
    trajectory = Trajectory(
        np.array(stamps, dtype=np.int64),
        np.ascontiguousarray(values[:, :3]),
        np.ascontiguousarray(values[:, 3:]),
        next(iter(frames)),
    )
    return trajectory, np.array(log_times, dtype=np.int64)


def _read_states(bag: Bag, topic: BagTopic) -> tuple[list[tuple[int, float]], dict[str, float]]:
    """Times and flows of all changes, and the median of each setting that the states tell."""
    changes: list[tuple[int, float]] = []
    told: dict[str, list[float]] = {}
    for _, log_time_ns, message in bag.decoded([topic.name]):
        if topic.type == BOOL_TYPE:
            changes.append((log_time_ns, relative_flow(bool(message.data))))
            continue
        stamp = stamp_ns(message.header)
        if stamp == 0:
            raise RecordingError(
                f'{topic.name} in {bag.path} has a state without a stamp; '
                'let the publisher stamp each state'
            )
        changes.append((stamp, relative_flow(message.spraying, message.flow)))
        for name in SETTINGS:
            value = getattr(message, name, np.nan)
            if message.spraying and np.isfinite(value):
                told.setdefault(name, []).append(value)
    changes.sort(key=lambda change: change[0])
    return changes, {name: float(np.median(values)) for name, values in told.items()}


def _refuse_other_clock(bag: Bag, state: BagTopic, poses: BagTopic, offset_s: float) -> None:
    if abs(offset_s) > MAX_CLOCK_OFFSET_S:
        raise RecordingError(
            f'{state.name} in {bag.path} has no stamps, and {poses.name} was logged '
            f'{offset_s:.3g} s off its own stamps; record {STATE_TYPE} instead of {BOOL_TYPE}'
        )


def write_pose_bag(
    folder: Path | str,
    trajectory: Trajectory,
    pose_topic: str = POSE_TOPIC,
    state_topic: str = STATE_TOPIC,
    custom_data: Mapping[str, str] | None = None,
) -> Path:
    """Write a trajectory as a new rosbag2 folder (MCAP): PoseStamped, and Bool for its trigger.

    The trigger's messages come before the poses that they hold for. A Bool is on or off: a
    trajectory with another flow than 0 or 1 is refused.
    """
    levels = set(trajectory.trigger_flow.tolist()) - {0.0, 1.0}
    if levels:
        raise RecordingError(
            f'{folder}: a Bool trigger cannot hold flow {min(levels):g}; use 0 and 1'
        )
    poses = np.hstack([trajectory.positions_m, trajectory.quaternions_xyzw])
    broken = np.flatnonzero(~np.isfinite(poses).all(axis=1))
    if len(broken):
        raise RecordingError(
            f'pose {broken[0]} of {len(trajectory)} is not finite; nothing written'
        )
    types = get_typestore(definitions.STANDARD_STORE)
    triggers = zip(trajectory.trigger_stamps_ns.tolist(), trajectory.trigger_flow, strict=True)
    # Behind the time, what comes first of those at one time.
    entries: list[tuple[int, int, Any]] = [(time_ns, 0, flow > 0.0) for time_ns, flow in triggers]
    entries += [(time_ns, 1, row) for row, time_ns in enumerate(trajectory.stamps_ns.tolist())]
    with RunWriter(folder, custom_data, ros_distro='kilted') as run:
        _add_topic(run, pose_topic, POSE_TYPE)
        if len(trajectory.trigger_stamps_ns):
            _add_topic(run, state_topic, BOOL_TYPE)
        for time_ns, is_pose, content in sorted(entries, key=lambda entry: entry[:2]):
            if is_pose:
                pose = _pose(types, time_ns, trajectory.frame_id, poses[content].tolist())
                cdr = types.serialize_cdr(pose, POSE_TYPE)
            else:
                cdr = types.serialize_cdr(types.types[BOOL_TYPE](content), BOOL_TYPE)
            run.write(pose_topic if is_pose else state_topic, bytes(cdr), time_ns, time_ns)
    return run.folder


def _add_topic(run: RunWriter, name: str, message_type: str) -> None:
    qos = [offered_qos(WRITTEN_DEPTH)]
    run.add_topic(RunTopic(name, message_type, definitions.standard(message_type), qos))


def _pose(types: Typestore, time_ns: int, frame_id: str, values: list[float]) -> object:
    make = types.types
    stamp = make['builtin_interfaces/msg/Time'](*divmod(time_ns, 1_000_000_000))
    return make[POSE_TYPE](
        make['std_msgs/msg/Header'](stamp, frame_id),
        make['geometry_msgs/msg/Pose'](
            make['geometry_msgs/msg/Point'](*values[:3]),
            make['geometry_msgs/msg/Quaternion'](*values[3:]),
        ),
    )
