"""The data of a RAPID program while it runs, and its operators and functions.

As there, angles are in degrees, lengths in mm, and quaternions have the scalar first.
"""

import math
import operator
import re
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, NamedTuple, NoReturn

import numpy as np
from lark import Tree
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError, quoted
from paint_deposition.files.rapid.parser import Datum, Module, Routine, name_of
from paint_deposition.request import QUATERNION_TOLERANCE

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


Frame = tuple[np.ndarray, Rotation]  # position [mm] and orientation


def frame(pose: Any) -> Frame:
    """The frame of [[x, y, z], [q1, q2, q3, q4], ...]; ValueError if it is none."""
    position, quaternion = pose[:2] if isinstance(pose, list) and len(pose) > 1 else ([], [])
    if not (_are_numbers(position, 3) and _are_numbers(quaternion, 4)):
        raise ValueError(
            f'{quoted(pose)} is no position [x, y, z] with a quaternion [q1, q2, q3, q4]'
        )
    norm = math.hypot(*quaternion)
    if abs(norm - 1.0) > QUATERNION_TOLERANCE:
        raise ValueError(f'quaternion {quaternion} has the norm {norm:.4f} instead of 1')
    return np.array(position), Rotation.from_quat(quaternion, scalar_first=True)


def product(first: Frame, second: Frame) -> Frame:
    """The frame that is ``second`` in ``first``, where ``first`` is given."""
    return first[0] + first[1].apply(second[0]), first[1] * second[1]


def inverse(of: Frame) -> Frame:
    rotation = of[1].inv()
    return -rotation.apply(of[0]), rotation


def is_number(value: object) -> bool:
    return isinstance(value, float) and math.isfinite(value)


def _are_numbers(value: object, count: int) -> bool:
    return isinstance(value, list) and len(value) == count and all(map(is_number, value))


def _offs(target: list, *step: float, axes: Rotation | None = None) -> list:
    position, _ = frame(target)
    if not _are_numbers([*step], 3):
        raise ValueError(f'{[*step]} is no displacement; give three numbers')
    return [(position + (axes.apply(step) if axes else step)).tolist(), *target[1:]]


def _rel_tool(target: list, *step: float, **turn: float) -> list:
    rotation = frame(target)[1]
    angles = [turn.pop(name, 0.0) for name in ('rx', 'ry', 'rz')]
    if turn:
        raise ValueError(f'options {" ".join(turn)}')
    position, *rest = _offs(target, *step, axes=rotation)
    if any(angles):
        turned = rotation * Rotation.from_euler('XYZ', angles, degrees=True)
        rest[0] = turned.as_quat(scalar_first=True).tolist()
    return [position, *rest]


def _pose_mult(first: list, second: list) -> list:
    position, rotation = product(frame(first), frame(second))
    return [position.tolist(), rotation.as_quat(scalar_first=True).tolist()]


def _of_positions(calculate: Callable, a: Any, b: Any) -> Any:
    """What an operator gives that takes positions too."""
    if not (isinstance(a, list) or isinstance(b, list)):
        return calculate(a, b)
    if isinstance(a, list) and isinstance(b, list) and np.shape(a) != np.shape(b):
        raise ValueError('they have not the same size')
    return calculate(np.array(a), np.array(b)).tolist()


OPERATORS: dict[str, Callable] = {
    '+': partial(_of_positions, operator.add), '-': partial(_of_positions, operator.sub),
    '*': partial(_of_positions, operator.mul), '/': operator.truediv,
    'div': lambda a, b: float(math.trunc(a / b)), 'mod': math.fmod,
    '=': operator.eq, '<>': operator.ne, '<': operator.lt, '>': operator.gt,
    '<=': operator.le, '>=': operator.ge,
    'and': lambda a, b: a and b, 'or': lambda a, b: a or b, 'xor': operator.ne,
}  # fmt: skip
FUNCTIONS: dict[str, Callable] = {
    'abs': abs, 'sqrt': math.sqrt, 'pow': math.pow,
    'round': lambda a, dec=0.0: math.copysign(math.floor(abs(a) * 10.0**dec + 0.5), a) / 10.0**dec,
    'trunc': lambda a, dec=0.0: math.trunc(a * 10.0**dec) / 10.0**dec,
    'sin': lambda a: math.sin(math.radians(a)), 'cos': lambda a: math.cos(math.radians(a)),
    'tan': lambda a: math.tan(math.radians(a)), 'atan': lambda x: math.degrees(math.atan(x)),
    'atan2': lambda y, x: math.degrees(math.atan2(y, x)),
    'dim': lambda array, axis: float(np.shape(array)[int(axis) - 1]),
    'offs': _offs, 'reltool': _rel_tool, 'posemult': _pose_mult, 'distance': math.dist,
    'orientzyx': lambda *zyx: (
        Rotation.from_euler('ZYX', zyx, degrees=True).as_quat(scalar_first=True).tolist()
    ),
}  # fmt: skip


class Unknown(NamedTuple):
    """A value that only the robot knows: its name in the program, and why."""

    name: str
    reason: str


class Values:
    """The data of modules, and of the routine that runs."""

    # Of the interpreter: run a routine with its values and options; the value that it returns.
    call: Callable[[Routine, list, dict[str, Any]], Any]

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

    def routine(self, name: str) -> Routine | None:
        found = self._find(name)
        return found if isinstance(found, Routine) else None

    def value(self, node: Any) -> Any:
        """The value of an expression; ``Unknown`` if it depends on an unknown one."""
        return getattr(self, f'_{node.data}')(*node.children) if isinstance(node, Tree) else node

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
        name = name_of(reference)
        if not name:
            self.fail(f'{quoted(reference)} is no name to assign to')
        parts = reference.children[1:]
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
            return all(node.children[0] in self._local for node in nodes if isinstance(node, Tree))
        values = [self.value(node) for node in nodes]
        named = {option: self.value(node) for option, node in options.items()}
        if name not in FUNCTIONS:
            return Unknown(name, f'{name}(), which is not evaluated here')
        unknown = _one_unknown([*values, *named.values()])
        return unknown or self._calculated(name, FUNCTIONS[name], values, **named)

    def _calculated(self, name: str, function: Any, values: list, **named: Any) -> Any:
        try:
            result = function(*self._copied(values), **named)
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
