"""The frames of a recording, from its transforms: /tf_static, part_pose, and /tf over time.

networkx finds the way from one frame to another; the interpolation over time and the products
along the way are pytransform3d's.
"""

from __future__ import annotations

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
    """A frame in its parent's: (N,) int64 stamps, (N,) log times, (N, 7) x y z qx qy qz qw."""

    parent: str
    child: str
    stamps_ns: np.ndarray
    log_times_ns: np.ndarray
    poses: np.ndarray


def part_pose_topics(bag: Bag) -> list[str]:
    """The topics of a bag on which painting nodes published where the part stood."""
    topics = [topic.name for topic in bag.topics_of(PART_POSE_TYPE)]
    return [name for name in topics if name.rsplit('/', 1)[-1] == PART_POSE_TOPIC]


def _edges(bag: Bag, static: bool) -> list[Edge]:
    """The transforms of a bag, either the static ones or those over time."""
    topics = [topic.name for topic in bag.topics_of(*TF_TYPES)]
    topics = [name for name in topics if (name.rsplit('/', 1)[-1] == STATIC) == static]
    placed = part_pose_topics(bag) if static else []
    rows: dict[tuple[str, str], list[tuple]] = {}
    parts: dict[tuple[str, str], list[tuple]] = {}
    for names, found in ((topics, rows), (placed, parts)):
        for _, log_time_ns, message in bag.decoded(names) if names else ():
            for transform in message.transforms if found is rows else [message]:
                pair = transform.header.frame_id.lstrip('/'), transform.child_frame_id.lstrip('/')
                row = (stamp_ns(transform.header), log_time_ns, _numbers(transform.transform))
                found.setdefault(pair, []).append(row)
    for (parent, child), placings in parts.items():
        if len({pose for *_, pose in placings}) > 1:
            raise RecordingError(
                f"{bag.path}: '{child}' was placed anew in '{parent}' while the run was recorded; "
                'give --part-pose'
            )
    # Of a static transform that is sent again, the last holds, as in tf2.
    last = slice(-1, None) if static else slice(None)
    return [_edge(*pair, its[last]) for pair, its in (parts | rows).items()]


def _numbers(transform: Any) -> tuple[float, ...]:
    t, q = transform.translation, transform.rotation
    return t.x, t.y, t.z, q.x, q.y, q.z, q.w


def _edge(parent: str, child: str, rows: list[tuple]) -> Edge:
    stamps, log_times, poses = map(np.array, zip(*rows, strict=True))
    _, first = np.unique(stamps, return_index=True)  # in order, each stamp once
    return Edge(parent, child, stamps[first], log_times[first], poses[first].astype(float))


@dataclass(frozen=True)
class _Way:
    """The edges from one frame to another, and those of them that move."""

    source: str
    target: str
    edges: list[Edge]
    moving: list[Edge]

    @staticmethod
    def in_bag(bag: Bag, source: str, target: str) -> tuple[_Way | None, list[str]]:
        """The way, None where the frames are not connected, and the names of all frames."""
        graph = nx.Graph()
        for moves in (False, True):
            for edge in _edges(bag, static=not moves):
                graph.add_edge(edge.parent, edge.child, edge=edge, moves=moves)
        source, target = source.lstrip('/'), target.lstrip('/')
        connected = source in graph and target in graph and nx.has_path(graph, source, target)
        if not connected:
            return None, sorted(graph)
        pairs = nx.utils.pairwise(nx.shortest_path(graph, source, target))
        steps = [graph.edges[pair] for pair in pairs]
        edges = [step['edge'] for step in steps]
        return _Way(source, target, edges, [s['edge'] for s in steps if s['moves']]), sorted(graph)

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
            # It takes the scalar of a quaternion first.
            scalar_first = edge.poses[:, [0, 1, 2, 6, 3, 4, 5]]
            if len(edge.stamps_ns) > 1:
                times_s = (edge.stamps_ns - stamps_ns[0]) * 1e-9
                moved = NumpyTimeseriesTransform(times_s, scalar_first, time_clipping=True)
                frames.add_transform(edge.child, edge.parent, moved)
            else:
                still = StaticTransform(transform_from_pq(scalar_first[0]))
                frames.add_transform(edge.child, edge.parent, still)
        times_s = (stamps_ns - stamps_ns[0]) * 1e-9
        found = frames.get_transform_at_time(self.source, self.target, times_s)
        return pqs_from_transforms(found)[:, [0, 1, 2, 4, 5, 6, 3]]


def read_tf_poses(bag: Bag, target: str, source: str) -> tuple[Trajectory, np.ndarray]:
    """The motion of one frame in another, from the transforms of a bag.

    Between the transforms of the way that come most often the others are interpolated.

    Args:
        bag: open.
        target: the frame in which the poses are. source: the frame of the TCP.

    Returns:
        The motion while all transforms of the way are known, and the times (N,) int64 at which
        its poses were logged [ns].

    Raises:
        RecordingError: a frame is not there, they are not connected, or do not move.
    """
    target, source = target.lstrip('/'), source.lstrip('/')
    way, frames = _Way.in_bag(bag, source, target)
    for name in (target, source):
        if name not in frames:
            known = did_you_mean(name, frames)
            raise RecordingError(f"{bag.path} has no frame '{name}' in its transforms; {known}")
    if way is None:
        raise RecordingError(f"{bag.path}: no transforms lead from '{source}' to '{target}'")
    if not way.moving or max(len(edge.stamps_ns) for edge in way.moving) < 2:
        raise RecordingError(f"{bag.path}: '{source}' does not move in '{target}'")
    begin = max(edge.stamps_ns[0] for edge in way.moving if len(edge.stamps_ns) > 1)
    end = min(edge.stamps_ns[-1] for edge in way.moving if len(edge.stamps_ns) > 1)
    clock = max(way.moving, key=lambda edge: len(edge.stamps_ns))
    known = (clock.stamps_ns >= begin) & (clock.stamps_ns <= end)
    stamps = clock.stamps_ns[known]
    if len(stamps) < 2:
        raise RecordingError(
            f"{bag.path}: the transforms from '{source}' to '{target}' are never known together"
        )
    poses = way.poses(stamps)
    note = f"tf: pose of '{source}' in '{target}', {len(stamps)} poses"
    if more := len(way.moving) - 1:
        longest_s = max(_longest_s(edge, stamps) for edge in way.moving)
        note += f', {more} more transforms interpolated over up to {longest_s:.3g} s'
    trajectory = Trajectory(stamps, poses[:, :3], poses[:, 3:], target, notes=(note,))
    return trajectory, clock.log_times_ns[known]


def poses_over_time(
    bag: Bag, frame: str, parent: str, stamps_ns: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """A frame in another one that it moves in, from the transforms of a bag.

    Returns:
        Which of these times (N,) the transforms cover, and the poses (M, 7) at those, x y z qx qy
        qz qw; None where the frames are not connected.
    """
    way, _ = _Way.in_bag(bag, frame, parent)
    if way is None:
        return None
    known = np.ones(len(stamps_ns), dtype=bool)
    for edge in way.moving:
        known &= (stamps_ns >= edge.stamps_ns[0]) & (stamps_ns <= edge.stamps_ns[-1])
    return known, way.poses(stamps_ns[known]) if known.any() else np.empty((0, 7))


def _longest_s(edge: Edge, stamps: np.ndarray) -> float:
    """The longest time between two transforms around one of these times [s]."""
    if len(edge.stamps_ns) < 2:
        return 0.0
    after = np.clip(np.searchsorted(edge.stamps_ns, stamps), 1, len(edge.stamps_ns) - 1)
    return float((edge.stamps_ns[after] - edge.stamps_ns[after - 1]).max()) * 1e-9


class StaticFrames:
    """Frames that stand still to one another."""

    def __init__(self, edges: Sequence[Edge]) -> None:
        self._graph = nx.Graph()
        for edge in edges:
            place = Rigid.of(edge.poses[-1])
            self._graph.add_edge(edge.parent, edge.child, child=edge.child, place=place)

    @staticmethod
    def in_bag(bag: Bag) -> StaticFrames:
        """Those of /tf_static and part_pose."""
        return StaticFrames(_edges(bag, static=True))

    @property
    def places(self) -> list[tuple[str, str, Rigid]]:
        """Each frame in its parent's: (parent, child, pose)."""
        return [
            (a if edge['child'] == b else b, edge['child'], edge['place'])
            for a, b, edge in self._graph.edges(data=True)
        ]

    def pose_of(self, frame: str, parent: str) -> Rigid | None:
        """The pose of a frame in another, None where they are not connected."""
        try:
            way = nx.shortest_path(self._graph, parent.lstrip('/'), frame.lstrip('/'))
        except (nx.NodeNotFound, nx.NetworkXNoPath):
            return None
        found = Rigid.of([0, 0, 0, 0, 0, 0, 1])
        for here, there in nx.utils.pairwise(way):
            edge = self._graph.edges[here, there]
            found = found @ (edge['place'] if edge['child'] == there else edge['place'].inverse())
        return found

    def words(self, frame_id: str) -> str:
        """The frames that could be the part's, for a message; nothing where there is none."""
        if frame_id.lstrip('/') not in self._graph:
            return ''
        known = nx.node_connected_component(self._graph, frame_id.lstrip('/'))
        return f' (it stands still to {", ".join(sorted(known - {frame_id.lstrip("/")}))})'
