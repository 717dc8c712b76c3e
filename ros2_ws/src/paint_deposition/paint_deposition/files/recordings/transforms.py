"""The frames of a recording, from its transforms: /tf_static, part_pose, and /tf over time.

networkx finds the way from one frame to another; the interpolation over time and the products
along the way are pytransform3d's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.recordings.bag_files import Bag, open_bag
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


def read_edges(bag: Bag, static: bool) -> list[Edge]:
    """The transforms of a bag, either the static ones or those over time.

    Raises:
        RecordingError: the part was placed anew while the run was recorded.
    """
    names = [
        topic.name for topic in bag.topics_of(*TF_TYPES)
        if (topic.name.rsplit('/', 1)[-1] == STATIC) == static
    ]  # fmt: skip
    rows: dict[tuple[str, str], list[tuple]] = {}
    if names:
        for _, log_time_ns, message in bag.decoded(names):
            for transform in message.transforms:
                pair = (transform.header.frame_id, transform.child_frame_id)
                row = (*_numbers(transform, log_time_ns),)
                rows.setdefault((pair[0].lstrip('/'), pair[1].lstrip('/')), []).append(row)
    if static:
        for pair, found in _part_poses(bag).items():
            rows.setdefault(pair, found)
    # Of a static transform that is sent again, the last holds, as in tf2.
    last = slice(-1, None) if static else slice(None)
    return [_edge(*pair, found[last]) for pair, found in rows.items()]


def part_pose_topics(bag: Bag) -> list[str]:
    """The topics of a bag on which painting nodes told where the part stood."""
    return [
        topic.name for topic in bag.topics_of(PART_POSE_TYPE)
        if topic.name.rsplit('/', 1)[-1] == PART_POSE_TOPIC
    ]  # fmt: skip


def _part_poses(bag: Bag) -> dict[tuple[str, str], list[tuple]]:
    """Where the part stood, by the names of its parent's frame and its own."""
    found: dict[tuple[str, str], list[tuple]] = {}
    names = part_pose_topics(bag)
    if not names:
        return found
    for _, log_time_ns, message in bag.decoded(names):
        pair = message.header.frame_id.lstrip('/'), message.child_frame_id.lstrip('/')
        row = (*_numbers(message, log_time_ns),)
        if found.setdefault(pair, [row])[0][-1] != row[-1]:
            raise RecordingError(
                f"{bag.path}: '{pair[1]}' was placed anew in '{pair[0]}' while the run was "
                'recorded; give --part-pose'
            )
    return found


def _numbers(transform: Any, log_time_ns: int) -> Iterator[Any]:
    stamp, t, q = transform.header.stamp, transform.transform.translation, transform.transform
    yield stamp.sec * 1_000_000_000 + stamp.nanosec
    yield log_time_ns
    yield (t.x, t.y, t.z, q.rotation.x, q.rotation.y, q.rotation.z, q.rotation.w)


def _edge(parent: str, child: str, rows: list[tuple]) -> Edge:
    stamps, log_times, poses = map(np.array, zip(*rows, strict=True))
    _, first = np.unique(stamps, return_index=True)  # in order, each stamp once
    return Edge(parent, child, stamps[first], log_times[first], poses[first].astype(float))


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
    graph = _frames(bag)
    for name in (target, source):
        if name not in graph:
            known = did_you_mean(name, sorted(graph))
            raise RecordingError(f"{bag.path} has no frame '{name}' in its transforms; {known}")
    if not nx.has_path(graph, source, target):
        raise RecordingError(f"{bag.path}: no transforms lead from '{source}' to '{target}'")
    way = nx.utils.pairwise(nx.shortest_path(graph, source, target))
    steps = [graph.edges[pair] for pair in way]
    timed = [step['edge'] for step in steps if step['moves']]
    if not timed or max(len(edge.stamps_ns) for edge in timed) < 2:
        raise RecordingError(f"{bag.path}: '{source}' does not move in '{target}'")
    begin = max(edge.stamps_ns[0] for edge in timed if len(edge.stamps_ns) > 1)
    end = min(edge.stamps_ns[-1] for edge in timed if len(edge.stamps_ns) > 1)
    clock = max(timed, key=lambda edge: len(edge.stamps_ns))
    known = (clock.stamps_ns >= begin) & (clock.stamps_ns <= end)
    stamps = clock.stamps_ns[known]
    if len(stamps) < 2:
        raise RecordingError(
            f"{bag.path}: the transforms from '{source}' to '{target}' are never known together"
        )
    poses = _followed([step['edge'] for step in steps], source, target, stamps)
    note = f"tf: pose of '{source}' in '{target}', {len(stamps)} poses"
    longest_s = max(_longest_s(edge, stamps) for edge in timed)
    if edges := len(timed) - 1:
        note += f', {edges} more transforms interpolated over up to {longest_s:.3g} s'
    trajectory = Trajectory(stamps, poses[:, :3], poses[:, 3:], target, notes=(note,))
    return trajectory, clock.log_times_ns[known]


def _frames(bag: Bag) -> nx.Graph:
    """All frames of a bag, joined by their edges; ``moves`` tells those over time."""
    graph = nx.Graph()
    for moves in (False, True):
        for edge in read_edges(bag, static=not moves):
            graph.add_edge(edge.parent, edge.child, edge=edge, moves=moves)
    return graph


def poses_over_time(
    path: Path, frame: str, parent: str, stamps_ns: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """A frame in another one that it moves in, from the transforms of a bag.

    Args:
        path: of the bag. frame, parent: names.
        stamps_ns: (N,) times.

    Returns:
        Which of these times (N,) the transforms cover, and the poses (M, 7) at those, x y z qx qy
        qz qw; None where the frames are not connected.
    """
    with open_bag(path) as bag:
        graph = _frames(bag)
    source, target = frame.lstrip('/'), parent.lstrip('/')
    if source not in graph or target not in graph or not nx.has_path(graph, source, target):
        return None
    way = nx.utils.pairwise(nx.shortest_path(graph, source, target))
    steps = [graph.edges[pair] for pair in way]
    timed = [step['edge'] for step in steps if step['moves']]
    known = np.ones(len(stamps_ns), dtype=bool)
    for edge in timed:
        known &= (stamps_ns >= edge.stamps_ns[0]) & (stamps_ns <= edge.stamps_ns[-1])
    if not known.any():
        return known, np.empty((0, 7))
    edges = [step['edge'] for step in steps]
    return known, _followed(edges, source, target, stamps_ns[known])


def _followed(edges: list[Edge], source: str, target: str, stamps: np.ndarray) -> np.ndarray:
    """Poses (N, 7) of a frame in another at these times, x y z qx qy qz qw."""
    from pytransform3d.trajectories import pqs_from_transforms
    from pytransform3d.transform_manager import (
        NumpyTimeseriesTransform,
        StaticTransform,
        TemporalTransformManager,
    )
    from pytransform3d.transformations import transform_from_pq

    frames = TemporalTransformManager()
    for edge in edges:
        # It takes the scalar of a quaternion first.
        scalar_first = edge.poses[:, [0, 1, 2, 6, 3, 4, 5]]
        if len(edge.stamps_ns) > 1:
            times_s = (edge.stamps_ns - stamps[0]) * 1e-9
            moved = NumpyTimeseriesTransform(times_s, scalar_first, time_clipping=True)
            frames.add_transform(edge.child, edge.parent, moved)
        else:
            still = StaticTransform(transform_from_pq(scalar_first[0]))
            frames.add_transform(edge.child, edge.parent, still)
    found = frames.get_transform_at_time(source, target, (stamps - stamps[0]) * 1e-9)
    return pqs_from_transforms(found)[:, [0, 1, 2, 4, 5, 6, 3]]


def _longest_s(edge: Edge, stamps: np.ndarray) -> float:
    """The longest time between two transforms around one of these times [s]."""
    after = np.clip(np.searchsorted(edge.stamps_ns, stamps), 1, len(edge.stamps_ns) - 1)
    if len(edge.stamps_ns) < 2:
        return 0.0
    return float((edge.stamps_ns[after] - edge.stamps_ns[after - 1]).max()) * 1e-9


class StaticFrames:
    """Frames that stand still to one another."""

    def __init__(self, edges: list[Edge] | None = None) -> None:
        self._graph = nx.Graph()
        for edge in edges or ():
            place = Rigid.of(edge.poses[-1])
            self._graph.add_edge(edge.parent, edge.child, child=edge.child, place=place)

    @staticmethod
    def of(path: Path) -> StaticFrames:
        """Those that a bag tells in /tf_static and in part_pose."""
        with open_bag(path) as bag:
            return StaticFrames.in_bag(bag)

    @staticmethod
    def in_bag(bag: Bag) -> StaticFrames:
        """The same of an open bag."""
        return StaticFrames(read_edges(bag, static=True))

    @property
    def places(self) -> list[tuple[str, str, Rigid]]:
        """Each frame in its parent's: (parent, child, pose)."""
        found = ((*pair, edge) for *pair, edge in self._graph.edges(data=True))
        return [
            (a if edge['child'] == b else b, edge['child'], edge['place']) for a, b, edge in found
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
