"""Orientations in a table of poses: quaternions, rotation vectors and Euler angles."""

import re
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.files.tables import pose_columns
from paint_deposition.files.tables.headings import ANGLES
from paint_deposition.files.tables.pose_columns import QUATERNION, PoseTable

ABB_QUATERNION = ('q2', 'q3', 'q4', 'q1')  # the scalar is the first one, q1
EULER = ('ex', 'ey', 'ez')
# Angles in the order in which a convention takes them, and the maker who calls them so.
IN_ORDER = {
    ('a', 'b', 'c'): 'kuka', ('w', 'p', 'r'): 'fanuc', ('alpha', 'beta', 'gamma'): '',
    ('phi', 'theta', 'psi'): '', ('e1', 'e2', 'e3'): '', ('o', 'a', 't'): '', EULER: '',
}  # fmt: skip
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


def is_rotation(name: str) -> bool:
    """Whether a name is that of a rotation vector or of a convention of angles."""
    known = name.lower() in (ROTVEC, *CONVENTIONS)
    return known or re.fullmatch(r'[xyz]{3}|[XYZ]{3}', name) is not None


def read_rotations(
    table: PoseTable, rotation: str | None, angle_unit: str | None
) -> tuple[np.ndarray, str]:
    """Quaternions (N, 4), scalar last, and how they were read.

    ``rotation`` says what three numbers of an orientation are, see ROTATION_WORDS; ``angle_unit``
    is 'deg' or 'rad' for headings without. Raises RecordingError without an orientation, or with
    one that can be read in two ways.
    """
    if rotation is None:
        for names in (QUATERNION, ABB_QUATERNION):
            if columns := table.find_all(names):
                order = 'scalar last' if names == QUATERNION else 'q1 the scalar'
                note = f'quaternion {table.written(columns)} ({order})'
                return table.values(columns), note
    columns, by_axis, convention = _angle_columns(table, rotation)
    written = table.written(columns)
    unit = _unit(table, columns, convention, angle_unit)
    angles = table.values(columns) * ANGLES[unit]
    largest = np.nanmax(np.abs(angles), initial=0.0)
    if unit == 'rad' and largest > LARGEST_RAD:
        raise RecordingError(
            f'{written} reach {largest:.4g} and are read in rad; write the unit in the heading, '
            'as in roll [deg], or give --angle-unit deg'
        )
    if convention == ROTVEC:
        return Rotation.from_rotvec(angles).as_quat(), f'rotation vector {written} in {unit}'
    sequence = CONVENTIONS.get(convention.lower(), convention)
    if by_axis and len(set(sequence.lower())) == 3:
        angles = angles[:, ['xyz'.index(letter) for letter in sequence.lower()]]
    axes = "the tool's axes" if sequence.isupper() else 'fixed axes'
    how = f'Euler angles {written} in {unit}, {sequence} about {axes}'
    return Rotation.from_euler(sequence, angles).as_quat(), how


def _angle_columns(table: PoseTable, rotation: str | None) -> tuple[list[int], bool, str]:
    """The three columns, whether each is that of an axis, x y z, and what they are."""
    if columns := table.find_all(pose_columns.ROTATION_VECTOR):
        if rotation is None and 'deg' in table.units(columns):
            raise RecordingError(
                f'{table.written(columns)} in degrees may be Euler angles or a rotation vector; '
                f'give --rotation: {ROTATION_WORDS}'
            )
        return columns, True, rotation or ROTVEC
    if columns := table.find_all(pose_columns.ROLL_PITCH_YAW):
        return columns, True, rotation or 'rpy'
    for names, usual in IN_ORDER.items():
        if columns := table.find_all(names):
            if not (rotation or usual):
                raise RecordingError(
                    f'{table.written(columns)} are Euler angles of an unknown convention; give '
                    f'--rotation: {ROTATION_WORDS}'
                )
            return columns, names == EULER, rotation or usual
    raise RecordingError(
        f'no orientation among the columns {table.written(())}; give qx qy qz qw, rx ry rz '
        '(rotation vector) or roll pitch yaw'
    )


def _unit(
    table: PoseTable, columns: Sequence[int], convention: str, angle_unit: str | None
) -> str:
    """The unit of the angles: their headings', else the one given, else their maker's."""
    units = table.units(columns)
    if units in ({'deg'}, {'rad'}):
        return units.pop()
    if units != {''}:
        found = ', '.join(sorted(units))
        raise RecordingError(f'{table.written(columns)} in {found}; give all in deg or in rad')
    of_maker = 'deg' if convention in ('kuka', 'abb', 'fanuc', 'staubli', 'kawasaki') else 'rad'
    return angle_unit or of_maker
