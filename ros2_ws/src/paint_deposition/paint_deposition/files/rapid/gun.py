"""The moves of a RAPID program and its gun: output, flow and brush, and what switches them."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.interpreter import Interpreter
from paint_deposition.files.rapid.parser import Instruction, Module, Node, Routine
from paint_deposition.model.eq1_pattern import MOST
from paint_deposition.motion.programmed import GunSwitch, Move, in_order
from paint_deposition.motion.trajectory import ONLY_BRUSH

OUTPUTS = ('setdo', 'set', 'reset', 'setao', 'setgo', 'pulsedo', 'invertdo')
TRIGGERS = ('triggio', 'triggequip')


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


class Gun(Interpreter):
    """Follows what a program does to the gun while it runs."""

    def __init__(self, modules: list[Module], start: Routine, signal: str | None) -> None:
        super().__init__(modules)
        name = next(module.name for module in modules if module.source == start.source)
        reached = list(self.reached(start.body))
        signals = sorted({_signal_of(i) for i in reached} - {''})
        words = ' '.join(signals)
        if signal is not None:
            if signal.lower() not in signals:
                raise RecordingError(
                    f'{start.source} never sets {signal}; it sets: {words or "none"}'
                )
            signals = [signal.lower()]
        elif any(i.name.startswith('paint') for i in reached):
            signals = []
        elif len(signals) > 1:
            raise RecordingError(
                f'{start.source} sets {words}; give the one that opens the gun as gun_signal'
            )
        self.program = RapidProgram(name, ''.join(signals))
        self.is_open, self.flow = False, 1.0
        self.brush: int | None = None  # None: no brush selected yet
        self._brush_table = ''
        # Where the TCP passes a plane of the work object and a brush is chosen: axis, place [mm],
        # brush and line.
        self.planes: list[tuple[int, float, int, int]] = []

    def do_setbrush(self, i: Instruction) -> None:
        brush = int(self._set_to(i, 'brush', 0))
        if not i.options:
            self.brush = brush
            return
        (axis, at), *more = i.options.items()
        if more or axis not in ('x', 'y', 'z'):
            self.fail(f'setbrush with {" ".join(i.options)}: give one of X, Y and Z')
        at_mm = self.number(at, 'the plane of setbrush')
        self.planes.append(('xyz'.index(axis), at_mm, brush, i.line))
        self.program.note(
            f'line {i.line}: the brush changes where the TCP passes that plane of the work object'
        )

    def do_usebrushtab(self, i: Instruction) -> None:
        table = name_of(i.values[0]) if i.values else ''
        if self._brush_table not in ('', table):
            self.fail(
                f'the brush table {table} after {self._brush_table}: a number would mean two '
                'brushes; give every brush a number of its own, in SetBrush and in the brushes of '
                'the model'
            )
        self._brush_table = table
        self.program.note(f'the brushes of the model have to be those of the table {table}')

    def do_triggio(self, i: Instruction) -> None:
        """Note in the triggdata what of the gun it switches, and to what."""
        what = self.commanded(i)
        value: Any = None
        if what == 'gun':
            if i.options.get('time'):
                self.fail(f'{i.name} by time is not followed; give a distance')
            distance_m = self.argument(i, 1) * 1e-3
            value = GunSwitch(distance_m, 'start' in i.options, self.level(i))
        elif what:
            value = self._set_to(i, what, len(i.values) - 1)
        self.assign(i.values[0] if i.values else None, (what, value))

    do_triggequip = do_triggio

    def commanded(self, i: Instruction) -> str:
        """Which of the gun, its flow and its brush an instruction sets, '' for none."""
        if _signal_of(i) == self.program.gun_signal != '':
            return 'gun'
        output = i.values[0] if i.values and i.name in OUTPUTS else None
        of_trigger = i.options.get('aop') or i.options.get('gop')
        signal = name_of(of_trigger if i.name in TRIGGERS else output)
        # As the module of a plan sets them: an analogue output and a group output.
        return {'aoflow': 'flow', 'gobrush': 'brush'}.get(signal, '')

    def command(self, i: Instruction, what: str) -> None:
        """Set the gun, its flow or its brush."""
        if 'sdelay' in i.options or i.name in ('pulsedo', 'invertdo'):
            self.fail(f'{i.name} of the gun by time is not followed; give a TriggIO')
        if what == 'gun':
            self.is_open = self.level(i)
        else:
            setattr(self, what, self._set_to(i, what, 1))

    def level(self, i: Instruction) -> bool:
        """What an instruction sets its digital output to."""
        if i.name in ('set', 'reset'):
            return i.name == 'set'
        return bool(self.known(i.values[-1]))

    def argument(self, i: Instruction, index: int) -> float:
        """The value of an argument that must be a number."""
        if len(i.values) <= index:
            self.fail(f'{i.name} needs a number as argument {index + 1}')
        return self.number(i.values[index], f'what {i.name} takes')

    def _set_to(self, i: Instruction, what: str, index: int) -> float:
        """What an instruction sets the flow, or the brush, to."""
        number = self.argument(i, index)
        if what == 'brush':
            if not (0 <= number <= MOST and number == round(number)):
                self.fail(f'{i.name} takes the number of a brush, not {number:g}')
            return int(number)
        return number

    @property
    def spray(self) -> dict[str, Any]:
        """What the gun does in a move that is no paint move, without triggers."""
        return {'spraying': self.is_open, 'flow': self.flow, 'brush': self.brush or ONLY_BRUSH}

    def spray_in_paint_move(self, track_mm: np.ndarray | None) -> dict[str, Any]:
        """What the gun does in a paint move.

        ``track_mm`` (2, 3) is its begin and end in the work object, None for what is not straight.
        """
        if self.brush is None and not self.planes:
            self.program.note('no SetBrush: paint moves are taken as spraying')
        spraying = self.brush != 0 and not (self.brush is None and self.planes)
        spray, switches, reached = self.spray | {'spraying': spraying}, [], 0.0
        if self.planes and track_mm is None:
            self.fail('a plane of SetBrush needs a straight move from a known place')
        while self.planes and track_mm is not None:
            axis, at_mm, brush, _ = self.planes[0]
            begin, end = track_mm[:, axis]
            share = (at_mm - begin) / (end - begin) if end != begin else -1.0
            if not reached <= share <= 1.0:
                break
            self.planes.pop(0)
            reached, self.brush = share, brush
            length_m = float(np.linalg.norm(track_mm[1] - track_mm[0])) * 1e-3
            switches.append(GunSwitch(share * length_m, True, brush != 0, brush))
        return spray | {'switches': tuple(switches)}

    def spray_in_move(self, triggers: Iterable[Any], length_m: float) -> dict[str, Any]:
        """What the gun does in another move, with the values of its triggers."""
        given = [trigger for trigger in triggers if isinstance(trigger, tuple)]
        switches = [switch for what, switch in given if what == 'gun']
        at_start = [switch for switch in switches if switch.from_start and not switch.distance_m]
        if at_start:
            self.is_open = at_start[-1].on
        for what, value in given:
            if what in ('flow', 'brush'):
                setattr(self, what, value)
        later = tuple(switch for switch in switches if switch not in at_start)
        spray = self.spray | {'switches': later}
        if later:
            self.is_open = in_order(later, length_m)[-1][1].on
        return spray


def _signal_of(i: Instruction) -> str:
    """The digital output that an instruction sets, '' if none."""
    if i.name in ('setdo', 'set', 'reset', 'pulsedo', 'invertdo') and i.values:
        return name_of(i.values[0])
    if i.name in TRIGGERS:
        return name_of(i.options.get('dop'))
    if i.name in ('moveldo', 'movejdo', 'movecdo') and len(i.values) > 2:
        return name_of(i.values[-2])
    return ''


def name_of(node: object) -> str:
    """The name that an argument consists of, '' if it is an expression."""
    return str(node.children[0]) if isinstance(node, Node) and node.rule == 'reference' else ''
