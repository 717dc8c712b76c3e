"""Planned passes as ABB RAPID modules."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from paint_deposition.errors import PlanError
from paint_deposition.files.templates import filled
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import ONLY_BRUSH

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

    Raises PlanError for speeds that no robot could run, and flows that a brush does not have.
    """
    speeds = {v: f'vPass{k}' for k, v in enumerate(sorted(set(map(_speed, moves))), start=1)}
    for speed in speeds:
        if not 0.0 < speed < 10.0:
            raise PlanError(f'speed of {speed:g} m/s: give one above 0 and below 10 m/s')
    poses = [_pose([*move.position_m, *move.quaternion_xyzw]) for move in moves]
    levels = sorted({_flow(move) for move in moves if move.spraying})
    flows = {v: f'flow{k}' for k, v in enumerate(levels, start=1)} if levels != [1.0] else {}
    brushes = sorted({move.brush for move in moves if move.spraying} - {ONLY_BRUSH})
    if paint_moves and flows:
        raise PlanError(
            'flows of single passes need brushes of their own; leave out --paint-moves'
        )
    run = [('', 'MoveJ', speeds[_speed(moves[0])], '', 'fine')]
    for number, (before, move) in enumerate(pairwise(moves), start=2):
        brush, instruction, trigger = '', 'MoveL', ''
        switches = _gun(move) != _gun(before)
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


def _gun(move: Move) -> tuple[float, int] | None:
    """Flow and brush, None where the gun is off."""
    return (_flow(move), move.brush) if move.spraying else None


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
