"""ABB RAPID programs: read as moves of the TCP, as a trajectory, and as text."""

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from paint_deposition.errors import RecordingError
from paint_deposition.files.atomic import MOST_TEXT_MB, read_file
from paint_deposition.files.rapid.moves import RapidProgram, with_one_frame, with_one_tool
from paint_deposition.files.rapid.painting import Painting
from paint_deposition.files.rapid.parser import Module, Routine, parse_modules
from paint_deposition.motion.programmed import PROGRAMMED, timed
from paint_deposition.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from paint_deposition.files.recordings.joint_states import Robot

MODULES = ('.mod', '.prg', '.sys')
LIST_OF_MODULES = '.pgf'


def read_program(
    path: Path | str,
    gun_signal: str | None = None,
    procedure: str | None = None,
    robot: 'Robot | None' = None,
) -> RapidProgram:
    """Run a RAPID program, and read its moves.

    Args:
        path: a module (.mod, .prg, .sys), a folder of the modules of a program, or the list that
            the controller writes of them (.pgf).
        gun_signal: the digital output that opens the gun; None: the only one set, or SetBrush
            where there are paint moves.
        procedure: where it starts; None: `main`, or the only procedure.
        robot: gives the TCP for joint angles; without it such moves are left out, and refused
            with the gun open.

    Raises:
        RecordingError: what is no RAPID, what depends on values that only the robot knows, and
            every instruction that may act and is not understood; with file, line and remedy.
    """
    path = Path(path)
    try:
        modules = [m for file in _files(path) for m in parse_modules(_text(file), str(file))]
        start = _start(modules, procedure, path)
        painting = Painting(modules, start, gun_signal, robot)
        painting.run(start)
        program = painting.program
        if not program.moves:
            raise RecordingError(f'{path} has no moves of the TCP; nothing to read')
        with_one_frame(program, str(path))
        with_one_tool(program, painting.tools, str(path))
    except RecursionError:
        raise RecordingError(f'{path}: its values are nested too deeply to be RAPID') from None
    return program


def is_rapid(path: Path | str) -> bool:
    """Whether a path is that of RAPID modules: by its suffix, or a folder of them."""
    path = Path(path)
    if path.is_dir():
        return any(file.suffix.lower() in MODULES for file in path.iterdir())
    return path.suffix.lower() in (*MODULES, LIST_OF_MODULES)


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        return sorted(file for file in path.iterdir() if file.suffix.lower() in MODULES)
    if path.suffix.lower() != LIST_OF_MODULES:
        return [path]
    names = re.findall(r'<Module>\s*(.*?)\s*</Module>', _text(path), re.IGNORECASE)
    if not names:
        raise RecordingError(f'{path} lists no modules; give the folder of the modules')
    return [path.with_name(name) for name in names]


def _text(file: Path) -> str:
    try:
        content = read_file(file, RecordingError, MOST_TEXT_MB)
        return content.decode('utf-8', errors='replace')
    except OSError as error:
        raise RecordingError(f'cannot read {file}: {error.strerror}') from None


def _start(modules: list[Module], procedure: str | None, path: Path) -> Routine:
    routines = {
        item.name: item
        for module in modules for item in (*module.shared, *module.local)
        if isinstance(item, Routine)
    }  # fmt: skip
    only = next(iter(routines)) if len(routines) == 1 else 'main'
    start = procedure.lower() if procedure else only
    if start not in routines:
        words = ' '.join(routines) or 'none'
        raise RecordingError(f'{path} has no procedure {start}; its procedures: {words}')
    return routines[start]


def program_trajectory(program: RapidProgram) -> Trajectory:
    """Poses along a program, from the end of its first move on, at the programmed speeds.

    The notes list the assumptions. A program that never switches the gun sprays throughout.
    """
    paints = any(move.instruction.startswith('paint') for move in program.moves)
    recorded = timed(program.moves, paints or bool(program.gun_signal))
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
