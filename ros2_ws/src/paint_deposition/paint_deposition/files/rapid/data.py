"""The data of a RAPID module while it runs: values by name, frames, speeds and zones."""

import copy
import operator
import re
from collections.abc import Callable
from typing import Any, NoReturn, TypeGuard

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.parser import Call, Module, Reference

# Quaternions are written with four digits; further off is damage, not rounding.
QUATERNION_TOLERANCE = 0.01
# Index of each component in its record: robtarget, pose, tooldata, wobjdata, speeddata.
COMPONENTS = {
    'trans': 0, 'rot': 1, 'robconf': 2, 'extax': 3, 'x': 0, 'y': 1, 'z': 2,
    'q1': 0, 'q2': 1, 'q3': 2, 'q4': 3, 'v_tcp': 0, 'v_ori': 1,
    'robhold': 0, 'tframe': 1, 'tload': 2, 'ufprog': 1, 'ufmec': 2, 'uframe': 3, 'oframe': 4,
}  # fmt: skip
ARITHMETIC: dict[str, Callable] = {
    '+': operator.add, '-': operator.sub, '*': operator.mul, '/': operator.truediv,
}  # fmt: skip
# Robots differ; 5 m/s is the least that ABB states for `vmax`.
VMAX_M_PER_S = 5.0


class RapidData:
    """Values of a module's data; assignments change them, as in the controller."""

    def __init__(self, module: Module, source: str) -> None:
        self._source = source
        self.line = 0
        self._types = {name: datum.type for name, datum in module.data.items()}
        self._values: dict[str, object] = {}
        for name, datum in module.data.items():
            if datum.value is not None:
                self.line = datum.line
                self._values[name] = self.value(datum.value)

    def fail(self, reason: str) -> NoReturn:
        raise RecordingError(f'{self._source} line {self.line}: {reason}')

    def value(self, expression: object) -> Any:
        """The value of an expression."""
        if isinstance(expression, list):
            return [self.value(item) for item in expression]
        if isinstance(expression, Call):
            return self._call(expression)
        if isinstance(expression, Reference):
            return self._look_up(expression)
        return expression

    def number(self, expression: object, name: str) -> float:
        """The value of an expression that must be a number; `name` is for the error message."""
        value = self.value(expression)
        if not _is_number(value):
            self.fail(f'{name} is {value!r}; a number expected')
        return value

    def assign(self, target: Reference, value: object) -> None:
        *path, last = [target.name, *self._path(target)]
        place: Any = self._values
        for key in path:
            place = _element(place, key)
        if path and _element(place, last) is None:
            self.fail(f'{target.name} has no such part to assign to')
        place[last] = value

    # --- motion data

    def target(self, expression: object) -> tuple[np.ndarray, Rotation]:
        """Position [m] and orientation of a robtarget, in its work object."""
        value = self.value(expression)
        if not _is_record(value, 4):
            self.fail('a robtarget expected')
        return self.frame(value[:2])

    def frame(self, value: object) -> tuple[np.ndarray, Rotation]:
        """Position [m] and orientation of [[x, y, z] in mm, [q1, q2, q3, q4] scalar first]."""
        position, quaternion = value if _is_record(value, 2) else ([], [])
        if not (_are_numbers(position, 3) and _are_numbers(quaternion, 4)):
            self.fail(f'{value} is no position [x, y, z] with a quaternion [q1, q2, q3, q4]')
        w, x, y, z = quaternion
        norm = float(np.linalg.norm([w, x, y, z]))
        if abs(norm - 1.0) > QUATERNION_TOLERANCE:
            self.fail(f'quaternion {quaternion} has the norm {norm:.4f} instead of 1')
        return np.array(position) * 1e-3, Rotation.from_quat([x, y, z, w])

    def speed_m_per_s(self, expression: object) -> float:
        """Speed of the TCP of a speeddata."""
        name = self._predefined(expression)
        if name == 'vmax':
            return VMAX_M_PER_S
        if speed := re.fullmatch(r'v(\d+)', name):
            return float(speed[1]) * 1e-3
        value = self.value(expression)
        if not (_is_record(value, 4) and _is_number(value[0])):
            self.fail('a speeddata expected')
        return value[0] * 1e-3

    def zone_m(self, expression: object) -> float:
        """Radius of a zonedata in which the corner is cut; 0 for a stop point."""
        name = self._predefined(expression)
        if name == 'fine':
            return 0.0
        if zone := re.fullmatch(r'z(\d+)', name):
            return max(float(zone[1]), 0.3) * 1e-3  # z0 is 0.3 mm
        value = self.value(expression)
        if not _is_record(value, 7):
            self.fail('a zonedata expected')
        return 0.0 if value[0] else self.number(value[1], 'the radius of the zone') * 1e-3

    def work_object(self, name: str) -> tuple[np.ndarray, Rotation] | None:
        """Object frame in the world [m]; None when the module does not define it."""
        if name not in self._values:
            return (np.zeros(3), Rotation.identity()) if name == 'wobj0' else None
        value: Any = self._values[name]
        if not _is_record(value, 5):
            self.fail(f'{name} is no wobjdata')
        if value[0]:
            self.fail(f'the robot holds the work object {name}; give a fixed one')
        position, rotation = self.frame(value[3])
        object_position, object_rotation = self.frame(value[4])
        return position + rotation.apply(object_position), rotation * object_rotation

    def tool_is_held(self, name: str) -> bool:
        return _element(self._values.get(name), 0) is not False

    # --- names and functions

    def _predefined(self, expression: object) -> str:
        """The name of predefined data, '' if the module declares its own of that name."""
        name = expression.name if isinstance(expression, Reference) else ''
        return '' if name in self._values else name

    def _path(self, reference: Reference) -> list[int]:
        path = [int(self.number(index, 'an index')) - 1 for index in reference.indexes]
        for component in reference.components:
            if component not in COMPONENTS:
                self.fail(f'component {component} of {reference.name} is not known')
            path.append(COMPONENTS[component])
        return path

    def _look_up(self, reference: Reference) -> object:
        if reference.name not in self._values:
            if kind := self._types.get(reference.name):
                self.fail(f'{kind} {reference.name} has no value yet')
            self.fail(f'{reference.name} is not declared in this module')
        value: Any = self._values[reference.name]
        for index in self._path(reference):
            value = _element(value, index)
            if value is None:
                self.fail(f'{reference.name} has no such part')
        return copy.deepcopy(value)

    def _call(self, call: Call) -> object:
        arguments = self.value(call.arguments)
        if call.function in ARITHMETIC and all(map(_is_number, arguments)):
            if call.function == '/' and arguments[1] == 0.0:
                self.fail('division by zero')
            return ARITHMETIC[call.function](*arguments)
        if call.function not in ('offs', 'reltool') or len(arguments) != 4 or call.options:
            self.fail(f'{call.function} is not evaluated here; write its value instead')
        target, *displacement = arguments
        _, rotation = self.target(target)
        name = f'a displacement of {call.function}'
        step_mm = np.array([self.number(value, name) for value in displacement])
        if call.function == 'reltool':
            step_mm = rotation.apply(step_mm)
        return [(np.array(target[0]) + step_mm).tolist(), *target[1:]]


def _is_number(value: object) -> bool:
    return isinstance(value, float) and np.isfinite(value)


def _is_record(value: object, length: int) -> TypeGuard[list]:
    return isinstance(value, list) and len(value) == length


def _are_numbers(value: object, count: int) -> bool:
    return _is_record(value, count) and all(map(_is_number, value))


def _element(value: Any, index: Any) -> Any:
    """The element of an array or record, or the named value of a dict; None if it is missing."""
    if isinstance(value, dict):
        return value.get(index)
    return value[index] if isinstance(value, list) and index in range(len(value)) else None
