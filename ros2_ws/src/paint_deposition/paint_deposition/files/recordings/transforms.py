"""The transforms of a recording: /tf_static, part_pose, and /tf over time."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.recordings.bag_files import Bag
from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.files.recordings.message_definitions import TF_TYPES
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
            for transform in message.transforms if found is rows else [message]:
                pair = transform.header.frame_id.lstrip('/'), transform.child_frame_id.lstrip('/')
                t, q = transform.transform.translation, transform.transform.rotation
                pose = t.x, t.y, t.z, q.x, q.y, q.z, q.w
                found[pair].append((stamp_ns(transform.header), log_time_ns, pose))
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


def _edges_between(graph: nx.Graph, begin: str, end: str) -> list[tuple[str, str]]:
    """The edges from one frame to another, none if they are not connected."""
    try:
        return list(nx.utils.pairwise(nx.shortest_path(graph, begin, end)))
    except (nx.NodeNotFound, nx.NetworkXNoPath):
        return []


@dataclass(frozen=True)
class _Chain:
    """The chain of transforms from one frame to another, and those of them that move."""

    source: str
    target: str
    edges: list[Edge]
    moving: list[Edge]

    @staticmethod
    def from_bag(bag: Bag, source: str, target: str) -> 'tuple[_Chain | None, list[str]]':
        """The chain, None if the frames are not connected, and the names of all frames."""
        graph = nx.Graph()
        for moves in (False, True):
            for edge in _edges(bag, static=not moves):
                graph.add_edge(edge.parent, edge.child, edge=edge, moves=moves)
        source, target = source.lstrip('/'), target.lstrip('/')
        steps = [graph.edges[pair] for pair in _edges_between(graph, source, target)]
        if not steps:
            return None, sorted(graph)
        edges, moving = ([s['edge'] for s in steps if s['moves'] or not m] for m in (False, True))
        return _Chain(source, target, edges, moving), sorted(graph)

    def poses(self, stamps_ns: np.ndarray) -> np.ndarray:
        """Poses (N, 7) of the source in the target at these times, x y z qx qy qz qw."""
        from pytransform3d.trajectories import pqs_from_transforms
        from pytransform3d.transform_manager import (
            NumpyTimeseriesTransform,
            StaticTransform,
            TemporalTransformManager,
        )
        from pytransform3d.transformations import transform_from_pq

        frames = TemporalTransformManager()
        for edge in self.edges:
            # pytransform3d has the scalar of a quaternion first.
            scalar_first = edge.poses[:, [0, 1, 2, 6, 3, 4, 5]]
            moved: Any = StaticTransform(transform_from_pq(scalar_first[0]))
            if len(edge.stamps_ns) > 1:
                times_s = (edge.stamps_ns - stamps_ns[0]) * 1e-9
                moved = NumpyTimeseriesTransform(times_s, scalar_first, time_clipping=True)
            frames.add_transform(edge.child, edge.parent, moved)
        times_s = (stamps_ns - stamps_ns[0]) * 1e-9
        found = frames.get_transform_at_time(self.source, self.target, times_s)
        return pqs_from_transforms(found)[:, [0, 1, 2, 4, 5, 6, 3]]


def _covered(moving: list[Edge], stamps_ns: np.ndarray) -> np.ndarray:
    """Whether all moving transforms are known at these times (N,)."""
    known = np.ones(len(stamps_ns), dtype=bool)
    for edge in moving:
        known &= (stamps_ns >= edge.stamps_ns[0]) & (stamps_ns <= edge.stamps_ns[-1])
    return known


def read_tf_poses(bag: Bag, target: str, source: str) -> tuple[Trajectory, np.ndarray]:
    """The motion of ``source``, the TCP, in ``target``, and the log times (N,) [ns].

    It covers the time in which all transforms of the chain are known, with the stamps of the most
    frequent one; others are interpolated. Raises RecordingError for frames that are missing, not
    connected, or do not move.
    """
    target, source = target.lstrip('/'), source.lstrip('/')
    chain, frames = _Chain.from_bag(bag, source, target)
    for name in (target, source):
        if name not in frames:
            known = did_you_mean(name, frames)
            raise RecordingError(f"{bag.path} has no frame '{name}' in its transforms; {known}")
    if chain is None:
        raise RecordingError(f"{bag.path}: no transforms lead from '{source}' to '{target}'")
    if not chain.moving or max(len(edge.stamps_ns) for edge in chain.moving) < 2:
        raise RecordingError(f"{bag.path}: '{source}' does not move in '{target}'")
    clock = max(chain.moving, key=lambda edge: len(edge.stamps_ns))
    moving = [edge for edge in chain.moving if len(edge.stamps_ns) > 1]
    covered = _covered(moving, clock.stamps_ns)
    stamps = clock.stamps_ns[covered]
    if len(stamps) < 2:
        raise RecordingError(
            f"{bag.path}: the transforms from '{source}' to '{target}' are never known together"
        )
    poses = chain.poses(stamps)
    note = f"tf: pose of '{source}' in '{target}', {len(stamps)} poses"
    if more := len(chain.moving) - 1:
        longest_s = max(np.diff(edge.stamps_ns).max(initial=0) for edge in chain.moving) * 1e-9
        note += f', {more} more transforms interpolated over up to {longest_s:.3g} s'
    trajectory = Trajectory(stamps, poses[:, :3], poses[:, 3:], target, notes=(note,))
    return trajectory, clock.log_times_ns[covered]


def poses_over_time(
    bag: Bag, frame: str, parent: str, stamps_ns: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Which of these times (N,) the transforms cover, and the poses (M, 7) of the frame then.

    None if the frames are not connected.
    """
    chain, _ = _Chain.from_bag(bag, frame, parent)
    if chain is None:
        return None
    known = _covered(chain.moving, stamps_ns)
    return known, chain.poses(stamps_ns[known]) if known.any() else np.empty((0, 7))


class StaticFrames:
    """The static transforms of a recording."""

    def __init__(self, edges: Sequence[Edge]) -> None:
        self._graph = nx.Graph()
        for edge in edges:
            place = Rigid.of(edge.poses[-1])
            self._graph.add_edge(edge.parent, edge.child, child=edge.child, place=place)

    @staticmethod
    def from_bag(bag: Bag) -> 'StaticFrames':
        """The transforms of /tf_static and part_pose."""
        return StaticFrames(_edges(bag, static=True))

    @property
    def places(self) -> list[tuple[str, str, Rigid]]:
        """All transforms: (parent, child, pose)."""
        return [
            (a if edge['child'] == b else b, edge['child'], edge['place'])
            for a, b, edge in self._graph.edges(data=True)
        ]

    def pose_of(self, frame: str, parent: str) -> Rigid | None:
        """The pose of a frame in another, None if they are not connected."""
        found = None
        for here, there in _edges_between(self._graph, parent.lstrip('/'), frame.lstrip('/')):
            edge = self._graph.edges[here, there]
            step = edge['place'] if edge['child'] == there else edge['place'].inverse()
            found = found @ step if found else Rigid.of([0, 0, 0, 0, 0, 0, 1]) @ step
        return found

    def words(self, frame_id: str) -> str:
        """The frames that are static relative to this one, for a message; '' without any."""
        name = frame_id.lstrip('/')
        if name not in self._graph:
            return ''
        others = nx.node_connected_component(self._graph, name) - {name}
        return f' (static transforms connect it to {", ".join(sorted(others))})'
