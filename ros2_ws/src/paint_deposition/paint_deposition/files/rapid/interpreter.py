"""Running a RAPID program: its control flow and the calls of its routines."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

from lark import Token, Tree

from paint_deposition.errors import did_you_mean
from paint_deposition.files.rapid.parser import Datum, Instruction, Routine, line_of
from paint_deposition.files.rapid.values import Unknown, Values
from paint_deposition.motion.programmed import Move

MOST_TURNS, MOST_STATEMENTS = 10_000, 100_000
CHANGING = {'incr': 1.0, 'decr': -1.0, 'add': None, 'clear': 0.0}
# What moves neither the robot nor the paint: settings of the motion that the film does not see,
# outputs and inputs, text, waiting, interrupts, files.
PASSED_OVER = frozenset((
    'accset', 'worldaccset', 'pathacclim', 'confj', 'confl', 'singarea', 'gripload',
    'motionsup', 'softact', 'softdeact', 'actunit', 'deactunit', 'waitwobj', 'dropwobj',
    'syncmoveon', 'syncmoveoff', 'setdo', 'set', 'reset', 'setao', 'setgo', 'pulsedo',
    'invertdo', 'ioenable', 'iodisable', 'waitdi', 'waitdo', 'waitai', 'waitao', 'waitgi',
    'waitgo', 'waituntil', 'waitrob', 'waitsynctask', 'waitload', 'waittime', 'tpwrite',
    'tperase', 'tpshow', 'tpreadfk', 'tpreadnum', 'uimsgbox', 'errwrite', 'errlog', 'write',
    'writebin', 'open', 'close', 'rewind', 'clkreset', 'clkstart', 'clkstop', 'stop', 'break',
    'load', 'unload', 'idelete', 'ienable', 'idisable', 'isleep', 'iwatch', 'isignaldi',
    'isignaldo', 'itimer', 'wzdisable', 'wzenable',
))  # fmt: skip


@dataclass
class RapidProgram:
    """The moves in order, and notes on everything left out or assumed, one line each."""

    module: str
    gun_signal: str = ''  # the digital output that opens the gun
    moves: list[Move] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Note something once."""
        if text not in self.notes:
            self.notes.append(text)


class Ended(Exception):
    """The end of a routine, with its value; without one, that of the program."""


class Interpreter(Values):
    """Runs a program. What acts on the robot and the gun is the business of a subclass."""

    # Of the subclass: do what an instruction does to the robot or the gun, and whether it does
    # anything; the same without doing it.
    act: Callable[[Instruction], bool]
    acts: Callable[[Instruction], bool]
    passed: dict[str, dict[int, None]]  # what was passed over, with its lines
    _running: tuple[Routine, ...] = ()
    _count = 0.0

    def call(self, routine: Routine, values: list, options: dict[str, Any]) -> Any:
        if any(routine is one for one in self._running):
            self.fail(f'procedure {routine.name} calls itself')
        needed = [one.name for one in routine.parameters if not one.optional]
        if len(needed) != len(values):
            self.fail(f'{routine.name} takes {len(needed)} arguments, not {len(values)}')
        optional = [one.name for one in routine.parameters if one.optional]
        self.only_options(routine.name, options, optional)
        given = dict(zip(needed, values, strict=True)) | options
        own = {
            one.name: replace(one, value=self.value(given[one.name]))
            for one in routine.parameters if one.name in given
        }  # fmt: skip
        caller, result = (self._local, self.source, self.line, self._running), None
        self._local, self.source, self._running = own, routine.source, (*self._running, routine)
        try:
            self._execute(routine.body)
        except Ended as ended:
            if not ended.args:
                raise
            (result,) = ended.args
        self._local, self.source, self.line, self._running = caller
        for one in routine.parameters:
            node = given.get(one.name)
            if one.shared and isinstance(node, Tree) and node.data == 'reference':
                self.assign(node, own[one.name].value)
        return result

    def only_options(self, name: str, options: Iterable[str], known: Sequence[str]) -> None:
        """Refuse an optional argument that is not known; a misspelt one would do nothing."""
        for option in options:
            if option not in known:
                self.fail(f'{name} has no option \\{option}; {did_you_mean(option, known)}')

    def reached(self, node: Any, seen: set[str] | None = None) -> Iterator[Instruction]:
        """All instructions in a block, and in the routines that it calls, each of these once."""
        seen = set() if seen is None else seen
        for child in node.children:
            if isinstance(child, Tree):
                yield from self.reached(child, seen)
            elif isinstance(child, Instruction):
                routine = self.routine(child.name)
                if not routine:
                    yield child
                elif child.name not in seen:
                    seen.add(child.name)
                    yield from self.reached(routine.body, seen)

    # --- statements

    def _execute(self, block: Tree) -> None:
        for statement in block.children:
            self._step()
            if isinstance(statement, Instruction):
                self._instruction(statement)
            elif statement.data != 'label':  # which only GOTO needs, and that is refused
                getattr(self, f'_{statement.data}')(*statement.children)

    def _step(self, count: float = 1.0) -> None:
        """Count a statement, a turn of a loop, or a part of either."""
        self._count += count
        if self._count > MOST_STATEMENTS:
            self.fail(f'{MOST_STATEMENTS} statements have run; check the loops')

    def _instruction(self, i: Instruction) -> None:
        self.line = i.line
        # An option handed on, V?v, is one if the parameter is given.
        given = {}
        for name, node in i.options.items():
            if not (isinstance(node, Tree) and node.data == 'conditional'):
                given[name] = node
            elif (parameter := node.children[0]) in self._local:
                given[name] = Tree('reference', [parameter])
        i = i._replace(options=given)
        if routine := self.routine(i.name):
            self.call(routine, i.values, i.options)
        elif i.name == 'return':
            raise Ended(self.value(i.values[0]) if i.values else None)
        elif i.name == 'exit':
            raise Ended
        elif i.name in CHANGING:
            needed = 2 if CHANGING[i.name] is None else 1
            if len(i.values) != needed:
                count = f'{needed} argument{"s" * (needed > 1)}'
                self.fail(f'{i.name} takes {count}, not {len(i.values)}')
            step = CHANGING[i.name]
            added = self.number(i.values[1], i.name) if step is None else step
            before = 0.0 if i.name == 'clear' else self.number(i.values[0], i.name)
            self.assign(i.values[0], before + added)
        elif self.act(i):
            return
        elif i.name not in PASSED_OVER:
            self.fail(
                f'{i.name} is not understood, and may move the robot or the paint; take it out, '
                'or write what it does as moves and SetBrush'
            )
        else:
            if i.name.startswith('tpread') and i.values:
                self.assign(i.values[0], Unknown(i.name, f'what {i.name} reads in line {i.line}'))
            output = i.values[0] if i.name.startswith(('set', 'reset')) and i.values else None
            names = output.children[:1] if isinstance(output, Tree) else []
            self.passed.setdefault(' '.join([i.name, *map(str, names)]), {})[i.line] = None

    def _assignment(self, reference: Any, node: Any) -> None:
        self.line = reference.children[0].line
        self.assign(reference, self.value(node))

    def _declaration(self, *data: Datum) -> None:
        self._local |= {datum.name: replace(datum) for datum in data}

    def _connect(self, word: Token, _: Tree, trap: Token) -> None:
        routine = self.routine(trap)
        if not routine:
            self.fail(f'trap {trap} is not declared in the modules given')
        self._only_if_idle(word, f'the interrupt {trap}', routine.body)

    def _if(self, *parts: Any) -> None:
        given = iter([part for part in parts if part is not None])
        for word in given:
            self.line = line_of(word)
            condition = word == 'else' or self.value(next(given))
            body = next(given)
            if isinstance(condition, Unknown):
                rest = [part for part in given if isinstance(part, Tree) and part.data == 'block']
                return self._only_if_idle(word, condition.reason, body, *rest)
            if condition:
                return self._execute(body)
        return None

    def _while(self, word: Token, condition: Any, body: Tree) -> None:
        leaves = any(i.name in ('return', 'exit', 'raise', 'goto') for i in self.reached(body))
        for turn in count():
            self.line = line_of(word)
            self._step()
            going_on = self.value(condition)
            if isinstance(going_on, Unknown):
                return self._only_if_idle(word, going_on.reason, body)
            if not going_on:
                return None
            if turn >= MOST_TURNS or (condition is True and not leaves):
                self.fail('WHILE never ends; name the procedure of one part (--procedure)')
            self._execute(body)
        return None

    def _for(self, word: Token, name: Token, *parts: Any) -> None:
        self.line = line_of(word)
        *nodes, body = (part for part in parts if part is not None)
        bounds = [self.value(node) for node in nodes]
        for bound in bounds:
            if isinstance(bound, Unknown):
                return self._only_if_idle(word, bound.reason, body)
        first, last, *steps = (self.number(bound, 'a bound of FOR') for bound in bounds)
        step = steps[0] if steps else 1.0 if last >= first else -1.0
        turns = (last - first) / step if step else MOST_TURNS
        if turns >= MOST_TURNS:
            self.fail(f'FOR takes {MOST_TURNS} turns or more; check its bounds')
        outer = self._local
        for turn in range(int(turns + 1e-9) + 1 if turns >= 0.0 else 0):
            self._step()
            self._local = outer | {name: Datum(name, 'num', first + turn * step)}
            self._execute(body)
        self._local = outer
        return None

    def _test(self, word: Token, node: Any, *cases: Any) -> None:
        self.line = line_of(word)
        value, given = self.value(node), [case for case in cases if case]
        if isinstance(value, Unknown):
            return self._only_if_idle(word, value.reason, *given)
        for case in given:
            if case.data == 'block':
                return self._execute(case)
            if value in map(self.known, case.children[0]):
                return self._execute(case.children[1])
        return None

    def _only_if_idle(self, word: Token, reason: str, *bodies: Tree) -> None:
        """Pass over blocks that depend on the robot; refuse those that act on it or the gun."""
        for body in bodies:
            changed = [*_assigned(body)]
            for i in self.reached(body):
                self._step(0.01)
                if i.name in CHANGING or i.name.startswith('tpread'):
                    changed += i.values[:1]
                elif self.acts(i):
                    self.fail(
                        f'{i.name} in line {i.line} is inside {word.upper()} and depends on '
                        f'{reason}; declare its value, or take the condition out'
                    )
            for reference in changed:
                name = str(reference.children[0])
                unknown = Unknown(name, f'{name}, which depends on {reason}')
                self.assign(Tree('reference', [name]), unknown)
        self.passed.setdefault(str(word), {})[line_of(word)] = None


def _assigned(node: Tree) -> Iterator[Tree]:
    """The references that assignments in a block change."""
    for part in node.children:
        if isinstance(part, Tree):
            yield from part.children[:1] if part.data == 'assignment' else _assigned(part)
