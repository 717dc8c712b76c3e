"""The operators and functions of ABB RAPID on numbers, targets and frames.

As there, angles are in degrees, lengths in mm, and quaternions have the scalar first.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import quoted

Frame = tuple[np.ndarray, Rotation]  # position [mm] and orientation


def frame(pose: Any) -> Frame:
    """The frame of [[x, y, z], [q1, q2, q3, q4], ...]; ValueError if it is none."""
    position, quaternion = pose[:2] if isinstance(pose, list) and len(pose) > 1 else ([], [])
    if not (_are_numbers(position, 3) and _are_numbers(quaternion, 4)):
        raise ValueError(
            f'{quoted(pose)} is no position [x, y, z] with a quaternion [q1, q2, q3, q4]'
        )
    norm = math.hypot(*quaternion)
    # Quaternions are written with four digits; further off is damage, not rounding.
    if abs(norm - 1.0) > 0.01:
        raise ValueError(f'quaternion {quaternion} has the norm {norm:.4f} instead of 1')
    return np.array(position), Rotation.from_quat([*quaternion[1:], quaternion[0]])


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


def _wxyz(rotation: Rotation) -> list[float]:
    x, y, z, w = rotation.as_quat().tolist()
    return [w, x, y, z]


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
        rest[0] = _wxyz(rotation * Rotation.from_euler('XYZ', angles, degrees=True))
    return [position, *rest]


def _pose_mult(first: list, second: list) -> list:
    position, rotation = product(frame(first), frame(second))
    return [position.tolist(), _wxyz(rotation)]


def _to_digits(to_whole: Callable[[float], float]) -> Callable:
    return lambda value, dec=0.0: to_whole(value * 10.0**dec) / 10.0**dec


def _of_vectors(calculate: Callable) -> Callable:
    """An operator that takes positions too."""

    def calculated(a: Any, b: Any) -> Any:
        if not (isinstance(a, list) or isinstance(b, list)):
            return calculate(a, b)
        if isinstance(a, list) and isinstance(b, list) and np.shape(a) != np.shape(b):
            raise ValueError('they have not the same size')
        return calculate(np.array(a), np.array(b)).tolist()

    return calculated


OPERATORS: dict[str, Callable] = {
    '+': _of_vectors(operator.add), '-': _of_vectors(operator.sub),
    '*': _of_vectors(operator.mul), '/': operator.truediv,
    'div': lambda a, b: float(math.trunc(a / b)), 'mod': math.fmod,
    '=': operator.eq, '<>': operator.ne, '<': operator.lt, '>': operator.gt,
    '<=': operator.le, '>=': operator.ge,
    'and': lambda a, b: a and b, 'or': lambda a, b: a or b, 'xor': operator.ne,
}  # fmt: skip
FUNCTIONS: dict[str, Callable] = {
    'abs': abs, 'sqrt': math.sqrt, 'pow': math.pow,
    'round': _to_digits(lambda a: math.copysign(math.floor(abs(a) + 0.5), a)),
    'trunc': _to_digits(math.trunc),
    'sin': lambda a: math.sin(math.radians(a)), 'cos': lambda a: math.cos(math.radians(a)),
    'tan': lambda a: math.tan(math.radians(a)), 'atan': lambda x: math.degrees(math.atan(x)),
    'atan2': lambda y, x: math.degrees(math.atan2(y, x)),
    'dim': lambda array, axis: float(np.shape(array)[int(axis) - 1]),
    'offs': _offs, 'reltool': _rel_tool, 'posemult': _pose_mult, 'distance': math.dist,
    'orientzyx': lambda *zyx: _wxyz(Rotation.from_euler('ZYX', zyx, degrees=True)),
}  # fmt: skip
