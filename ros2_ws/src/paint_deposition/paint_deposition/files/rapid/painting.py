"""What a RAPID program does to the robot and the gun: moves of the TCP, and their spray."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from paint_deposition.errors import RecordingError, quoted
from paint_deposition.files.rapid.interpreter import (
    PASSED_OVER,
    Ended,
    Interpreter,
    RapidProgram,
)
from paint_deposition.files.rapid.parser import Instruction, Module, Routine, name_of
from paint_deposition.files.rapid.values import (
    NOWHERE,
    PREDEFINED,
    RECORDS,
    Frame,
    Unknown,
    frame,
    inverse,
    product,
)
from paint_deposition.model.eq1_pattern import MOST
from paint_deposition.motion.programmed import GunSwitch, Move, in_order, track
from paint_deposition.motion.trajectory import ONLY_BRUSH

OUTPUTS = ('setdo', 'set', 'reset', 'setao', 'setgo', 'pulsedo', 'invertdo')
TRIGGERS = ('triggio', 'triggequip')
# Instruction -> number of its targets; the last is where it ends.
MOVES = {
    'movel': 1, 'movej': 1, 'movec': 2, 'paintl': 1, 'paintc': 2, 'triggl': 1, 'triggj': 1,
    'triggc': 2, 'moveldo': 1, 'movejdo': 1, 'movecdo': 2,
}  # fmt: skip
TRIGGER_OPTIONS = tuple(f't{number}' for number in range(2, 9))
HOME = frame(NOWHERE)
# A move from a place that is not known is longer than what its triggers count from its ends [m].
FROM_UNKNOWN_M = 1e6


class Painting(Interpreter):
    """Collects the moves of a `RapidProgram`, and follows its gun, while it runs."""

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
        # Name of the frame and pose of the TCP in it [mm], None where it is not known.
        self._at: tuple[str, Frame] | None = None
        self._displacement = HOME
        self._speed_share, self._fastest_mm_per_s = 1.0, np.inf
        self._external_line = 0
        self.passed = {}

    def run(self, start: Routine) -> None:
        """Run the program from the start of a procedure on."""
        with suppress(Ended):
            self.call(start, [], {})
        if self.planes:
            *_, self.line = self.planes[0]
            self.fail('the TCP never passes this plane while it paints; check its value')
        if self._external_line and any(not move.frame for move in self.program.moves):
            self.line = self._external_line
            self.fail(
                'an external axis moves, and the work objects stand still; give the work object '
                'its mechanical unit (ufmec), or take this out'
            )
        passed = []
        for name, lines in self.passed.items():
            shown = ', '.join(map(str, [*lines][:5])) + (' ...' if len(lines) > 5 else '')
            passed.append(f'{name} (line{"s" * (len(lines) > 1)} {shown})')
        if passed:
            self.program.note(f'passed over, neither motion nor paint: {", ".join(passed)}')

    def acts(self, i: Instruction) -> bool:
        if i.name.startswith('wait'):
            return self.is_open
        return i.name not in PASSED_OVER or bool(self.commanded(i))

    def act(self, i: Instruction) -> bool:
        if i.name in MOVES:
            self._move(i)
        elif do := getattr(self, f'do_{i.name}', None):
            do(i)
        elif what := self.commanded(i):
            if 'sdelay' in i.options or i.name in ('pulsedo', 'invertdo'):
                self.fail(f'{i.name} of the gun by time is not followed; give a TriggIO')
            if what == 'gun':
                self.is_open = self.level(i)
            else:
                setattr(self, what, self._set_to(i, what, 1))
        elif i.name.startswith('wait') and self.is_open:
            self.fail(f'{i.name} waits with the gun open, how long only the robot knows')
        else:
            return False
        return True

    # --- instructions

    def do_velset(self, i: Instruction) -> None:
        self._speed_share = self.argument(i, 0) / 100.0
        self._fastest_mm_per_s = self.argument(i, 1)

    def do_pdispset(self, i: Instruction) -> None:
        given = i.values[0] if i.values else None
        self._displacement = HOME if i.name == 'pdispoff' else self._frame(given)

    do_pdispoff = do_pdispset

    def do_waittime(self, i: Instruction) -> None:
        """Stand still, with the gun as it is."""
        wait_s = self.argument(i, 0)
        if self.program.moves and wait_s > 0.0:
            still = replace(
                self.program.moves[-1], instruction=i.name, line=i.line, via_m=None,
                wait_s=wait_s, switches=(), **self.spray,
            )  # fmt: skip
            self.program.moves.append(still)

    def do_moveextj(self, i: Instruction) -> None:
        self._external_line = i.line
        self.program.note(f'line {i.line}: moveextj moves an external axis, not the TCP')

    def do_moveabsj(self, i: Instruction) -> None:
        if self.is_open:
            self.fail('moveabsj sprays, and its joint angles are no pose; write it as MoveJ')
        self.program.note(f'line {i.line}: moveabsj skipped: joint angles are no pose')
        self._at = None

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

    # --- the gun

    def commanded(self, i: Instruction) -> str:
        """Which of the gun, its flow and its brush an instruction sets, '' for none."""
        if _signal_of(i) == self.program.gun_signal != '':
            return 'gun'
        output = i.values[0] if i.values and i.name in OUTPUTS else None
        of_trigger = i.options.get('aop') or i.options.get('gop')
        signal = name_of(of_trigger if i.name in TRIGGERS else output)
        # As the module of a plan sets them: an analogue output and a group output.
        return {'aoflow': 'flow', 'gobrush': 'brush'}.get(signal, '')

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

    # --- moves

    def _move(self, i: Instruction) -> None:
        count = MOVES[i.name]
        # What the film sees, and what it does not. A path that a sensor corrects (`\Corr`) is not
        # known.
        known = ('v', 't', 'wobj', *TRIGGER_OPTIONS, 'conc', 'id', 'z', 'inpos', 'tload')
        self.only_options(i.name, i.options, known)
        values = i.values[:-2] if i.name.endswith('do') else i.values
        if len(values) < count + 3:
            self.fail(f'{i.name} needs a target, a speed, a zone and a tool')
        *targets, speed = values[: count + 1]
        *between, zone, tool = values[count + 1 :]
        if between and not i.name.startswith('trigg'):
            self.fail(
                f'{i.name} takes {name_of(between[0]) or "a value"} beside target, speed, zone '
                'and tool; brush and event data of a paint move are not followed: give the brush '
                'a number, in SetBrush and in the brushes of the model'
            )
        name, base = self._work_object(i)
        displaced = product(base, self._displacement)
        poses = [product(displaced, self._frame(target)) for target in targets]
        via_m, length_m = poses[0][0] * 1e-3 if count == 2 else None, FROM_UNKNOWN_M
        if self._at and self._at[0] == name:
            length_m, _ = track(self._at[1][0] * 1e-3, via_m, poses[-1][0] * 1e-3)
        if i.name.startswith('paint'):
            ends_mm = None
            if count == 1 and self._at and self._at[0] == name:
                places = (product(inverse(base), end)[0] for end in (self._at[1], poses[-1]))
                ends_mm = np.array([*places])
            spray = self.spray_in_paint_move(ends_mm)
        else:
            named = [*between, *(at for name, at in i.options.items() if name in TRIGGER_OPTIONS)]
            spray = self.spray_in_move([self.known(node) for node in named], length_m)
        at = name, poses[-1]
        position, rotation = at[1]
        held, its_tool = self.value(tool), name_of(tool)
        if isinstance(held, Unknown):
            its_tool = held.name
        elif self._record(held, 'tooldata')[0] is False:
            self.fail(f'tool {its_tool} stands still; only tools the robot holds are read')
        stop, radius_mm, *_ = self._record(self.known(zone), 'zonedata')
        zone_m = 0.0 if stop else self.number(radius_mm, 'the radius of the zone') * 1e-3
        speed_m_per_s, duration_s = self._pace(i, speed)
        if duration_s and 0.0 < length_m < FROM_UNKNOWN_M:
            speed_m_per_s = length_m / duration_s
        self.program.moves.append(Move(
            position * 1e-3, rotation.as_quat(), speed_m_per_s, wait_s=duration_s,
            via_m=via_m, line=i.line, instruction=i.name,
            zone_m=zone_m, tool=its_tool, frame=name,
            work_object=name_of(i.options.get('wobj')) or 'wobj0', **spray,
        ))  # fmt: skip
        self._at = at
        if i.name.endswith('do') and self.commanded(i) == 'gun':
            self.is_open = self.level(i)

    def _frame(self, node: object) -> Frame:
        try:
            return frame(self.known(node))
        except ValueError as error:
            self.fail(str(error))

    def _work_object(self, i: Instruction) -> tuple[str, Frame]:
        """The frame that the poses are given in, '' for the world, and the work object in it."""
        node = i.options.get('wobj')
        value = self.value(node) if node else PREDEFINED['wobj0']
        if isinstance(value, Unknown):
            self.program.note(
                f'work object {value.name} is not in the module: poses are in its frame'
            )
            return value.name, HOME
        held, fixed, unit, user, own = self._record(value, 'wobjdata')
        if held:
            self.fail(f'the robot holds the work object {name_of(node)}; give a fixed one')
        if fixed or not unit:
            return '', product(self._frame(user), self._frame(own))
        self.program.note(
            f'work object {name_of(node)} moves with {unit}: poses are in its frame, which moves '
            'with the part'
        )
        return unit, self._frame(own)

    def _pace(self, i: Instruction, node: object) -> tuple[float, float]:
        """The speed of a move [m/s], and how long it takes [s], 0 where its speed says so."""
        if 'v' in i.options:
            speed = self.number(i.options['v'], 'the speed')
        else:
            if name_of(node) == 'vmax':
                self.program.note("vmax is the robot's own; 5 m/s assumed")
            speed = self.number(self._record(self.known(node), 'speeddata')[0], 'the speed')
        speed_m_per_s = min(speed * self._speed_share, self._fastest_mm_per_s) * 1e-3
        if 't' not in i.options:
            return speed_m_per_s, 0.0
        duration_s = self.number(i.options['t'], 'the duration')
        if not duration_s > 0.0:
            self.fail(f'a duration of {duration_s:g} s; give one above 0')
        if not self._speed_share > 0.0:
            self.fail(f'a speed of {self._speed_share:.0%} by VelSet; give one above 0')
        return speed_m_per_s, duration_s / self._speed_share

    def _record(self, value: object, kind: str) -> list:
        if not isinstance(value, list) or len(value) != len(RECORDS[kind]):
            self.fail(f'{quoted(value)} is no {kind}')
        return value


def _signal_of(i: Instruction) -> str:
    """The digital output that an instruction sets, '' if none."""
    if i.name in ('setdo', 'set', 'reset', 'pulsedo', 'invertdo') and i.values:
        return name_of(i.values[0])
    if i.name in TRIGGERS:
        return name_of(i.options.get('dop'))
    if i.name in ('moveldo', 'movejdo', 'movecdo') and len(i.values) > 2:
        return name_of(i.values[-2])
    return ''
