"""The moves of a RAPID program, brought into one frame and to one tool."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.functions import Frame, inverse, product
from paint_deposition.motion.programmed import Move


@dataclass(frozen=True, kw_only=True)
class RapidMove(Move):
    """A move of the TCP as programmed; on the robot, zones cut its corners.

    The pose is in the world frame, or in ``frame``: that of the work object if the modules do not
    define it, or of the mechanical unit that moves it.
    """

    instruction: str  # in lower case
    zone_m: float  # radius in which the corner is cut, 0: stop
    tool: str
    work_object: str
    frame: str = ''  # '' for the world


@dataclass
class RapidProgram:
    """The moves in order, and notes on everything left out or assumed, one line each."""

    module: str
    gun_signal: str = ''  # the digital output that opens the gun
    moves: list[RapidMove] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Note something once."""
        if text not in self.notes:
            self.notes.append(text)


def with_one_frame(program: RapidProgram, source: str) -> None:
    """Leave out moves with the gun closed in another frame than that of the paint.

    Raises RecordingError if the gun sprays in two frames whose relation is not known.
    """
    painted = painting_moves(program)
    names = {move.frame: move.line for move in reversed(painted)}
    if len(names) > 1:
        lines = ' and '.join(
            f'line {line} in that of {name or "the world"}' for name, line in sorted(names.items())
        )
        raise RecordingError(
            f'{source}: it sprays in frames whose relation is not known: {lines}; declare the '
            'work objects, or give the programs of the parts one by one'
        )
    kept = [move for move in program.moves if move.frame in names]
    if left_out := [str(m.line) for m in program.moves if m.frame not in names]:
        program.note(
            f'moves of lines {", ".join(left_out)} are left out: their frame is another than that '
            'of the paint, and the gun is closed'
        )
    program.moves[:] = kept


def with_one_tool(program: RapidProgram, tools: Mapping[str, Frame | None], source: str) -> None:
    """Bring all moves to the tool of the paint, by the frames of the ``tools`` [mm].

    Raises RecordingError if the gun sprays with two tools that differ.
    """
    painted = painting_moves(program)
    bell = painted[0].tool
    for number, move in enumerate(program.moves):
        if move.tool == bell:
            continue
        own, wanted = tools[move.tool], tools[bell]
        step = product(inverse(own), wanted) if own and wanted else None
        if step and np.allclose(step[0], 0.0, atol=1e-3) and step[1].magnitude() < 1e-5:
            continue
        if any(move is one for one in painted):
            raise RecordingError(
                f'{source} line {move.line}: it sprays with {move.tool} and with {bell}; only one '
                'of them can be the bell, give a program for each'
            )
        if step is None:
            program.note(
                f'the frame of tool {bell} or {move.tool} is not in the modules: the moves of '
                f'{move.tool}, with the gun closed, are taken as those of {bell}'
            )
            continue
        at = (move.position_m * 1e3, Rotation.from_quat(move.quaternion_xyzw))
        position, rotation = product(at, step)
        program.moves[number] = replace(
            move, position_m=position * 1e-3, quaternion_xyzw=rotation.as_quat()
        )


def painting_moves(program: RapidProgram) -> list[RapidMove]:
    """The moves that spray; all, where nothing switches the gun."""
    spraying = [m for m in program.moves if m.spraying or any(s.on for s in m.switches)]
    return spraying or program.moves
