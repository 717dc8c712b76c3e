"""The moves of a RAPID program and its gun: output, flow and brush, and what switches them."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.parser import Instruction, Node
from paint_deposition.files.rapid.values import Values
from paint_deposition.model.eq1_pattern import MOST
from paint_deposition.motion.programmed import GunSwitch, Move
from paint_deposition.motion.trajectory import ONLY_BRUSH

# Outputs that `writer` uses: an analogue one for the relative flow, a group output for the brush.
FLOW_SIGNAL, BRUSH_SIGNAL = 'aoflow', 'gobrush'
OUTPUTS = ('setdo', 'set', 'reset', 'setao', 'setgo', 'pulsedo', 'invertdo')


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


class Trigger(NamedTuple):
    """What a triggdata switches; nothing, if it is for another output."""

    switch: GunSwitch | None = None
    flow: float | None = None
    brush: int | None = None


class Plane(NamedTuple):
    """A brush that is chosen where the TCP passes a plane of the work object."""

    axis: int
    at_mm: float
    brush: int
    line: int


class Spray(NamedTuple):
    """What the gun does during a move: at its start, and where it is switched."""

    spraying: bool
    flow: float
    brush: int
    switches: tuple[GunSwitch, ...] = ()


class Gun:
    """The state of the gun while a program runs."""

    def __init__(self, values: Values, program: RapidProgram) -> None:
        self._values, self._program = values, program
        self.is_open, self.flow = False, 1.0
        self.brush: int | None = None  # None: no brush selected yet
        self._brush_table = ''
        self.planes: list[Plane] = []

    # --- instructions

    def do_setbrush(self, i: Instruction) -> None:
        brush = self._brush_number(i, 0)
        if not i.options:
            self.brush = brush
            return
        (axis, at), *more = i.options.items()
        if more or axis not in ('x', 'y', 'z'):
            self._values.fail(f'setbrush with {" ".join(i.options)}: give one of X, Y and Z')
        at_mm = self._values.number(at, 'the plane of setbrush')
        self.planes.append(Plane('xyz'.index(axis), at_mm, brush, i.line))
        self._program.note(
            f'line {i.line}: the brush changes where the TCP passes that plane of the work object'
        )

    def do_usebrushtab(self, i: Instruction) -> None:
        table = name_of(i.values[0]) if i.values else ''
        if self._brush_table not in ('', table):
            self._values.fail(
                f'the brush table {table} after {self._brush_table}: a number would mean two '
                'brushes; give every brush a number of its own, in SetBrush and in the brushes of '
                'the model'
            )
        self._brush_table = table
        self._program.note(f'the brushes of the model have to be those of the table {table}')

    def do_triggio(self, i: Instruction) -> None:
        self._values.assign(i.values[0] if i.values else None, self._trigger(i))

    do_triggequip = do_triggio

    def commanded(self, i: Instruction) -> str:
        """Which of the gun, its flow and its brush an instruction sets, '' for none."""
        if signal_of(i) == self._program.gun_signal != '':
            return 'gun'
        signals = {FLOW_SIGNAL: 'flow', BRUSH_SIGNAL: 'brush'}
        return signals.get(name_of(i.values[0]), '') if i.values and i.name in OUTPUTS else ''

    def command(self, i: Instruction, what: str) -> None:
        """Set the gun, its flow or its brush."""
        if 'sdelay' in i.options or i.name in ('pulsedo', 'invertdo'):
            self._values.fail(f'{i.name} of the gun by time is not followed; give a TriggIO')
        if what == 'gun':
            self.is_open = self.level(i)
        elif what == 'flow':
            self.flow = self.number(i, 1)
        else:
            self.brush = self._brush_number(i, 1)

    def level(self, i: Instruction) -> bool:
        """What an instruction sets its digital output to."""
        if i.name in ('set', 'reset'):
            return i.name == 'set'
        return bool(self._values.known(i.values[-1]))

    def number(self, i: Instruction, index: int) -> float:
        """The value of an argument that must be a number."""
        if len(i.values) <= index:
            self._values.fail(f'{i.name} needs a number as argument {index + 1}')
        return self._values.number(i.values[index], f'what {i.name} takes')

    def _brush_number(self, i: Instruction, index: int) -> int:
        number = self.number(i, index)
        if not (0 <= number <= MOST and number == round(number)):
            self._values.fail(f'{i.name} takes the number of a brush, not {number:g}')
        return int(number)

    def _trigger(self, i: Instruction) -> Trigger:
        last = len(i.values) - 1
        if signal_of(i) == self._program.gun_signal != '':
            if i.options.get('time'):
                self._values.fail(f'{i.name} by time is not followed; give a distance')
            distance_m = self.number(i, 1) * 1e-3
            return Trigger(GunSwitch(distance_m, 'start' in i.options, self.level(i)))
        if name_of(i.options.get('aop')) == FLOW_SIGNAL:
            return Trigger(flow=self.number(i, last))
        if name_of(i.options.get('gop')) == BRUSH_SIGNAL:
            return Trigger(brush=self._brush_number(i, last))
        return Trigger()

    # --- moves

    @property
    def now(self) -> Spray:
        """What it does in a move that is no paint move, without triggers."""
        return Spray(self.is_open, self.flow, self.brush or ONLY_BRUSH)

    def in_paint_move(self, track_mm: np.ndarray | None) -> Spray:
        """What it does in a paint move.

        ``track_mm`` (2, 3) is its begin and end in the work object, None for what is not straight.
        """
        if self.brush is None and not self.planes:
            self._program.note('no SetBrush: paint moves are taken as spraying')
        spraying = self.brush != 0 and not (self.brush is None and self.planes)
        spray, switches, reached = self.now._replace(spraying=spraying), [], 0.0
        if self.planes and track_mm is None:
            self._values.fail('a plane of SetBrush needs a straight move from a known place')
        while self.planes and track_mm is not None:
            plane = self.planes[0]
            begin, end = track_mm[:, plane.axis]
            share = (plane.at_mm - begin) / (end - begin) if end != begin else -1.0
            if not reached <= share <= 1.0:
                break
            self.planes.pop(0)
            reached, self.brush = share, plane.brush
            length_m = float(np.linalg.norm(track_mm[1] - track_mm[0])) * 1e-3
            switches.append(GunSwitch(share * length_m, True, plane.brush != 0, plane.brush))
        return spray._replace(switches=tuple(switches))

    def in_move(self, triggers: Iterable[object]) -> Spray:
        """What it does in another move, with the values of its triggers."""
        given = [trigger for trigger in triggers if isinstance(trigger, Trigger)]
        switches = [trigger.switch for trigger in given if trigger.switch]
        at_start = [switch for switch in switches if switch.from_start and not switch.distance_m]
        if at_start:
            self.is_open = at_start[-1].on
        for trigger in given:
            self.flow = self.flow if trigger.flow is None else trigger.flow
            self.brush = self.brush if trigger.brush is None else trigger.brush
        later = tuple(switch for switch in switches if switch not in at_start)
        spray = self.now._replace(switches=later)
        if later:
            self.is_open = later[-1].on
        return spray


def gun_signal(reached: list[Instruction], given: str | None, source: str) -> str:
    """The output that opens the gun: the given one, or the only one, '' for paint moves."""
    signals = sorted({signal_of(i) for i in reached} - {''})
    if given is not None:
        if given.lower() not in signals:
            words = ' '.join(signals) or 'none'
            raise RecordingError(f'{source} never sets {given}; it sets: {words}')
        return given.lower()
    if any(i.name.startswith('paint') for i in reached):
        return ''
    if len(signals) > 1:
        words = ' '.join(signals)
        raise RecordingError(f'{source} sets {words}; say which of them opens the gun')
    return ''.join(signals)


def signal_of(i: Instruction) -> str:
    """The digital output that an instruction sets, '' if none."""
    if i.name in ('setdo', 'set', 'reset', 'pulsedo', 'invertdo') and i.values:
        return name_of(i.values[0])
    if i.name in ('triggio', 'triggequip'):
        return name_of(i.options.get('dop'))
    if i.name in ('moveldo', 'movejdo', 'movecdo') and len(i.values) > 2:
        return name_of(i.values[-2])
    return ''


def name_of(node: object) -> str:
    """The name that an argument consists of, '' if it is an expression."""
    if isinstance(node, Node) and node.rule == 'reference':
        return str(node.children[0])
    return ''
