"""The data of a RAPID program while it runs, and the values of its expressions."""

import math
import re
from collections.abc import Iterable
from typing import Any, NamedTuple, NoReturn

from paint_deposition.errors import RecordingError, quoted
from paint_deposition.files.rapid.functions import FUNCTIONS, OPERATORS, is_number
from paint_deposition.files.rapid.parser import Datum, Module, Node, Routine

# Of one array, and of all lists that are made or copied while a program runs.
MOST_ELEMENTS, MOST_COPIED = 1_000_000, 10_000_000
MOST_LETTERS = 80  # of a string on the controller


def _all(kind: str, names: str) -> dict[str, str]:
    return dict.fromkeys(names.split(), kind)


# The components of the records, in their order, and their types.
RECORDS: dict[str, dict[str, str]] = {
    'pos': _all('num', 'x y z'), 'orient': _all('num', 'q1 q2 q3 q4'),
    'pose': {'trans': 'pos', 'rot': 'orient'},
    'confdata': _all('num', 'cf1 cf4 cf6 cfx'),
    'robjoint': _all('num', 'rax_1 rax_2 rax_3 rax_4 rax_5 rax_6'),
    'extjoint': _all('num', 'eax_a eax_b eax_c eax_d eax_e eax_f'),
    'jointtarget': {'robax': 'robjoint', 'extax': 'extjoint'},
    'robtarget': {'trans': 'pos', 'rot': 'orient', 'robconf': 'confdata', 'extax': 'extjoint'},
    'tooldata': {'robhold': 'bool', 'tframe': 'pose', 'tload': 'loaddata'},
    'wobjdata': {
        **_all('bool', 'robhold ufprog'), 'ufmec': 'string', **_all('pose', 'uframe oframe'),
    },
    'speeddata': _all('num', 'v_tcp v_ori v_leax v_reax'),
    'zonedata': {
        'finep': 'bool',
        **_all('num', 'pzone_tcp pzone_ori pzone_eax zone_ori zone_leax zone_reax'),
    },
}  # fmt: skip
NOWHERE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
# What every controller has. Robots differ in `vmax`; 5 m/s is the least that ABB states.
PREDEFINED: dict[str, Any] = {
    'tool0': [True, NOWHERE, [0.0]], 'wobj0': [False, True, '', NOWHERE, NOWHERE],
    'vmax': [5000.0, 500.0, 5000.0, 1000.0], 'fine': [True, *6 * [0.0]],
    'pi': math.pi, 'high': 1.0, 'low': 0.0,
}  # fmt: skip


class Unknown(NamedTuple):
    """A value that only the robot knows: its name in the program, and why."""

    name: str
    reason: str


class Values:
    """The data of modules, and of the routine that runs."""

    def __init__(self, modules: list[Module]) -> None:
        self.source, self.line = modules[0].source, 0
        self._local: dict[str, Datum] = {}
        self._elements = 0
        self._global: dict[str, Any] = {f'reg{k}': Datum('', 'num', 0.0) for k in range(1, 6)}
        self._of_module: dict[str, dict[str, Any]] = {}
        for module in modules:
            own = self._of_module.setdefault(module.source, {})
            for place, items in ((self._global, module.shared), (own, module.local)):
                for item in items:
                    known = place.get(item.name)
                    if isinstance(known, Routine) and isinstance(item, Routine):
                        raise RecordingError(
                            f'procedure {item.name} is in {known.source} and in {item.source}; '
                            'give the modules of one program'
                        )
                    place[item.name] = item

    def fail(self, reason: str) -> NoReturn:
        """Refuse the program with the line that runs."""
        raise RecordingError(f'{self.source} line {self.line}: {reason}')

    def call(self, routine: Routine, values: list, options: dict[str, Any]) -> Any:
        """Run a routine; the value that it returns."""
        raise NotImplementedError

    def routine(self, name: str) -> Routine | None:
        found = self._find(name)
        return found if isinstance(found, Routine) else None

    def value(self, node: Any) -> Any:
        """The value of an expression; ``Unknown`` if it depends on an unknown one."""
        return getattr(self, f'_{node.rule}')(*node.children) if isinstance(node, Node) else node

    def known(self, node: Any) -> Any:
        """The value of an expression that must not be unknown."""
        value = self.value(node)
        if isinstance(value, Unknown):
            self.fail(value.reason)
        return value

    def number(self, node: Any, what: str) -> float:
        """The value of an expression that must be a number; ``what`` is for the message."""
        value = self.known(node)
        if not is_number(value):
            self.fail(f'{what} is {quoted(value)}; a number expected')
        return value

    def assign(self, reference: Any, value: Any) -> None:
        """Assign a copy of a value to a datum or a part of it."""
        if not isinstance(reference, Node) or reference.rule != 'reference':
            self.fail(f'{quoted(reference)} is no name to assign to')
        name, *parts = reference.children
        value = self._copied(value)
        datum = self._find(name)
        if not isinstance(datum, Datum):
            if parts:
                self.fail(f'{name} has no such part to assign to')
            datum = self._global[name] = Datum(name, '')
        if not parts:
            datum.value, datum.is_declared = value, False
            return
        *keys, last = self._keys(datum.type, parts)
        place = self._part(self._settled(datum), keys, name)
        self._part(place, [last], name)
        place[last] = value

    # --- expressions, by the names of the grammar

    def _reference(self, name: str, *parts: Any) -> Any:
        datum = self._find(name)
        if isinstance(datum, Datum):
            return self._part(self._settled(datum), self._keys(datum.type, parts), name)
        if speed := re.fullmatch(r'v(\d+)', name):
            return [float(speed[1]), 500.0, 5000.0, 1000.0]
        if zone := re.fullmatch(r'z(\d+)', name):
            return [False, max(float(zone[1]), 0.3), *5 * [0.0]]  # z0 is 0.3 mm
        undeclared = Unknown(name, f'{name} is not declared in the modules given')
        return PREDEFINED.get(name, undeclared)

    def _aggregate(self, items: list) -> Any:
        return _one_unknown(values := [self.value(item) for item in items]) or values

    def _negation(self, node: Any) -> Any:
        value = self.value(node)
        return value if isinstance(value, Unknown) else not value

    def _operation(self, left: Any, sign: str, right: Any) -> Any:
        values = [self.value(left), self.value(right)]
        decisive = {'and': False, 'or': True}.get(sign)
        if decisive is not None and decisive in values:
            return decisive
        return _one_unknown(values) or self._calculated(sign, OPERATORS[sign], values)

    def _call(self, name: str, arguments: tuple[list, dict]) -> Any:
        nodes, options = arguments
        if routine := self.routine(name):
            return self.call(routine, nodes, options)
        if name == 'present':
            return all(node.children[0] in self._local for node in nodes if isinstance(node, Node))
        values = [self.value(node) for node in nodes]
        named = {option: self.value(node) for option, node in options.items()}
        if name not in FUNCTIONS:
            return Unknown(name, f'{name}(), which is not evaluated here')
        unknown = _one_unknown([*values, *named.values()])
        return unknown or self._calculated(name, FUNCTIONS[name], values, **named)

    def _calculated(self, name: str, function: Any, values: list, **named: Any) -> Any:
        try:
            result = function(*values, **named)
            if isinstance(result, str) and len(result) > MOST_LETTERS:
                self.fail(f'a string of {len(result)} letters; RAPID has {MOST_LETTERS} at most')
            return result
        except ZeroDivisionError:
            self.fail('division by zero')
        except (ArithmeticError, IndexError, TypeError, ValueError) as error:
            self.fail(f'{name} of {", ".join(map(quoted, values))}: {error}')

    # --- data

    def _find(self, name: str) -> Datum | Routine | None:
        scopes = self._local, self._of_module[self.source], self._global
        return next((scope[name] for scope in scopes if name in scope), None)

    def _settled(self, datum: Datum) -> Any:
        """The value of a datum; from its declaration, if it is needed for the first time."""
        if datum.is_declared:
            first, datum.is_declared = datum.value, False
            datum.value = Unknown(datum.name, 'a value of its own value')
            datum.value = (
                self._initial(datum.type, datum.sizes or [])
                if first is None
                else self._copied(self.value(first))
            )
        return datum.value

    def _copied(self, value: Any) -> Any:
        """A copy of a list, any other value itself."""
        self._elements += 1
        if self._elements > MOST_COPIED:
            self.fail(f'{MOST_COPIED} elements were made or copied; check sizes and loops')
        return [self._copied(one) for one in value] if type(value) is list else value

    def _initial(self, kind: str, sizes: list) -> Any:
        """What a datum without a value begins with on the controller."""
        if sizes:
            count = self.number(sizes[0], 'the size of an array')
            if not 0.0 < count <= MOST_ELEMENTS:
                self.fail(f'an array of {count:g} elements; give 1 to {MOST_ELEMENTS}')
            one = self._initial(kind, sizes[1:])
            return [self._copied(one) for _ in range(int(count))]
        if kind in RECORDS:
            return [self._initial(one, []) for one in RECORDS[kind].values()]
        simple = {'num': 0.0, 'dnum': 0.0, 'bool': False, 'string': ''}
        return simple.get(kind, Unknown(kind, f'a {kind} that has no value yet'))

    def _keys(self, kind: str, parts: Iterable[Any]) -> list[int]:
        """Indexes from 0 of the elements and components on the way to a part of a datum."""
        keys: list[int] = []
        for part in parts:
            if isinstance(part, list):
                keys += [int(self.number(index, 'an index')) - 1 for index in part]
                continue
            name, fields = part.children[0], RECORDS.get(kind, {})
            if name not in fields:
                self.fail(f'{kind} has no component {name}')
            keys.append([*fields].index(name))
            kind = fields[name]
        return keys

    def _part(self, value: Any, keys: list[int], name: str) -> Any:
        for key in keys:
            if not isinstance(value, list) or key not in range(len(value)):
                self.fail(f'{name} has no such part')
            value = value[key]
        return value


def _one_unknown(values: list) -> Unknown | None:
    return next((value for value in values if isinstance(value, Unknown)), None)
