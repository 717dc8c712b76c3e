"""Orientations in a table of poses: quaternions, rotation vectors and Euler angles."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.files.pose_tables import headings as h
from paint_deposition.files.pose_tables.headings import Headings

# Makers' conventions in the letters of scipy: capital letters turn about the axes of the tool as
# it goes, small ones about those of the world.
CONVENTIONS = {
    'kuka': 'ZYX', 'abb': 'ZYX', 'fanuc': 'xyz', 'rpy': 'xyz', 'staubli': 'XYZ', 'kawasaki': 'ZYZ',
}  # fmt: skip
ROTATION_WORDS = (
    "'rotvec' for a rotation vector, three letters for Euler angles (ZYX about the axes of the "
    'tool, xyz about fixed axes), or kuka, abb, fanuc, rpy, staubli, kawasaki'
)
ROTVEC = 'rotvec'
LARGEST_RAD = 2.0 * np.pi + 1e-6

Numbers = Callable[[Sequence[int]], np.ndarray]


def is_rotation(name: str) -> bool:
    """Whether a name is that of a rotation vector or of a convention of angles."""
    known = name.lower() in (ROTVEC, *CONVENTIONS)
    return known or re.fullmatch(r'[xyz]{3}|[XYZ]{3}', name) is not None


def read_rotations(
    headings: Headings, numbers: Numbers, rotation: str | None, angle_unit: str | None
) -> tuple[np.ndarray, str]:
    """Quaternions (N, 4), scalar last, and how they were read.

    Args:
        headings: of the table.
        numbers: gives the values (N, C) of columns.
        rotation: what three numbers of an orientation are, or None; see ``ROTATION_WORDS``.
        angle_unit: 'deg' or 'rad' for headings that tell no unit, or None.

    Raises:
        RecordingError: there is no orientation, or it can be read in two ways.
    """
    if rotation is None:
        for names in (h.QUATERNION, h.QUATERNION_ABB):
            columns = headings.find_all(names)
            if columns:
                order = 'scalar last' if names == h.QUATERNION else 'q1 the scalar'
                return numbers(columns), f'quaternion {headings.written(columns)} ({order})'
    columns, convention = _angle_columns(headings, rotation)
    written = headings.written(columns)
    unit = _unit(headings, columns, convention, angle_unit)
    angles = numbers(columns) * h.UNITS[unit]
    if unit == 'rad' and np.nanmax(np.abs(angles), initial=0.0) > LARGEST_RAD:
        raise RecordingError(
            f'{written} reach {np.nanmax(np.abs(angles)):.4g} and are read in rad; write the unit '
            'in the heading, as in roll [deg], or give --angle-unit deg'
        )
    if convention == ROTVEC:
        return Rotation.from_rotvec(angles).as_quat(), f'rotation vector {written} in {unit}'
    sequence = CONVENTIONS.get(convention.lower(), convention)
    named = (h.ROTATION_VECTOR, h.ROLL_PITCH_YAW, h.EULER)
    by_axis = columns in [headings.find_all(names) for names in named]
    if by_axis and len(set(sequence.lower())) == 3:
        angles = angles[:, ['xyz'.index(letter) for letter in sequence.lower()]]
    axes = "the tool's axes" if sequence.isupper() else 'fixed axes'
    how = f'Euler angles {written} in {unit}, {sequence} about {axes}'
    return Rotation.from_euler(sequence, angles).as_quat(), how


def _angle_columns(headings: Headings, rotation: str | None) -> tuple[list[int], str]:
    """The three columns and what they are."""
    if columns := headings.find_all(h.ROTATION_VECTOR):
        in_degrees = any(headings.all[column].unit in ('deg', '°') for column in columns)
        if rotation is None and in_degrees:
            raise RecordingError(
                f'{headings.written(columns)} in degrees may be Euler angles or a rotation '
                f'vector; give --rotation: {ROTATION_WORDS}'
            )
        return columns, rotation or ROTVEC
    if columns := headings.find_all(h.ROLL_PITCH_YAW):
        return columns, rotation or 'rpy'
    usual_of = {h.IN_ORDER[0]: 'kuka', h.IN_ORDER[1]: 'fanuc'}
    for names in (*h.IN_ORDER, h.EULER):
        usual = usual_of.get(names)
        if columns := headings.find_all(names):
            if rotation is None and usual is None:
                raise RecordingError(
                    f'{headings.written(columns)} are Euler angles of an unknown convention; '
                    f'give --rotation: {ROTATION_WORDS}'
                )
            return columns, rotation or str(usual)
    raise RecordingError(
        f'no orientation among the columns {headings.written(range(len(headings.all)))}; give '
        'qx qy qz qw, rx ry rz (rotation vector) or roll pitch yaw'
    )


def _unit(
    headings: Headings, columns: Sequence[int], convention: str, angle_unit: str | None
) -> str:
    """The unit of the angles: their headings', else the one given, else their maker's."""
    told = {headings.all[column].unit for column in columns}
    if told <= {'deg', '°'} or told == {'rad'}:
        return 'rad' if told == {'rad'} else 'deg'
    if told != {''}:
        found = ', '.join(sorted(told))
        raise RecordingError(f'{headings.written(columns)} in {found}; give all in deg or in rad')
    of_maker = 'deg' if convention in ('kuka', 'abb', 'fanuc', 'staubli', 'kawasaki') else 'rad'
    return angle_unit or of_maker
