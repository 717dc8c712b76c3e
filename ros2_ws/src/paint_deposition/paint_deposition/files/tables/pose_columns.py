"""The columns of a table of poses, known by their names."""

from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError, quoted
from paint_deposition.files.tables.headings import (
    ANGLES,
    BESIDE,
    TIMES,
    Heading,
    find_table,
    headings_in,
    rows_below,
)
from paint_deposition.files.tables.sheets import text_of
from paint_deposition.files.tables.table import Table
from paint_deposition.request import CONVENTIONS, ROTATION_WORDS

if TYPE_CHECKING:
    from paint_deposition.files.recordings.joint_states import Robot

POSITION = ('x', 'y', 'z')
QUATERNION = ('qx', 'qy', 'qz', 'qw')
SCALAR_FIRST = ('q2', 'q3', 'q4', 'q1')  # of ABB, in the order of the others
ROTATION_VECTOR, ROLL_PITCH_YAW = ('rx', 'ry', 'rz'), ('roll', 'pitch', 'yaw')
# What stands before an axis in the columns of an orientation, and what it makes of it.
ROTATED = {
    **dict.fromkeys(('orientation', 'quaternion', 'quat', 'q'), 'q'),
    **dict.fromkeys(('rot', 'rotation', 'rotvec', 'rv', 'r'), 'r'),
    **dict.fromkeys(('euler', 'angle', 'e'), 'e'),
}


def read_columns(path: Path, robot: 'Robot | None' = None) -> Table:
    """Find the headings and the rows below them; without them the file is refused.

    With a robot, the columns are those of its joints.
    """
    alone = 'a motion is read from a file with one such sheet: save it by itself'
    known = partial(_known, robot=robot)
    sheet, header = find_table(path, RecordingError, known, several=alone)
    if header is None:
        first = quoted(', '.join(map(text_of, sheet.rows[0]))) if sheet.rows else 'none'
        if robot is not None and sheet.rows:
            robot.recorded_joints(_by_text(headings_in(sheet.rows[0])), str(path), True)
        raise RecordingError(
            f'{path}: no columns x, y, z; name them x_m, y_m, z_m (its first row: {first}); '
            'joints are read with --urdf'
        )
    headings = headings_in(sheet.rows[header])
    headings, below = rows_below(sheet, headings, header + 1)
    table = Table(path, sheet.form, headings, sheet.rows, sheet.lines, RecordingError)
    table = table.select(below)
    if not len(table):
        raise table.error('no poses below the row of headings')
    for k, row in enumerate(table.rows):
        if any(cell != '' for cell in row[len(headings) :]):
            table.add_width_error(k)
    table.refuse_errors()
    table = table.without_units_in_cells(range(len(headings)))
    if not sheet.form.startswith('commas'):
        table = table.with_decimal(range(len(headings)), certain=False)
    return table


def find(table: Table, *names: str) -> int | None:
    """The column called by the first of these names that occurs; two of a name are refused."""
    for name in names:
        found = [k for k, its in enumerate(table.headings) if column_name(its) == name]
        if len(found) > 1:
            raise RecordingError(f'{table.written(found)} could all be {name}; keep one')
        if found:
            return found[0]
    return None


def find_all(table: Table, names: Sequence[str]) -> list[int] | None:
    """The columns of all these names, None if one of them is missing."""
    found = [column for name in names if (column := find(table, name)) is not None]
    return found if len(found) == len(names) else None


def joints_of(table: Table, robot: 'Robot') -> tuple[np.ndarray, dict[str, str]]:
    """The values (N, J) of a robot's moving joints [rad or m], and their headings."""
    columns = robot.recorded_joints(_by_text(table.headings), str(table.path), numbered=True)
    units = [table.headings[column].unit for column in columns.values()]
    values = robot.in_si(values_of(table, [*columns.values()]), str(table.path), units)
    return values, {joint: table.headings[column].text for joint, column in columns.items()}


def units_of(table: Table, columns: Sequence[int]) -> set[str]:
    """The units of columns, '' for one without."""
    return {table.headings[column].unit for column in columns}


def values_of(table: Table, columns: Sequence[int]) -> np.ndarray:
    """The numbers (N, C) of columns; cells that are none are refused with their lines."""
    read = [table.numbers(column, finite=False, switch=True) for column in columns]
    table.refuse_errors()
    return np.stack(read, axis=1)


def stamps_of(table: Table, column: int) -> tuple[np.ndarray, str]:
    """Times (N,) int64 [ns], exact, and their unit."""
    (unit,) = units_of(table, [column])
    written = table.written([column])
    if (unit or 's') not in TIMES:
        raise RecordingError(f"{written}: '{unit}' is no unit of time")
    scale = TIMES[unit or 's']
    if clock := next((text for text in table.texts(column) if ':' in text), ''):
        raise RecordingError(f"{written} has the time of day '{clock}'; give seconds, as time_s")
    times = values_of(table, [column])[:, 0]
    if not np.isfinite(times).all():
        raise RecordingError(f'{written} has a time that is not finite')
    # Written out, a time of a few letters may have a thousand million digits.
    span_s = (times.max() - times.min()) * scale
    # No run is longer: the unit is another one.
    if span_s > 1e6 or np.abs(times).max() * scale * 1e9 >= 2**63:
        raise RecordingError(
            f'{written} spans {span_s:.3g} s; write its unit in the heading, as in time [ms]'
        )
    try:
        cells = [text.replace(',', '.').replace('−', '-') for text in table.texts(column)]
        stamps = [round(Decimal(cell) * round(scale * 1e9)) for cell in cells]
    except InvalidOperation:
        raise RecordingError(f'{written} has a word for a number; give numbers') from None
    return np.array(stamps, dtype=np.int64), unit or 's'


def column_name(heading: Heading) -> str:
    """'x' of 'X [mm]' and 'tcp.position.x', 'qw' of '/pose/orientation/w'."""
    *before, last = heading.words or ('',)
    turned = [ROTATED[word] for word in before if word in ROTATED]
    if turned and last in ('x', 'y', 'z', 'w'):
        return turned[-1] + last
    # What a heading says of a pose beside the coordinate itself.
    beside = {*BESIDE, 'tcp', 'tool', 'pose', 'robot', 'header', 'field', 'p'}
    kept = [word for word in heading.words if word not in beside] or [last]
    # A logger's path to a coordinate: what is before it names the message.
    known = (*POSITION, *QUATERNION, *ROTATION_VECTOR, *ROLL_PITCH_YAW)
    return kept[-1] if kept[-1] in known else ''.join(kept)


def _by_text(headings: Sequence[Heading]) -> dict[str, int]:
    """The column of each heading, by its words."""
    return {''.join(heading.words): k for k, heading in enumerate(headings) if heading.words}


def _known(headings: list[Heading], robot: 'Robot | None') -> int:
    names = {column_name(heading) for heading in headings}
    if robot is None:
        return len(names - {''}) if {*POSITION} <= names else 0
    try:
        return len(robot.recorded_joints(_by_text(headings), '', numbered=True))
    except RecordingError:
        return 0


# Columns of angles, what they are unless the user says it ('' for not known), and whether each is
# that of an axis, else they are in the order in which a convention takes them.
ANGLE_COLUMNS = (
    (ROTATION_VECTOR, 'rotvec', True), (ROLL_PITCH_YAW, 'rpy', True),
    (('ex', 'ey', 'ez'), '', True), (('a', 'b', 'c'), 'kuka', False),
    (('w', 'p', 'r'), 'fanuc', False), (('alpha', 'beta', 'gamma'), '', False),
    (('phi', 'theta', 'psi'), '', False), (('e1', 'e2', 'e3'), '', False),
    (('o', 'a', 't'), '', False),
)  # fmt: skip


def read_rotations(
    table: Table, rotation: str | None, angle_unit: str | None
) -> tuple[np.ndarray, str]:
    """Quaternions (N, 4), scalar last, and how they were read.

    ``rotation`` says what three numbers of an orientation are, see ROTATION_WORDS; ``angle_unit``
    is 'deg' or 'rad' for headings without. Raises RecordingError without an orientation, or with
    one that can be read in two ways.
    """
    if rotation is None:
        for names in (QUATERNION, SCALAR_FIRST):
            if columns := find_all(table, names):
                order = 'scalar last' if names == QUATERNION else 'q1 the scalar'
                note = f'quaternion {table.written(columns)} ({order})'
                return values_of(table, columns), note
    columns, by_axis, convention = _angle_columns(table, rotation)
    written, units = table.written(columns), units_of(table, columns)
    if units not in ({'deg'}, {'rad'}, {''}):
        found = ', '.join(sorted(units))
        raise RecordingError(f'{written} in {found}; give all in deg or in rad')
    of_maker = 'deg' if convention in {*CONVENTIONS} - {'rpy'} else 'rad'
    unit = units.pop() or angle_unit or of_maker
    angles = values_of(table, columns) * ANGLES[unit]
    largest = np.nanmax(np.abs(angles), initial=0.0)
    if unit == 'rad' and largest > 2.0 * np.pi + 1e-6:
        raise RecordingError(
            f'{written} reach {largest:.4g} and are read in rad; write the unit in the heading, '
            'as in roll [deg], or give --angle-unit deg'
        )
    if convention == 'rotvec':
        return Rotation.from_rotvec(angles).as_quat(), f'rotation vector {written} in {unit}'
    sequence = CONVENTIONS.get(convention, convention)
    if by_axis and len(set(sequence.lower())) == 3:
        angles = angles[:, ['xyz'.index(letter) for letter in sequence.lower()]]
    axes = "the tool's axes" if sequence.isupper() else 'fixed axes'
    how = f'Euler angles {written} in {unit}, {sequence} about {axes}'
    return Rotation.from_euler(sequence, angles).as_quat(), how


def _angle_columns(table: Table, rotation: str | None) -> tuple[list[int], bool, str]:
    """The three columns, whether each is that of an axis, x y z, and what they are."""
    for names, usual, by_axis in ANGLE_COLUMNS:
        if columns := find_all(table, names):
            doubt = '' if usual else 'are Euler angles of an unknown convention'
            if usual == 'rotvec' and 'deg' in units_of(table, columns):
                doubt = 'in degrees may be Euler angles or a rotation vector'
            if doubt and not rotation:
                raise RecordingError(
                    f'{table.written(columns)} {doubt}; give --rotation: {ROTATION_WORDS}'
                )
            return columns, by_axis, rotation or usual
    raise RecordingError(
        f'no orientation among the columns {table.written(())}; give qx qy qz qw, rx ry rz '
        '(rotation vector) or roll pitch yaw'
    )
