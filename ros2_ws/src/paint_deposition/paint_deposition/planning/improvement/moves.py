"""A timed programme as moves of a robot program, each with its own speed."""

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.motion.programmed import Move
from paint_deposition.planning.improvement.limits import Limits
from paint_deposition.planning.improvement.programme import (
    STANDING_M,
    Programme,
    speed_along,
)

# Moves are straight: the path leaves them by no more than this [m]. A turn of the tool counts by
# what it does at this lever, the distance of a surface.
TOLERANCE_M, LEVER_M = 0.0005, 0.3
# A program's speeds are written in steps of this [m/s].
SPEED_STEP_M_PER_S = 1e-5
SLOWEST_M_PER_S = 1e-3
# The speed is sampled so often along an opening.
STEPS = 400


def moves_of(programme: Programme, limits: Limits) -> list[Move]:
    """Straight moves along a programme, from its first pose on.

    While the gun sprays, each move takes as long as the programme; else it has the programme's
    greatest speed on the way, so that the robot can reach the speed at which the gun opens.
    """
    ends = np.array([[o.on_m, o.off_m] for o in programme.openings])
    stops = np.concatenate([_stops(programme, k, limits) for k in range(len(ends))])
    whole = programme.with_poses_at(stops)
    clock = whole.clock_s
    rows = _rows_to_stop_at(whole, stops)
    speed = np.append(whole.speed_m_per_s, 0.0)
    moves: list[Move] = []
    for before, row in zip([rows[0], *rows[:-1]], rows, strict=True):
        length = float(np.linalg.norm(whole.positions_m[row] - whole.positions_m[before]))
        turns = _turn_rad(whole, before, row) > 1e-6
        if moves and length < STANDING_M and not turns:
            continue
        middle = 0.5 * (whole.travel_m[before] + whole.travel_m[row])
        number = int(np.searchsorted(ends[:, 0], middle, side='right')) - 1
        spraying = bool(moves) and number >= 0 and middle < ends[number, 1]
        if spraying:
            pace = length / (clock[row] - clock[before])
        else:
            pace = float(speed[before : max(row, before + 1)].max())
        pace = max(round(pace / SPEED_STEP_M_PER_S) * SPEED_STEP_M_PER_S, SLOWEST_M_PER_S)
        pose = whole.positions_m[row], whole.quaternions_xyzw[row]
        opening = programme.openings[max(number, 0)]
        flow = opening.flow if spraying else 1.0
        moves.append(Move(*pose, pace, spraying, flow=flow, brush=opening.brush))
    return moves


def _stops(programme: Programme, number: int, limits: Limits) -> np.ndarray:
    """Where moves begin and end in an opening: not too close in length, nor in time."""
    opening = programme.openings[number]
    places = np.linspace(opening.on_m, opening.off_m, STEPS + 1)
    speed = speed_along(programme, places)
    least = np.maximum(limits.move_min_m, speed / limits.settings_per_s)
    moves = np.concatenate([[0.0], np.cumsum(np.diff(places) / least)])
    return np.interp(np.linspace(0.0, moves[-1], max(2, int(moves[-1]) + 1)), moves, places)


def _rows_to_stop_at(whole: Programme, stops_m: np.ndarray) -> np.ndarray:
    """Poses at the stops, and those without which straight moves would leave the path."""
    wanted = np.zeros(len(whole.travel_m), dtype=bool)
    wanted[[0, -1]] = True
    nearest = np.searchsorted(whole.travel_m, stops_m - STANDING_M)
    wanted[np.minimum(nearest, len(wanted) - 1)] = True
    axes = Rotation.from_quat(whole.quaternions_xyzw).as_matrix()
    followed = np.concatenate(
        [whole.positions_m, LEVER_M * axes[:, :, 0], LEVER_M * axes[:, :, 2]], axis=1
    )
    anchors = np.flatnonzero(wanted)
    spans = list(zip(anchors[:-1].tolist(), anchors[1:].tolist(), strict=True))
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        between = followed[first + 1 : last]
        off = _distances(between, followed[first], followed[last])
        if off.max() > TOLERANCE_M:
            middle = first + 1 + int(off.argmax())
            wanted[middle] = True
            spans += [(first, middle), (middle, last)]
    return np.flatnonzero(wanted)


def _distances(points: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(N,) distances of points (N, D) from a line segment."""
    way = end - begin
    square = float(way @ way)
    share = np.clip((points - begin) @ way / square, 0.0, 1.0) if square > 0.0 else 0.0
    return np.linalg.norm(points - begin - np.multiply.outer(share, way), axis=-1)


def _turn_rad(programme: Programme, before: int, row: int) -> float:
    turns = Rotation.from_quat(programme.quaternions_xyzw[[before, row]])
    return float((turns[0].inv() * turns[1]).magnitude())
