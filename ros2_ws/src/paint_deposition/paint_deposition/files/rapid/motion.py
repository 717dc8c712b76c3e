"""The motion that a RAPID program asks for, as a trajectory; and the program in words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from paint_deposition.files.rapid.program import RapidProgram
from paint_deposition.motion.programmed import PROGRAMMED, timed
from paint_deposition.motion.trajectory import Trajectory

SUFFIXES = ('.mod', '.prg')


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
    recorded = timed(program.moves, bool(program.gun_signal))
    gun_known = len(recorded.trigger_flow) > 0
    return replace(recorded, notes=(*program.notes, *_assumptions(program, gun_known)))


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
        gun += f', brush {m.brush}' if m.brush else ''
        lines.append(
            f'{m.line:6d}  {m.instruction:8} {x:8.4f} {y:8.4f} {z:8.4f}  {orientation}  '
            f'{m.speed_m_per_s:6.3f}  {m.zone_m:6.4f}  {gun}'
        )
    return '\n'.join([*lines, *(f'note: {note}' for note in program.notes)])


def _assumptions(program: RapidProgram, gun_known: bool) -> list[str]:
    notes = [PROGRAMMED, 'speeds are taken as programmed; acceleration is left out']
    if any(move.zone_m for move in program.moves):
        notes.append('zones are not followed: corners are sharp')
    if any('j' in move.instruction for move in program.moves[1:]):
        notes.append('joint moves are taken as straight')
    if not gun_known:
        notes.append('nothing in the program switches the gun: it is taken as spraying throughout')
    return notes
