"""The motion that a RAPID program asks for, as a trajectory; and the program in words."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.program import RapidMove, RapidProgram
from paint_deposition.motion.trajectory import Trajectory

SUFFIXES = ('.mod', '.prg')
POSE_PERIOD_S = 0.02
# No move of a paint cell takes longer; one that does has a wrong number in it.
LONGEST_MOVE_S = 3600.0
# What ABB's predefined speeds allow the tool to turn, for moves that only turn it.
REORIENTATION_RAD_PER_S = math.radians(500.0)


def is_rapid(path: Path | str) -> bool:
    """Whether a file is named as a RAPID module."""
    return Path(path).suffix.lower() in SUFFIXES


def program_trajectory(program: RapidProgram) -> Trajectory:
    """Poses along a program, from the end of its first move on, at the programmed speeds.

    Joint moves are taken as straight, zones and acceleration are not: what that leaves out is in
    the trajectory's notes. A program that never switches the gun sprays throughout.

    Raises:
        RecordingError: there is no second move, or one without a speed.
    """
    if len(program.moves) < 2:
        raise RecordingError(f'{program.module} has a single move; give a program that travels')
    first = program.moves[0]
    times_s, positions, quaternions = [0.0], [first.position_m], [first.quaternion_xyzw]
    changes: list[tuple[float, bool]] = []
    for before, move in pairwise(program.moves):
        if not move.speed_m_per_s > 0.0:
            raise RecordingError(f'line {move.line}: speed {move.speed_m_per_s:g} m/s; give one')
        turn = Rotation.from_quat([before.quaternion_xyzw, move.quaternion_xyzw])
        length_m, place_at = _track(before.position_m, move)
        angle_rad = (turn[0].inv() * turn[1]).magnitude()
        duration_s = max(length_m / move.speed_m_per_s, angle_rad / REORIENTATION_RAD_PER_S)
        if duration_s > LONGEST_MOVE_S:
            raise RecordingError(
                f'line {move.line}: a move of {length_m:g} m at {move.speed_m_per_s:g} m/s takes '
                f'{duration_s / 3600.0:.3g} h; check its target and speed'
            )
        changes.append((times_s[-1], move.spraying))
        changes += [(times_s[-1] + at * duration_s, on) for at, on in _switches(move, length_m)]
        count = math.ceil(duration_s / POSE_PERIOD_S)
        share = np.arange(1, count + 1) / max(count, 1)
        positions += list(place_at(share))
        quaternions += list(Slerp([0.0, 1.0], turn)(share).as_quat()) if count else []
        times_s += (times_s[-1] + share * duration_s).tolist()
    flow = {}
    if program.gun_signal or any(on for _, on in changes):
        flow = {round(time_s * 1e9): float(on) for time_s, on in changes}
    return Trajectory(
        np.array([round(time_s * 1e9) for time_s in times_s]),
        np.array(positions),
        np.array(quaternions),
        trigger_stamps_ns=np.array(sorted(flow), dtype=np.int64),
        trigger_flow=np.array([flow[stamp] for stamp in sorted(flow)]),
        notes=(*program.notes, *_assumptions(program, bool(flow))),
    )


def program_as_text(program: RapidProgram) -> str:
    """A line for the program, one a move, one a note."""
    moves = program.moves
    speeds = sorted({f'{move.speed_m_per_s:g}' for move in moves})
    lines = [
        f'module {program.module}: {len(moves)} moves at {" ".join(speeds)} m/s, '
        f'tool {" ".join(sorted({move.tool for move in moves}))}, '
        f'work object {" ".join(sorted({move.work_object for move in moves}))}, '
        f'gun {program.gun_signal or "not switched by an output"}',
        f'{"line":>6}  {"move":8} {"x_m":>8} {"y_m":>8} {"z_m":>8}  {"quaternion x y z w":31}'
        f'  {"m/s":>6}  {"zone_m":>6}  gun',
    ]
    for m in moves:
        x, y, z = m.position_m
        orientation = ' '.join(f'{value:+.4f}' for value in m.quaternion_xyzw)
        gun = ', '.join(['on' if m.spraying else 'off', *map(str, m.switches)])
        lines.append(
            f'{m.line:6d}  {m.instruction:8} {x:8.4f} {y:8.4f} {z:8.4f}  {orientation}  '
            f'{m.speed_m_per_s:6.3f}  {m.zone_m:6.4f}  {gun}'
        )
    return '\n'.join([*lines, *(f'note: {note}' for note in program.notes)])


def _assumptions(program: RapidProgram, gun_known: bool) -> list[str]:
    notes = ['speeds are taken as programmed; acceleration is left out']
    if any(move.zone_m for move in program.moves):
        notes.append('zones are not followed: corners are sharp')
    if any('j' in move.instruction for move in program.moves[1:]):
        notes.append('joint moves are taken as straight')
    if not gun_known:
        notes.append('nothing in the program switches the gun: it is taken as spraying throughout')
    return notes


def _switches(move: RapidMove, length_m: float) -> list[tuple[float, bool]]:
    """Share of the move at which the gun is switched, and whether on, in order."""
    switches = []
    for switch in move.switches:
        from_start_m = switch.distance_m if switch.from_start else length_m - switch.distance_m
        share = from_start_m / length_m if length_m > 0.0 else 0.0
        switches.append((min(max(share, 0.0), 1.0), switch.on))
    return sorted(switches, key=lambda switch: switch[0])


def _track(begin_m: np.ndarray, move: RapidMove) -> tuple[float, Callable]:
    """Length of a move [m], and a function from shares (N,) of it to places (N, 3) [m].

    A circular move is straight where begin, middle and end lie on a line.
    """
    to_end = move.position_m - begin_m
    to_via = np.zeros(3) if move.via_m is None else move.via_m - begin_m
    normal = np.cross(to_via, to_end)
    square = normal @ normal
    if square <= 1e-12 * (to_via @ to_via) * (to_end @ to_end):
        return float(np.linalg.norm(to_end)), lambda share: begin_m + np.outer(share, to_end)
    to_centre = np.cross(normal, to_via) * (to_end @ to_end)
    to_centre = (to_centre + np.cross(to_end, normal) * (to_via @ to_via)) / (2.0 * square)
    centre, radius = begin_m + to_centre, -to_centre
    along = np.cross(normal, radius) / math.sqrt(square)
    end = to_end - to_centre
    angle_rad = math.atan2(end @ along, end @ radius) % (2.0 * math.pi)
    return (
        float(np.linalg.norm(radius)) * angle_rad,
        lambda share: (
            centre
            + np.outer(np.cos(share * angle_rad), radius)
            + np.outer(np.sin(share * angle_rad), along)
        ),
    )
