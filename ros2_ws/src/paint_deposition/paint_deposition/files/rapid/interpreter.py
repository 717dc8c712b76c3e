"""Interpreting a RAPID module: its moves of the TCP, with the gun's switching."""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.data import RapidData
from paint_deposition.files.rapid.parser import Instruction, Module, Reference
from paint_deposition.model.brush import MOST
from paint_deposition.motion.programmed import GunSwitch, Move
from paint_deposition.motion.trigger import ONLY_BRUSH

# Instruction -> number of its targets; the last is where it ends.
MOVES = {
    'movel': 1, 'movej': 1, 'movec': 2, 'paintl': 1, 'paintc': 2, 'triggl': 1, 'triggj': 1,
    'triggc': 2, 'moveldo': 1, 'movejdo': 1, 'movecdo': 2,
}  # fmt: skip
JOINT_MOVES = ('moveabsj', 'moveextj')
TRIGGERS = ('triggio', 'triggequip')
# Outputs that `writer` uses: an analogue one for the relative flow, a group output for the brush.
FLOW_SIGNAL, BRUSH_SIGNAL = 'aoflow', 'gobrush'


@dataclass(frozen=True, kw_only=True)
class RapidMove(Move):
    """A move of the TCP as programmed; on the robot, zones cut its corners.

    The pose is in the world frame, or in that of the work object if the module does not define it.
    """

    instruction: str  # in lower case
    zone_m: float  # radius in which the corner is cut, 0: stop
    tool: str
    work_object: str


@dataclass
class RapidProgram:
    """The moves in order, and notes on everything left out or assumed, one line each."""

    module: str
    gun_signal: str = ''  # the digital output that opens the gun
    moves: list[RapidMove] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


class Interpreter:
    """Runs a module from its first procedure on, and collects the moves of a `RapidProgram`."""

    def __init__(self, module: Module, source: str, gun_signal: str | None) -> None:
        self._module = module
        self._source = source
        self._data = RapidData(module, source)
        self._program = RapidProgram(module.name, self._gun_signal(gun_signal))
        self._gun_on = False
        # None: no brush selected yet.
        self._brush: int | None = None
        self._triggers: dict[str, GunSwitch] = {}
        self._flow = 1.0
        self._flow_triggers: dict[str, float] = {}
        self._brush_triggers: dict[str, int] = {}
        self._position_m: np.ndarray | None = None
        self._calls: list[str] = []

    def run(self) -> RapidProgram:
        names = list(self._module.procedures)
        first = names[0] if len(names) == 1 else 'main'
        if first not in names:
            found = ' '.join(names) or 'none'
            raise RecordingError(f'{self._source} has no procedure main; its procedures: {found}')
        self._run_procedure(first)
        if not self._program.moves:
            raise RecordingError(f'{self._source} has no moves of the TCP; nothing to read')
        return self._program

    def _gun_signal(self, given: str | None) -> str:
        bodies = self._module.procedures.values()
        signals = sorted({_signal_of(i) for body in bodies for i in body} - {''})
        if given is None and len(signals) > 1:
            raise RecordingError(
                f'{self._source} sets {" ".join(signals)}; say which of them opens the gun'
            )
        if given is not None and given.lower() not in signals:
            raise RecordingError(
                f'{self._source} never sets {given}; it sets: {" ".join(signals) or "none"}'
            )
        return given.lower() if given else ''.join(signals)

    def _note(self, text: str) -> None:
        if text not in self._program.notes:
            self._program.notes.append(text)

    # --- instructions

    def _run_procedure(self, procedure: str) -> None:
        if procedure in self._calls:
            raise RecordingError(f'{self._source}: procedure {procedure} calls itself')
        self._calls.append(procedure)
        for instruction in self._module.procedures[procedure]:
            self._execute(instruction)
        self._calls.pop()

    def _execute(self, i: Instruction) -> None:
        self._data.line = i.line
        matters = i.name in MOVES or i.name in self._module.procedures or self._is_gun(i)
        if i.block and matters:
            self._data.fail(f'{i.name} inside {i.block.upper()} is not followed; unroll it')
        if i.name in MOVES:
            self._move(i)
        elif i.name in JOINT_MOVES:
            self._note(f'line {i.line}: {i.name} skipped: joint angles need the robot')
            self._position_m = None
        elif i.name in self._module.procedures:
            self._run_procedure(i.name)
        elif i.name == ':=' and not i.block:
            target, value = i.values
            self._data.assign(target, self._data.value(value))
        elif i.name == 'setbrush':
            self._brush = self._brush_number(i, 0)
            if i.options:
                self._note(
                    f'line {i.line}: the plane of SetBrush is not followed: the brush changes '
                    'where the next move begins'
                )
        elif i.name in TRIGGERS and i.values:
            self._declare_trigger(i, _name(i.values[0]))
        elif self._is_gun(i):
            self._gun_on = self._output_level(i)
        elif i.name == 'setao' and i.values and _name(i.values[0]) == FLOW_SIGNAL:
            self._flow = self._number(i, 1)
        elif i.name == 'setgo' and i.values and _name(i.values[0]) == BRUSH_SIGNAL:
            self._brush = self._brush_number(i, 1)

    def _declare_trigger(self, i: Instruction, name: str) -> None:
        """Declare a trigger of the gun, the flow or the brush; others are ignored."""
        if self._is_gun(i):
            if i.options.get('time'):
                self._data.fail(f'{i.name} by time is not followed; give a distance')
            from_start = 'start' in i.options
            switch = GunSwitch(self._number(i, 1) * 1e-3, from_start, self._output_level(i))
            self._triggers[name] = switch
        elif _name(i.options.get('aop', '')) == FLOW_SIGNAL:
            self._flow_triggers[name] = self._number(i, len(i.values) - 1)
        elif _name(i.options.get('gop', '')) == BRUSH_SIGNAL:
            self._brush_triggers[name] = self._brush_number(i, len(i.values) - 1)

    def _brush_number(self, i: Instruction, index: int) -> int:
        number = self._number(i, index)
        if not (0 <= number <= MOST and number == round(number)):
            self._data.fail(f'{i.name} takes the number of a brush, not {number:g}')
        return int(number)

    def _is_gun(self, i: Instruction) -> bool:
        return _signal_of(i) == self._program.gun_signal != ''

    def _number(self, i: Instruction, index: int) -> float:
        """The value of an argument that must be a number."""
        if len(i.values) <= index:
            self._data.fail(f'{i.name} needs a number as argument {index + 1}')
        return self._data.number(i.values[index], f'what {i.name} takes')

    def _output_level(self, i: Instruction) -> bool:
        if i.name in ('set', 'reset'):
            return i.name == 'set'
        return bool(self._data.value(i.values[-1]))

    # --- moves

    def _move(self, i: Instruction) -> None:
        count = MOVES[i.name]
        own_signal = i.name.endswith('do')
        values = i.values[:-2] if own_signal else i.values
        if len(values) < count + 3:
            self._data.fail(f'{i.name} needs a target, a speed, a zone and a tool')
        tool, work_object = _name(values[-1]), _name(i.options.get('wobj') or 'wobj0')
        if not self._data.tool_is_held(tool):
            self._data.fail(f'tool {tool} stands still; only tools the robot holds are read')
        poses = [self._in_world(value, work_object) for value in values[:count]]
        position_m, rotation = poses[-1]
        spraying, switches = self._gun_state(i, values[count + 1 : -2])
        for name in map(_name, i.options.values()):
            self._flow = self._flow_triggers.get(name, self._flow)
            self._brush = self._brush_triggers.get(name, self._brush)
        move = RapidMove(
            position_m, rotation.as_quat(), self._speed(i, values[count], position_m), spraying,
            poses[0][0] if count == 2 else None, switches, i.line, self._flow,
            self._brush or ONLY_BRUSH, instruction=i.name, zone_m=self._data.zone_m(values[-2]),
            tool=tool, work_object=work_object,
        )  # fmt: skip
        self._program.moves.append(move)
        self._position_m = position_m
        if switches:
            self._gun_on = switches[-1].on
        if own_signal and self._is_gun(i):
            self._gun_on = self._output_level(i)

    def _in_world(self, target: object, work_object: str) -> tuple[np.ndarray, Rotation]:
        position_m, rotation = self._data.target(target)
        frame = self._data.work_object(work_object)
        if frame is None:
            self._note(f'work object {work_object} is not in the module: poses are in its frame')
            return position_m, rotation
        return frame[0] + frame[1].apply(position_m), frame[1] * rotation

    def _speed(self, i: Instruction, value: object, position_m: np.ndarray) -> float:
        if 'v' in i.options:
            return self._data.number(i.options['v'], 'the speed') * 1e-3
        if 't' in i.options and self._position_m is not None:
            duration_s = self._data.number(i.options['t'], 'the duration')
            if not duration_s > 0.0:
                self._data.fail(f'a duration of {duration_s:g} s; give one above 0')
            return float(np.linalg.norm(position_m - self._position_m)) / duration_s
        if _name(value) == 'vmax':
            self._note("vmax is the robot's own; 5 m/s assumed")
        return self._data.speed_m_per_s(value)

    def _gun_state(self, i: Instruction, between: list) -> tuple[bool, tuple[GunSwitch, ...]]:
        """Whether the gun is on at the start of a move, and its switches during the move."""
        if i.name.startswith('paint'):
            if self._brush is None:
                self._note('no SetBrush: paint moves are taken as spraying')
            return self._brush != 0, ()
        names = map(_name, [*between, *i.options.values()])
        switches = [self._triggers[name] for name in names if name in self._triggers]
        at_start = [switch for switch in switches if switch.from_start and not switch.distance_m]
        if at_start:
            self._gun_on = at_start[-1].on
        return self._gun_on, tuple(switch for switch in switches if switch not in at_start)


def _signal_of(i: Instruction) -> str:
    """The digital output that an instruction sets, '' if none."""
    if i.name in ('setdo', 'set', 'reset') and i.values:
        return _name(i.values[0])
    if i.name in TRIGGERS:
        return _name(i.options.get('dop') or '')
    if i.name in ('moveldo', 'movejdo', 'movecdo') and len(i.values) > 2:
        return _name(i.values[-2])
    return ''


def _name(value: object) -> str:
    return value.name if isinstance(value, Reference) else str(value)
