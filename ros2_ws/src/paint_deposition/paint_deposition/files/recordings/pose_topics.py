"""The poses of a recording: of a topic, or by its transforms, /tf_static, part_pose and /tf."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.recordings.bag_files import Bag, BagTopic, listed_topics
from paint_deposition.files.recordings.messages import (
    JOINT_TYPE,
    TF_TYPES,
    joint_streams,
    pose_of,
    stamp_ns,
    transforms_of,
)
from paint_deposition.motion.stream_quality import StreamQuality, looks_like_mm
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.motion.transforms import (
    PART_POSE_TOPIC,
    FrameTree,
    NoTransform,
    Rigid,
    began_again,
)

STATIC = 'tf_static'
PART_POSE_TYPE = 'geometry_msgs/msg/TransformStamped'


# By child and parent the poses of a frame in another, each stamp once and in order, and when they
# were logged (N,) [ns]. A stream over time that starts again says so in its warnings.
Edges = dict[tuple[str, str], tuple[Trajectory, np.ndarray]]


def starts_again(stamps_ns: np.ndarray, log_times_ns: np.ndarray) -> str:
    """In words where samples, (N,) as they came, start again; '' where they do not.

    Which come before which is not known then: a clock was set back, or a log was looped.
    """
    row = began_again(stamps_ns)
    if row is None:
        return ''
    after_s = 1e-9 * float(log_times_ns[row] - log_times_ns[0])
    return f'the stamps start again {after_s:.3f} s after its first message; cut the bag there'


def part_pose_topics(bag: Bag) -> list[str]:
    """The topics of a bag on which painting nodes published the pose of the part."""
    topics = [topic.name for topic in bag.topics_of(PART_POSE_TYPE)]
    return [name for name in topics if name.rsplit('/', 1)[-1] == PART_POSE_TOPIC]


def _edges(bag: Bag, static: bool) -> Edges:
    """The transforms of a bag, either the static ones or those over time."""
    topics = [topic.name for topic in bag.topics_of(*TF_TYPES)]
    topics = [name for name in topics if (name.rsplit('/', 1)[-1] == STATIC) == static]
    placed = part_pose_topics(bag) if static else []
    rows: dict[tuple[str, str], list[tuple]] = defaultdict(list)
    parts: dict[tuple[str, str], list[tuple]] = defaultdict(list)
    for names, found in ((topics, rows), (placed, parts)):
        for _, log_time_ns, message in bag.decoded(names):
            several = message.transforms if found is rows else [message]
            for child, parent, stamp, pose in transforms_of(several):
                found[child, parent].append((stamp, log_time_ns, pose))
    for (child, parent), poses in parts.items():
        if len({pose for *_, pose in poses}) > 1:
            raise RecordingError(
                f"{bag.path}: '{child}' was moved in '{parent}' while the run was recorded; "
                'give --part-pose'
            )
    # The last static transform replaces earlier ones, as in tf2.
    last = slice(-1, None) if static else slice(None)
    edges: Edges = {}
    for (child, parent), its in (parts | rows).items():
        stamps, log_times, values = map(np.array, zip(*its[last], strict=True))
        _, first = np.unique(stamps, return_index=True)
        places, turns = np.split(values[first].astype(float), [3], axis=1)
        fault = '' if static else starts_again(stamps, log_times)
        faults = (fault,) if fault else ()
        told = Trajectory(stamps[first], places, turns, parent, warnings=faults)
        edges[child, parent] = told, log_times[first]
    return edges


def read_frames(bag: Bag) -> FrameTree:
    """The frames of /tf_static, part_pose and /tf; a static one without direction is none."""
    tree = FrameTree()
    for static in (False, True):
        for (child, parent), (poses, _) in _edges(bag, static).items():
            values = np.hstack([poses.positions_m, poses.quaternions_xyzw])
            for stamp, pose in zip(poses.stamps_ns.tolist(), values, strict=True):
                if not static:
                    tree.add(child, parent, stamp, pose)
                elif np.isfinite(pose).all() and np.any(pose[3:]):
                    tree.fix(child, parent, pose)
    return tree


def lookups(
    tree: FrameTree, source: str, target: str, stamps_ns: np.ndarray
) -> tuple[np.ndarray, list[Rigid]]:
    """Which of these times (N,) have a pose of ``source`` in ``target``, and the poses."""
    known, poses = np.zeros(len(stamps_ns), dtype=bool), []
    for row, stamp in enumerate(stamps_ns.tolist()):
        with suppress(NoTransform):
            poses.append(tree.lookup(source, target, stamp))
            known[row] = True
    return known, poses


def read_tf_poses(bag: Bag, target: str, source: str) -> tuple[Trajectory, np.ndarray]:
    """The motion of ``source``, the TCP, in ``target``, and the log times (N,) [ns].

    It covers the time in which all transforms of the chain are known, with the stamps of the most
    frequent one; others are interpolated. Raises RecordingError for frames that are missing, not
    connected, do not move, or start again.
    """
    target, source = target.lstrip('/'), source.lstrip('/')
    tree = read_frames(bag)
    for name in (target, source):
        if name not in tree.names:
            known = did_you_mean(name, tree.names)
            raise RecordingError(f"{bag.path} has no frame '{name}' in its transforms; {known}")
    between = tree.moving_between(source, target)
    if between is None:
        raise RecordingError(f"{bag.path}: no transforms lead from '{source}' to '{target}'")
    edges = {key: edge for key, edge in _edges(bag, static=False).items() if key[0] in between}
    for (child, parent), (poses, _) in edges.items():
        for fault in poses.warnings:
            raise RecordingError(f'{bag.path}: {parent} to {child}: {fault}')
    moving = [edge for edge in edges.values() if len(edge[0]) > 1]
    if not moving:
        raise RecordingError(f"{bag.path}: '{source}' does not move in '{target}'")
    clock, log_times_ns = max(moving, key=lambda edge: len(edge[0]))
    covered, found = lookups(tree, source, target, clock.stamps_ns)
    if len(found) < 2:
        raise RecordingError(
            f"{bag.path}: the transforms from '{source}' to '{target}' are never known together"
        )
    note = f"tf: pose of '{source}' in '{target}', {len(found)} poses"
    if more := len(moving) - 1:
        longest_s = 1e-9 * max(np.diff(poses.stamps_ns).max() for poses, _ in moving)
        note += f', {more} more transforms interpolated over up to {longest_s:.3g} s'
    places, turns = np.split(np.array([pose.values for pose in found]), [3], axis=1)
    trajectory = Trajectory(clock.stamps_ns[covered], places, turns, target, notes=(note,))
    return trajectory, log_times_ns[covered]


POSE_TYPE = 'geometry_msgs/msg/PoseStamped'
# The pose in a message of each type.
POSES: dict[str, Callable[[Any], Any]] = {
    POSE_TYPE: lambda message: message.pose,
    'geometry_msgs/msg/PoseWithCovarianceStamped': lambda message: message.pose.pose,
    'nav_msgs/msg/Odometry': lambda message: message.pose.pose,
    PART_POSE_TYPE: lambda message: message.transform,
}


def pose_topics(bag: Bag) -> list[BagTopic]:
    """The topics of poses in a bag; those of PoseStamped first, none of the part's pose."""
    others = part_pose_topics(bag)
    return [topic for topic in bag.topics_of(*POSES) if topic.name not in others]


def choose_pose_topic(bag: Bag, name: str | None) -> BagTopic:
    """The named topic of poses of a bag, or its only one; errors list the candidates.

    The only one is that of PoseStamped, or where there is none that of another type.
    """
    kind = 'pose' if {topic.type for topic in pose_topics(bag)} - {POSE_TYPE} else 'PoseStamped'
    if not name:
        candidates = bag.topics_of(POSE_TYPE) or pose_topics(bag)
        candidates = [topic for topic in candidates if topic.message_count] or candidates
        if len(candidates) != 1:
            listed = listed_topics(candidates, kind)
            moves = ['transforms (give tf: TARGET SOURCE)'] if bag.topics_of(*TF_TYPES) else []
            moves += ['joint states (give urdf)'] if bag.topics_of(JOINT_TYPE) else []
            others = f'; it has {" and ".join(moves)}' if moves else ''
            raise RecordingError(f'{bag.path}: name a pose topic; {listed}{others}')
        name = candidates[0].name
    topic = bag.choose(name, tuple(POSES), kind)
    if topic.message_count == 0:
        raise RecordingError(f'{topic.name} in {bag.path} has no messages; record it again')
    return topic


def read_poses(bag: Bag, name: str | None) -> tuple[Trajectory, np.ndarray, str]:
    """The poses of a topic as recorded, when they were logged (N,) int64 [ns], and its name.

    Poses in several frames are said to be in the most frequent one, and ``frames`` has that of
    each. Raises RecordingError for several bodies, or if all poses have one stamp.
    """
    topic = choose_pose_topic(bag, name)
    stamps, log_times, rows = [], [], []
    frames: list[str] = []
    bodies: Counter[str] = Counter()
    for _, log_time_ns, message in bag.decoded([topic.name]):
        stamps.append(stamp_ns(message.header))
        log_times.append(log_time_ns)
        rows.append(np.concatenate(pose_of(POSES[topic.type](message))))
        frames.append(message.header.frame_id.lstrip('/'))
        bodies[message.child_frame_id if topic.type == PART_POSE_TYPE else ''] += 1
    if len(rows) != topic.message_count:
        raise RecordingError(
            f'{bag.path} lists {topic.message_count} messages on {topic.name} and holds '
            f'{len(rows)}; run: paint recover {bag.path}'
        )
    if len(bodies) > 1:
        found = ', '.join(f"'{body}' ({count})" for body, count in sorted(bodies.items()))
        raise RecordingError(f'{topic.name} in {bag.path} mixes frames {found}; record one frame')
    if len(stamps) > 1 and len(set(stamps)) == 1:
        raise RecordingError(
            f'all {len(stamps)} poses on {topic.name} in {bag.path} are stamped {stamps[0]} ns; '
            'let the publisher stamp each pose'
        )
    values = np.array(rows, dtype=float)
    positions, quaternions = map(np.ascontiguousarray, np.split(values, [3], axis=1))
    ((frame_id, most),) = Counter(frames).most_common(1)
    trajectory = Trajectory(
        np.array(stamps, np.int64), positions, quaternions, frame_id,
        frames=tuple(frames) if most < len(frames) else (),
    )  # fmt: skip
    return trajectory, np.array(log_times, np.int64), topic.name


@dataclass(frozen=True)
class PoseSource:
    """One source of poses in a bag: its figures by the header stamps, and how it is read.

    ``frame_id`` is that of the poses, '' for joints and where it is not recorded; ``unit`` what
    the numbers look like; ``options`` take the motion from it. ``faults`` say why it will not do,
    or what it costs.
    """

    topic: str
    type: str
    frame_id: str = ''
    unit: str = ''
    quality: StreamQuality | None = None  # None: its motion cannot be read
    options: str = ''
    faults: tuple[str, ...] = ()


def sources_of_poses(bag: Bag, max_gap_s: float) -> Iterator[PoseSource]:
    """The sources of poses in a bag: topics, joints, transforms that move.

    A longer interval than this is a gap.
    """
    for topic in pose_topics(bag):
        if not topic.message_count:
            continue
        try:
            poses, logged, _ = read_poses(bag, topic.name)
        except RecordingError as error:
            yield PoseSource(topic.name, topic.type, faults=(str(error),))
            continue
        options = f'--pose-topic {topic.name}'
        yield _source(topic.name, topic.type, poses, logged, options, max_gap_s)
    for topic in bag.topics_of(JOINT_TYPE):
        streams, _ = joint_streams(bag.decoded([topic.name]))
        rows = max(streams.values(), key=len, default=[])
        if rows:  # the joints that most messages have
            stamps, logged, joints = map(np.array, zip(*rows, strict=True))
            if fault := starts_again(stamps, logged):
                yield PoseSource(topic.name, topic.type, faults=(fault,))
                continue
            quality = StreamQuality.of(stamps, joints, logged, max_gap_s)
            # Joints of a robot that is not known do not turn further [rad].
            degrees = np.nanmax(np.abs(joints), initial=0.0) > 4.0 * np.pi
            options = f'--urdf ROBOT --pose-topic {topic.name}'
            options += ' --angle-unit deg' if degrees else ''
            unit, faults = 'deg' if degrees else 'rad', tuple(quality.faults(topic.name))
            yield PoseSource(topic.name, topic.type, '', unit, quality, options, faults)
    for (child, parent), (poses, logged) in _edges(bag, static=False).items():
        if len(poses) < 2:
            continue
        name, options = f'{parent} to {child}', f'--tf {parent} {child}'
        if poses.warnings:
            yield PoseSource(name, 'transforms', parent, faults=poses.warnings)
            continue
        yield _source(name, 'transforms', poses, logged, options, max_gap_s)


def _source(
    name: str, kind: str, poses: Trajectory, logged: np.ndarray, options: str, max_gap_s: float
) -> PoseSource:
    values = np.hstack([poses.positions_m, poses.quaternions_xyzw])
    quality = StreamQuality.of(poses.stamps_ns, values, logged, max_gap_s)
    unit = 'mm' if looks_like_mm(poses.positions_m) else 'm'
    options += ' --pose-unit mm' if unit == 'mm' else ''
    faults = tuple(quality.faults(name))
    return PoseSource(name, kind, poses.frame_id, unit, quality, options, faults)
