"""Planned passes as an ABB RAPID module."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from paint_deposition.errors import PlanError
from paint_deposition.files.rapid.data import QUATERNION_TOLERANCE
from paint_deposition.planning.pass_motion import PlannedMove

NAME = re.compile(r'[A-Za-z]\w{0,31}')
ZONES_MM = (0, 1, 5, 10, 15, 20, 30, 40, 50, 60, 80, 100, 150, 200)
NO_AXES = '[9E9,9E9,9E9,9E9,9E9,9E9]'


def module_text(
    moves: Sequence[PlannedMove],
    name: str = 'PaintPasses',
    tool: str = 'tBell',
    work_object: str = 'wobjPart',
    gun_signal: str = 'doGun',
    zone_mm: int = 10,
) -> str:
    """A module whose `main` runs the moves: poses in the work object, the gun by TriggL.

    The tool and the work object are taught on the robot and not defined here: the module's poses
    are those of the tool's TCP in the part's frame. It approaches with a joint move and ends with
    the gun off. `read_program` reads it back within 0.001 mm.

    Raises PlanError for moves or names that no robot could run.
    """
    _refuse_bad_names(name, tool, work_object, gun_signal)
    if zone_mm not in ZONES_MM:
        raise PlanError(f'zone of {zone_mm} mm: choose one of {", ".join(map(str, ZONES_MM))}')
    if not moves or moves[0].spraying:
        raise PlanError('a program begins with an approach, gun off; plan at least one')
    speeds = {speed: f'vPass{k + 1}' for k, speed in enumerate(_speeds(moves))}
    targets = [_target(number, move) for number, move in enumerate(moves)]
    frames = f'{tool}\\WObj:={work_object}'
    lines = [
        f'MODULE {name}',
        f'  ! Poses of the TCP of {tool} in {work_object}, both taught on the robot.',
        f'  ! {gun_signal} opens the gun. Millimetres, mm/s; axis configurations are free.',
        *(f'  CONST robtarget p{k + 1}:={target};' for k, target in enumerate(targets)),
        *(
            f'  CONST speeddata {v}:=[{_number(s * 1e3)},500,5000,1000];'
            for s, v in speeds.items()
        ),
        '  VAR triggdata gunOn;',
        '  VAR triggdata gunOff;',
        '',
        '  PROC main()',
        r'    ConfJ\Off;',
        r'    ConfL\Off;',
        rf'    TriggIO gunOn,0\Start\DOp:={gun_signal},1;',
        rf'    TriggIO gunOff,0\Start\DOp:={gun_signal},0;',
        f'    SetDO {gun_signal},0;',
    ]
    spraying = False
    for number, move in enumerate(moves):
        target, speed = f'p{number + 1}', speeds[_speed(move)]
        last = number == len(moves) - 1
        zone = 'fine' if last or number == 0 else f'z{zone_mm}'
        if number == 0:
            lines.append(f'    MoveJ {target},{speed},{zone},{frames};')
        elif move.spraying != spraying:
            trigger = 'gunOn' if move.spraying else 'gunOff'
            lines.append(f'    TriggL {target},{speed},{trigger},{zone},{frames};')
        else:
            lines.append(f'    MoveL {target},{speed},{zone},{frames};')
        spraying = move.spraying
    return '\n'.join([*lines, f'    SetDO {gun_signal},0;', '  ENDPROC', 'ENDMODULE', ''])


def _refuse_bad_names(*names: str) -> None:
    for name in names:
        if not NAME.fullmatch(name):
            raise PlanError(
                f'{name!r} is no RAPID name: a letter, then letters, digits or _, 32 at most'
            )


def _speed(move: PlannedMove) -> float:
    return round(float(move.speed_m_per_s), 6)


def _speeds(moves: Sequence[PlannedMove]) -> list[float]:
    speeds = sorted({_speed(move) for move in moves})
    for speed in speeds:
        if not 0.0 < speed < 10.0:
            raise PlanError(f'speed of {speed:g} m/s: give one above 0 and below 10 m/s')
    return speeds


def _target(number: int, move: PlannedMove) -> str:
    position_mm = np.asarray(move.position_m, dtype=float) * 1e3
    quaternion = np.asarray(move.quaternion_xyzw, dtype=float)
    norm = float(np.linalg.norm(quaternion))
    if not (np.isfinite(position_mm).all() and abs(norm - 1.0) <= QUATERNION_TOLERANCE):
        raise PlanError(f'move {number + 1} is no pose: {position_mm} mm, quaternion {quaternion}')
    x, y, z, w = quaternion / norm
    position = ','.join(_number(value) for value in position_mm)
    orientation = ','.join(f'{value:.7f}' for value in (w, x, y, z))
    return f'[[{position}],[{orientation}],[0,0,0,0],{NO_AXES}]'


def _number(value: float) -> str:
    return f'{value + 0.0:.3f}'
