"""The transforms of a recording: /tf_static, part_pose, and /tf over time."""

from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.recordings.bag_files import Bag
from paint_deposition.files.recordings.headers import transforms_of
from paint_deposition.files.recordings.message_definitions import TF_TYPES
from paint_deposition.motion.frame_tree import FrameTree, NoTransform
from paint_deposition.motion.part_frame import PART_POSE_TOPIC, Rigid
from paint_deposition.motion.trajectory import Trajectory

STATIC = 'tf_static'
PART_POSE_TYPE = 'geometry_msgs/msg/TransformStamped'


@dataclass(frozen=True, eq=False)
class Edge:
    """Poses of a frame in its parent: (N,) stamps, (N,) log times, (N, 7) x y z qx qy qz qw."""

    parent: str
    child: str
    stamps_ns: np.ndarray
    log_times_ns: np.ndarray
    poses: np.ndarray


def part_pose_topics(bag: Bag) -> list[str]:
    """The topics of a bag on which painting nodes published the pose of the part."""
    topics = [topic.name for topic in bag.topics_of(PART_POSE_TYPE)]
    return [name for name in topics if name.rsplit('/', 1)[-1] == PART_POSE_TOPIC]


def _edges(bag: Bag, static: bool) -> list[Edge]:
    """The transforms of a bag, either the static ones or those over time."""
    topics = [topic.name for topic in bag.topics_of(*TF_TYPES)]
    topics = [name for name in topics if (name.rsplit('/', 1)[-1] == STATIC) == static]
    placed = part_pose_topics(bag) if static else []
    rows: dict[tuple[str, str], list[tuple]] = defaultdict(list)
    parts: dict[tuple[str, str], list[tuple]] = defaultdict(list)
    for names, found in ((topics, rows), (placed, parts)):
        for _, log_time_ns, message in bag.decoded(names) if names else ():
            several = message if found is rows else SimpleNamespace(transforms=[message])
            for child, parent, stamp, pose in transforms_of(several):
                found[parent, child].append((stamp, log_time_ns, pose))
    for (parent, child), poses in parts.items():
        if len({pose for *_, pose in poses}) > 1:
            raise RecordingError(
                f"{bag.path}: '{child}' was moved in '{parent}' while the run was recorded; "
                'give --part-pose'
            )
    # The last static transform replaces earlier ones, as in tf2.
    last = slice(-1, None) if static else slice(None)
    return [_edge(*pair, its[last]) for pair, its in (parts | rows).items()]


def moving_transforms(bag: Bag) -> list[Edge]:
    """The transforms of a bag that come more than once and are not static."""
    return [edge for edge in _edges(bag, static=False) if len(edge.stamps_ns) > 1]


def _edge(parent: str, child: str, rows: list[tuple]) -> Edge:
    stamps, log_times, poses = map(np.array, zip(*rows, strict=True))
    _, first = np.unique(stamps, return_index=True)  # in order, each stamp once
    return Edge(parent, child, stamps[first], log_times[first], poses[first].astype(float))


def read_frames(bag: Bag) -> FrameTree:
    """The frames of /tf_static, part_pose and /tf; a static one without direction is none."""
    tree = FrameTree()
    for edge in _edges(bag, static=False):
        for stamp, pose in zip(edge.stamps_ns.tolist(), edge.poses, strict=True):
            tree.add(edge.child, edge.parent, stamp, pose)
    for edge in _edges(bag, static=True):
        if np.isfinite(edge.poses[-1]).all() and np.any(edge.poses[-1][3:]):
            tree.fix(edge.child, edge.parent, edge.poses[-1])
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
    connected, or do not move.
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
    moving = [edge for edge in moving_transforms(bag) if edge.child in between]
    if not moving:
        raise RecordingError(f"{bag.path}: '{source}' does not move in '{target}'")
    clock = max(moving, key=lambda edge: len(edge.stamps_ns))
    covered, found = lookups(tree, source, target, clock.stamps_ns)
    if len(found) < 2:
        raise RecordingError(
            f"{bag.path}: the transforms from '{source}' to '{target}' are never known together"
        )
    note = f"tf: pose of '{source}' in '{target}', {len(found)} poses"
    if more := len(moving) - 1:
        longest_s = max(tree.longest_gap_s(edge.child) for edge in moving)
        note += f', {more} more transforms interpolated over up to {longest_s:.3g} s'
    poses = np.array([pose.values for pose in found])
    trajectory = Trajectory(
        clock.stamps_ns[covered], poses[:, :3], poses[:, 3:], target, notes=(note,)
    )
    return trajectory, clock.log_times_ns[covered]
