"""ABB RAPID programs: read as moves of the TCP, as a trajectory, and as text."""

from dataclasses import replace
from pathlib import Path

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.interpreter import Interpreter, RapidProgram
from paint_deposition.files.rapid.parser import ModuleParser
from paint_deposition.motion.programmed import PROGRAMMED, timed
from paint_deposition.motion.trajectory import Trajectory

SUFFIXES = ('.mod', '.prg')


def read_program(path: Path | str, gun_signal: str | None = None) -> RapidProgram:
    """Read the moves of a RAPID module (.mod, .prg).

    The program starts in `main`, or in the only procedure; procedure calls must have no
    arguments. ``gun_signal`` is the digital output that opens the gun; None: the only one set.

    Raises:
        RecordingError: a syntax error, a move inside a loop or condition, a value from outside the
            module, a quaternion more than 1 % off; with file, line and remedy.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding='utf-8', errors='replace')
    except OSError as error:
        raise RecordingError(f'cannot read {path}: {error.strerror}') from None
    try:
        module = ModuleParser(text, str(path)).module()
        return Interpreter(module, str(path), gun_signal).run()
    except RecursionError:
        raise RecordingError(f'{path}: its values are nested too deeply to be RAPID') from None


def is_rapid(path: Path | str) -> bool:
    """Whether a file has the suffix of a RAPID module."""
    return Path(path).suffix.lower() in SUFFIXES


def program_trajectory(program: RapidProgram) -> Trajectory:
    """Poses along a program, from the end of its first move on, at the programmed speeds.

    The notes list the assumptions. A program that never switches the gun sprays throughout.
    """
    recorded = timed(program.moves, bool(program.gun_signal))
    notes = [PROGRAMMED, 'speeds are taken as programmed; acceleration is left out']
    if any(move.zone_m for move in program.moves):
        notes.append('zones are not followed: corners are sharp')
    if any('j' in move.instruction for move in program.moves[1:]):
        notes.append('joint moves are taken as straight')
    if not len(recorded.trigger_flow):
        notes.append('nothing in the program switches the gun: it is taken as spraying throughout')
    return replace(recorded, notes=(*program.notes, *notes))


def program_as_text(program: RapidProgram) -> str:
    """The program as text: a heading, then one line per move and per note."""
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
