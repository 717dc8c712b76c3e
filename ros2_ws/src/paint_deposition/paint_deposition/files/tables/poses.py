"""A table of poses as a trajectory: timed poses, or programmed passes with their speeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.tables.headings import LENGTHS, SPEEDS, TIMES, Heading
from paint_deposition.files.tables.rotations import (
    QUATERNION,
    ROLL_PITCH_YAW,
    ROTATION_VECTOR,
    read_rotations,
)
from paint_deposition.files.tables.sheets import Sheet, text_of
from paint_deposition.files.tables.table import Table, is_comment, read_table
from paint_deposition.model.brush import MOST
from paint_deposition.motion.programmed import PROGRAMMED, Move, timed
from paint_deposition.motion.trajectory import Trajectory, numbered
from paint_deposition.motion.trigger import ONLY_BRUSH, relative_flow

SUFFIXES = ('.csv', '.tsv', '.txt')
# No cell is larger, and no run longer: the unit is another one.
LARGEST_CELL_M = 50.0
LONGEST_RUN_S = 1e6
# Names of columns, as `column_name` leaves them. The letter t is also an angle of Kawasaki's.
TIME = ('time', 'timestamp', 'stamp', 'timefromstart', 'elapsed', 'zeit', 't')
TRIGGER = ('spraying', 'trigger', 'gun', 'gunon', 'on', 'spray', 'sprayon', 'paint', 'painton')
FLOW = ('flow', 'relativeflow')
BRUSH = ('brush', 'brushnumber', 'brushno')
SPEED = ('speed', 'velocity', 'v', 'tcpspeed')
FRAME = ('frame', 'frameid')
POSITION = ('x', 'y', 'z')
# What a heading says of a pose beside the coordinate itself.
BESIDE = (
    'tcp', 'tool', 'pose', 'position', 'pos', 'actual', 'act', 'robot', 'header', 'field', 'p',
)  # fmt: skip
# What stands before an axis in the columns of an orientation, and what it makes of it.
ROTATED = {
    **dict.fromkeys(('orientation', 'quaternion', 'quat', 'q'), 'q'),
    **dict.fromkeys(('rot', 'rotation', 'rotvec', 'rv', 'r'), 'r'),
    **dict.fromkeys(('euler', 'angle', 'e'), 'e'),
}


@dataclass(frozen=True)
class PoseLayout:
    """What the user says of a table of poses; None is found or has its usual value.

    Attributes:
        trigger: heading of the column that opens the gun.
        pose_unit, angle_unit: for headings without a unit.
        rotation: see ``ROTATION_WORDS``.
    """

    trigger: str | None = None
    pose_unit: str | None = None
    rotation: str | None = None
    angle_unit: str | None = None


def is_pose_table(path: Path) -> bool:
    """Whether a file is named as a table."""
    return path.suffix.lower() in SUFFIXES


def read_pose_table(path: Path, layout: PoseLayout) -> Trajectory:
    """The motion in a table, with what was understood as a note.

    A table with times holds poses as recorded; one with speeds, passes as programmed, such as
    ``passes.csv``.

    Raises:
        RecordingError: naming the file, the column and the remedy.
    """
    table = PoseTable.read(path)
    try:
        return replace(_trajectory(table, layout), frame_id=table.frame_id())
    except RecordingError as error:
        reason = str(error).removeprefix(f'{path}: ')
        raise RecordingError(f'{path}: {reason}') from None


@dataclass(frozen=True)
class _Header:
    """A row that may have the headings of a table of poses."""

    header: int
    names: list[str]

    @property
    def score(self) -> int:
        known = {*TIME, *TRIGGER, *FLOW, *SPEED, *POSITION, *QUATERNION, *ROTATION_VECTOR}
        return len(known & {*self.names}) + bool({*TIME} & {*self.names})

    def serves(self) -> bool:
        return {*POSITION} <= {*self.names}


@dataclass(frozen=True)
class PoseTable:
    """A table whose columns are found by their names, see ``column_name``."""

    table: Table
    names: list[str]

    @staticmethod
    def read(path: Path) -> PoseTable:
        """Find the headings and the rows below them.

        Raises:
            RecordingError: the file cannot be read, or holds no rows.
        """
        sheet, found = read_table(path, RecordingError, _header)
        if found is None or not found.serves():
            first = ', '.join(map(text_of, sheet.rows[0])) if sheet.rows else 'none'
            raise RecordingError(
                f'{path}: no columns x, y, z; name them x_m, y_m, z_m (its first row: {first})'
            )
        headings = [Heading.of(text_of(cell)) for cell in sheet.rows[found.header]]
        below = range(found.header + 1, len(sheet.rows))
        used = [k for k in below if not is_comment(sheet.rows[k])]
        if not used:
            raise RecordingError(f'{path}: no poses below the row of headings')
        rows, lines = [sheet.rows[k] for k in used], [sheet.lines[k] for k in used]
        table = Table(path, sheet.form, headings, rows, lines, RecordingError)
        if not sheet.form.startswith('commas'):
            table, _ = table.with_decimal(range(len(headings)))
        return PoseTable(table, found.names)

    def __len__(self) -> int:
        return len(self.table)

    def find(self, *names: str) -> int | None:
        """The column that is called by the first of these names that occurs.

        Raises:
            RecordingError: two columns are called so.
        """
        for name in names:
            found = [column for column, its in enumerate(self.names) if its == name]
            if len(found) > 1:
                raise RecordingError(f'{self.written(found)} could all be {name}; keep one')
            if found:
                return found[0]
        return None

    def find_all(self, names: Sequence[str]) -> list[int] | None:
        """The columns of all these names, None if one of them is missing."""
        found = [column for name in names if (column := self.find(name)) is not None]
        return found if len(found) == len(names) else None

    def units(self, columns: Sequence[int]) -> set[str]:
        """The units of columns, '' for one without."""
        headings = [self.table.headings[column] for column in columns]
        return {heading.unit or heading.bracket for heading in headings}

    def written(self, columns: Sequence[int]) -> str:
        """Headings as the file has them; of all columns where none are given."""
        return self.table.written(columns or range(len(self.names)))

    def numbers(self, columns: Sequence[int]) -> np.ndarray:
        """The values (N, C) of columns.

        Raises:
            RecordingError: every cell that is no number, with its line, up to a few.
        """
        read = [self.table.numbers(column, finite=False, switch=True)[0] for column in columns]
        self.table.refuse_complaints()
        return np.stack(read, axis=1)

    def stamps_ns(self, column: int) -> tuple[np.ndarray, str]:
        """Times (N,) int64 [ns], exact, and their unit."""
        (unit,) = self.units([column])
        written = self.written([column])
        if (unit or 's') not in TIMES:
            raise RecordingError(f"{written}: '{unit}' is no unit of time")
        scale = TIMES[unit or 's']
        times = self.numbers([column])[:, 0]
        if not np.isfinite(times).all():
            raise RecordingError(f'{written} has a time that is not finite')
        # Written out, a time of a few letters may have a thousand million digits.
        span_s = (times.max() - times.min()) * scale
        if span_s > LONGEST_RUN_S or np.abs(times).max() * scale * 1e9 >= 2**63:
            raise RecordingError(
                f'{written} spans {span_s:.3g} s; write its unit in the heading, as in time [ms]'
            )
        try:
            cells = [text.replace(',', '.') for text in self.table.texts(column)]
            stamps = [round(Decimal(cell) * round(scale * 1e9)) for cell in cells]
        except InvalidOperation:
            raise RecordingError(f'{written} has a word for a number; give numbers') from None
        return np.array(stamps, dtype=np.int64), unit or 's'

    def frame_id(self) -> str:
        """The frame that a column names, '' if there is none.

        Raises:
            RecordingError: it names several.
        """
        column = self.find(*FRAME)
        names = set() if column is None else {*self.table.texts(column)}
        if len(names) > 1:
            raise RecordingError(f'poses in frames {", ".join(sorted(names))}; give one frame')
        return ''.join(names).lstrip('/')


def column_name(heading: Heading) -> str:
    """'x' of 'X [mm]' and 'tcp.position.x', 'qw' of '/pose/orientation/w'."""
    *before, last = heading.words or ('',)
    turned = [ROTATED[word] for word in before if word in ROTATED]
    if turned and last in ('x', 'y', 'z', 'w'):
        return turned[-1] + last
    kept = [word for word in heading.words if word not in BESIDE] or [last]
    # A logger's path to a coordinate: what is before it names the message.
    known = (*POSITION, *QUATERNION, *ROTATION_VECTOR, *ROLL_PITCH_YAW)
    return kept[-1] if kept[-1] in known else ''.join(kept)


def _header(sheet: Sheet, row: int) -> _Header | None:
    names = [column_name(Heading.of(text_of(cell))) for cell in sheet.rows[row]]
    return _Header(row, names) if any(name in POSITION for name in names) else None


def _trajectory(table: PoseTable, layout: PoseLayout) -> Trajectory:
    positions, unit = _positions_m(table, layout.pose_unit)
    quaternions, orientation = read_rotations(table, layout.rotation, layout.angle_unit)
    flows, trigger = _flows(table, layout.trigger)
    brushes, by_brush = _brushes(table)
    if flows is None and brushes.any():
        flows = np.ones(len(brushes))
    said = f'{len(table)} poses: x y z in {unit}; {orientation}; {trigger}{by_brush}'
    time, speed = table.find(*TIME), table.find(*SPEED)
    if time is not None:
        stamps, time_unit = table.stamps_ns(time)
        on = slice(0, 0) if flows is None else slice(None)
        levels = np.zeros(len(stamps)) if flows is None else flows
        return Trajectory(
            stamps, positions, quaternions, trigger_stamps_ns=stamps[on],
            trigger_flow=levels[on], trigger_brush=numbered(brushes[on]),
            notes=(f'{said}; {table.written([time])} in {time_unit}',),
        )  # fmt: skip
    if speed is None:
        raise RecordingError(
            f'no time among the columns {table.written(())}; give a column time_s, or '
            'speed_m_per_s for programmed passes'
        )
    (unit,) = table.units([speed])
    if (unit or 'm/s') not in SPEEDS:
        raise RecordingError(f"{table.written([speed])}: '{unit}' is no unit of speed")
    speeds = table.numbers([speed])[:, 0] * SPEEDS[unit or 'm/s']
    spraying = np.ones(len(speeds)) if flows is None else flows
    columns = (speeds.tolist(), spraying.tolist(), table.table.lines, brushes.tolist())
    moves = [
        Move(position, quaternion, speed, bool(flow), line=line, flow=flow or 1.0, brush=brush)
        for position, quaternion, speed, flow, line, brush in zip(
            positions, quaternions, *columns, strict=True
        )
    ]
    return replace(timed(moves, flows is not None), notes=(PROGRAMMED, said))


def _positions_m(table: PoseTable, given: str | None) -> tuple[np.ndarray, str]:
    """Positions (N, 3) [m], and their unit as it was understood."""
    columns = table.find_all(POSITION) or []
    units = table.units(columns)
    if len(units) > 1 or not units <= {'', 'm', 'mm', 'cm'}:
        found = ', '.join(sorted(unit or 'no unit' for unit in units))
        raise RecordingError(f'{table.written(columns)} in {found}; give all in m or in mm')
    unit = units.pop() or given or ''
    positions = table.numbers(columns) * LENGTHS[unit or 'm']
    largest = float(np.nanmax(np.abs(positions), initial=0.0))
    if not unit and largest > LARGEST_CELL_M:
        raise RecordingError(
            f'{table.written(columns)} reach {largest:.4g} and have no unit; write it in the '
            'heading, as in x [mm], or give --pose-unit mm'
        )
    return positions, unit or 'm (no unit is given)'


def _flows(table: PoseTable, name: str | None) -> tuple[np.ndarray | None, str]:
    """Flow (N,) from each row on, relative to the calibrated one, and how it was read."""
    texts = [heading.text for heading in table.table.headings]
    if name is None:
        trigger, flow = table.find(*TRIGGER), table.find(*FLOW)
    elif name.strip() in texts:
        trigger, flow = texts.index(name.strip()), None
    else:
        raise RecordingError(f'no column is called {name}; {did_you_mean(name, texts)}')
    if trigger is None and flow is None:
        return None, 'no trigger, the gun sprays throughout'
    if flow is not None and table.units([flow]) != {''}:
        raise RecordingError(
            f'{table.written([flow])}: the flow is relative to the calibrated one, 1 for the '
            'same; divide by it and drop the unit'
        )
    used = [column for column in (trigger, flow) if column is not None]
    values = table.numbers(used)
    on = np.nan_to_num(values[:, 0]) != 0.0
    relative = values[:, -1] if flow is not None else np.full(len(on), np.nan)
    flows = [relative_flow(bool(a), float(b)) for a, b in zip(on, relative, strict=True)]
    return np.array(flows), f'gun by {table.written(used)}'


def _brushes(table: PoseTable) -> tuple[np.ndarray, str]:
    """Number of the brush (N,) from each row on, and how it was read."""
    column = table.find(*BRUSH)
    if column is None:
        return np.full(len(table), ONLY_BRUSH, np.int64), ''
    values, written = table.numbers([column])[:, 0], table.written([column])
    strange = np.flatnonzero(~((values >= 0) & (values <= MOST) & (values == np.round(values))))
    if len(strange):
        raise RecordingError(
            f'line {table.table.lines[strange[0]]}: {written} is {values[strange[0]]:g}; give the '
            'number of a brush, 0 for the only one'
        )
    return values.astype(np.int64), f', brush by {written}'
