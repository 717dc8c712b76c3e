"""ABB RAPID programs: read as moves of the TCP, as a trajectory, as text, and written."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from paint_deposition.errors import PaintError, RecordingError, quoted
from paint_deposition.files.atomic import MOST_TEXT_MB, filled, read_file
from paint_deposition.files.rapid.interpreter import RapidProgram
from paint_deposition.files.rapid.painting import Painting
from paint_deposition.files.rapid.parser import Module, Routine, parse_modules
from paint_deposition.motion.programmed import PROGRAMMED, Move, timed
from paint_deposition.motion.trajectory import ONLY_BRUSH, Trajectory
from paint_deposition.motion.transforms import Rigid

MODULES = ('.mod', '.prg', '.sys')
LIST_OF_MODULES = '.pgf'


def read_program(
    path: Path | str, gun_signal: str | None = None, procedure: str | None = None
) -> RapidProgram:
    """Run a RAPID program, and read its moves.

    Args:
        path: a module (.mod, .prg, .sys), a folder of the modules of a program, or the list that
            the controller writes of them (.pgf).
        gun_signal: the digital output that opens the gun; None: the only one set, or SetBrush
            where there are paint moves.
        procedure: where it starts; None: `main`, or the only procedure.

    Raises:
        RecordingError: what is no RAPID, what depends on values that only the robot knows, and
            every instruction that may act and is not understood; with file, line and remedy.
    """
    path = Path(path)
    files = [path]
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in MODULES)
    elif path.suffix.lower() == LIST_OF_MODULES:
        names = re.findall(r'<Module>\s*(.*?)\s*</Module>', _text(path), re.IGNORECASE)
        if not names:
            raise RecordingError(f'{path} lists no modules; give the folder of the modules')
        if odd := [name for name in names if not name or name != Path(name).name]:
            raise RecordingError(
                f'{path} lists the module {quoted(odd[0])}; name modules that lie beside it'
            )
        files = [path.with_name(name) for name in names]
    try:
        modules = [m for file in files for m in parse_modules(_text(file), str(file))]
        start = _start(modules, procedure, path)
        painting = Painting(modules, start, gun_signal)
        painting.run(start)
        if not painting.program.moves:
            raise RecordingError(f'{path} has no moves of the TCP; nothing to read')
        _keep_moves_of_the_paint(painting.program, str(path))
    except RecursionError:
        raise RecordingError(f'{path}: its values are nested too deeply to be RAPID') from None
    return painting.program


def is_rapid(path: Path | str) -> bool:
    """Whether a path is that of RAPID modules: by its suffix, or a folder of them."""
    path = Path(path)
    if path.is_dir():
        return any(file.suffix.lower() in MODULES for file in path.iterdir())
    return path.suffix.lower() in (*MODULES, LIST_OF_MODULES)


def _text(file: Path) -> str:
    try:
        content = read_file(file, RecordingError, MOST_TEXT_MB)
        try:
            return content.decode('utf-8')
        except UnicodeDecodeError:  # as older controllers write modules; any bytes are such a text
            return content.decode('latin-1')
    except OSError as error:
        raise RecordingError(f'cannot read {file}: {error.strerror}') from None


def _start(modules: list[Module], procedure: str | None, path: Path) -> Routine:
    routines = {
        item.name: item
        for module in modules for item in (*module.shared, *module.local)
        if isinstance(item, Routine) and item.is_procedure
    }  # fmt: skip
    only = next(iter(routines)) if len(routines) == 1 else 'main'
    start = procedure.lower() if procedure else only
    if start not in routines:
        words = ' '.join(routines) or 'none'
        raise RecordingError(f'{path} has no procedure {start}; its procedures: {words}')
    return routines[start]


def _keep_moves_of_the_paint(program: RapidProgram, source: str) -> None:
    """Leave out moves with the gun closed in another frame, or with another tool, than the paint.

    Raises RecordingError if the gun sprays in two frames, or with two tools: what one is in the
    other is not known, or only one of them can be the bell.
    """
    spraying = [m for m in program.moves if m.spraying or any(s.on for s in m.switches)]
    painted = spraying or program.moves  # all, where nothing switches the gun
    names = {move.frame: move.line for move in reversed(painted)}
    if len(names) > 1:
        lines = ' and '.join(
            f'line {line} in that of {name or "the world"}' for name, line in sorted(names.items())
        )
        raise RecordingError(
            f'{source}: it sprays in frames whose relation is not known: {lines}; declare the '
            'work objects, or give the programs of the parts one by one'
        )
    bell = painted[0].tool
    if other := next((move for move in painted if move.tool != bell), None):
        raise RecordingError(
            f'{source} line {other.line}: it sprays with {other.tool} and with {bell}; only one '
            'of them can be the bell, give a program for each'
        )
    kept = [move for move in program.moves if move.frame in names and move.tool == bell]
    if left_out := [str(m.line) for m in program.moves if m.frame not in names or m.tool != bell]:
        program.note(
            f'moves of lines {", ".join(left_out)} are left out: their frame or tool is another '
            'than that of the paint, and the gun is closed'
        )
    program.moves[:] = kept


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


TEMPLATE = Path(__file__).parent / 'templates' / 'passes.mod.j2'


def module_text(
    moves: Sequence[Move],
    comments: Sequence[str] = (),
    part: Rigid | None = None,
    paint_moves: bool = False,
) -> str:
    """A module whose `main` runs the moves: poses in the work object, the gun by TriggL.

    Tool and work object are taught on the robot; ``part``, its pose in the robot's world, defines
    the work object too. The approach is a joint move, gun off. Flows of their own set the analogue
    output aoFlow as the gun opens, brushes with a number the group output goBrush. With
    ``paint_moves`` it sprays by PaintL with SetBrush: the only brush is number 1 then, and 0
    closes the gun. `read_program` reads it back within 0.001 mm.

    Raises PaintError for speeds that no robot could run, and flows that a brush does not have.
    """
    speeds = {v: f'vPass{k}' for k, v in enumerate(sorted(set(map(_speed, moves))), start=1)}
    for speed in speeds:
        if not 0.0 < speed < 10.0:
            raise PaintError(f'speed of {speed:g} m/s: give one above 0 and below 10 m/s')
    poses = [_pose([*move.position_m, *move.quaternion_xyzw]) for move in moves]
    levels = sorted({_flow(move) for move in moves if move.spraying})
    flows = {v: f'flow{k}' for k, v in enumerate(levels, start=1)} if levels != [1.0] else {}
    brushes = sorted({move.brush for move in moves if move.spraying} - {ONLY_BRUSH})
    if paint_moves and flows:
        raise PaintError(
            'flows of single passes need brushes of their own; leave out --paint-moves'
        )
    run = [('', 'MoveJ', speeds[_speed(moves[0])], '', 'fine')]
    # Flow and brush, None where the gun is off.
    guns = [(_flow(move), move.brush) if move.spraying else None for move in moves]
    for number, move in enumerate(moves[1:], start=2):
        brush, instruction, trigger = '', 'MoveL', ''
        switches = guns[number - 1] != guns[number - 2]
        if paint_moves:
            instruction = 'PaintL' if move.spraying else 'MoveL'
            brush = f'SetBrush {(move.brush or 1) * move.spraying};' if switches else ''
        elif switches:
            instruction, trigger = 'TriggL', 'gunOff,'
            if move.spraying:
                also = [flows[_flow(move)]] if flows else []
                also += [f'brush{move.brush}'] if move.brush else []
                events = ''.join(f'\\T{k}:={name}' for k, name in enumerate(also, start=2))
                trigger = f'gunOn{events},'
        zone = 'fine' if number == len(moves) else 'z10'
        run.append((brush, instruction, speeds[_speed(move)], trigger, zone))
    outputs = {name: f'AOp:=aoFlow,{flow:.4f}' for flow, name in flows.items()}
    outputs |= {f'brush{number}': f'GOp:=goBrush,{number}' for number in brushes}
    at = _pose(part.values) if part else ''
    return filled(
        TEMPLATE, comments=comments, part=at, poses=poses, speeds=speeds, outputs=outputs,
        moves=run, off='SetBrush 0' if paint_moves else 'SetDO doGun,0',
        triggers=[] if paint_moves else ['gunOn', 'gunOff', *outputs],
    )  # fmt: skip


def _speed(move: Move) -> float:
    return round(float(move.speed_m_per_s), 6)


def _flow(move: Move) -> float:
    return round(float(move.flow), 4)


def _pose(values: Sequence[float]) -> str:
    """A pose as RAPID has it: millimetres, and the scalar of the quaternion first."""
    x, y, z, w = values[3:]
    position = ','.join(f'{value * 1e3 + 0.0:.3f}' for value in values[:3])
    orientation = ','.join(f'{value + 0.0:.7f}' for value in (w, x, y, z))
    return f'[[{position}],[{orientation}]]'
