"""Tool paths as noether writes them: YAML lists of paths, of segments, of waypoints.

A waypoint has x, y, z [m] and a quaternion qw, qx, qy, qz, whose z axis points out of the surface
where that of a bell points into it. There are no speeds, and no gun: it sprays along segments.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.files.atomic import replacing
from paint_deposition.files.strict_yaml import read_yaml
from paint_deposition.motion.programmed import Move, timed
from paint_deposition.motion.trajectory import Trajectory

SUFFIXES = ('.yaml', '.yml')
SPEED_M_PER_S = 0.3
KEYS = ('x', 'y', 'z', 'qw', 'qx', 'qy', 'qz')
# From the axes of a waypoint to those of a tool, and back: half a turn about x.
FLIP = Rotation.from_quat([1.0, 0.0, 0.0, 0.0])


def is_tool_path(path: Path | str) -> bool:
    """Whether a file has the suffix of a tool path."""
    return Path(path).suffix.lower() in SUFFIXES


def read_tool_path(path: Path) -> Trajectory:
    """The motion along a tool path at SPEED_M_PER_S, straight from a segment to the next.

    Raises RecordingError where it is none, with the remedy.
    """
    segments = list(_segments(path, read_yaml(path, 'tool path', RecordingError)))
    moves = []
    for segment in segments:
        for number, (*place, qw, qx, qy, qz) in enumerate(segment):
            turn = (Rotation.from_quat([qx, qy, qz, qw]) * FLIP).as_quat()
            moves.append(Move(np.array(place), turn, SPEED_M_PER_S, number > 0))
    warning = (
        f'{path}: a tool path has no speeds; it is driven at {SPEED_M_PER_S:g} m/s. paint improve '
        'chooses speeds for it'
    )
    found = timed(moves, gun_known=True)
    return replace(found, warnings=(*found.warnings, warning))


def _segments(path: Path, node: Any) -> Iterator[list[list[float]]]:
    if not isinstance(node, list) or not node:
        raise RecordingError(
            f'{path}: is no tool path; give lists of waypoints with {", ".join(KEYS)}'
        )
    if not isinstance(node[0], dict):
        for inner in node:
            yield from _segments(path, inner)
        return
    try:
        yield [[float(waypoint[key]) for key in KEYS] for waypoint in node]
    except (KeyError, TypeError, ValueError):
        raise RecordingError(
            f'{path}: a waypoint is not {", ".join(KEYS)}, each a number'
        ) from None


def write_tool_path(path: Path, moves: Sequence[Move]) -> None:
    """Write the stretches of moves on which the gun sprays as one tool path."""
    segments: list[list[dict[str, float]]] = []
    for before, move in itertools.pairwise(moves):
        if not move.spraying:
            continue
        if not before.spraying:
            segments.append([_waypoint(before)])
        segments[-1].append(_waypoint(move))
    with replacing(path) as temporary, temporary.open('w', encoding='utf-8') as file:
        YAML(typ='safe', pure=True).dump([segments], file)


def _waypoint(move: Move) -> dict[str, float]:
    x, y, z, w = (Rotation.from_quat(move.quaternion_xyzw) * FLIP.inv()).as_quat().tolist()
    return dict(zip(KEYS, (*move.position_m.tolist(), w, x, y, z), strict=True))
