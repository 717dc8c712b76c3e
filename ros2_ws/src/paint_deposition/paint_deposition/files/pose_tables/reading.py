"""A table of poses as a trajectory: timed poses, or programmed passes with their speeds."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from functools import cached_property
from pathlib import Path

import numpy as np

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.pose_tables import headings as h
from paint_deposition.files.pose_tables.headings import Heading, Headings
from paint_deposition.files.pose_tables.rotations import read_rotations
from paint_deposition.files.text import decoded
from paint_deposition.model.brush import MOST
from paint_deposition.motion.programmed import PROGRAMMED, Move, timed
from paint_deposition.motion.trajectory import Trajectory, numbered
from paint_deposition.motion.trigger import ONLY_BRUSH, relative_flow

SUFFIXES = ('.csv', '.tsv', '.txt')
SEPARATORS = ';\t,|'
SWITCHED = {'true': 1.0, 'on': 1.0, 'yes': 1.0, 'false': 0.0, 'off': 0.0, 'no': 0.0}
# No cell is larger, and no run longer: the unit is another one.
LARGEST_CELL_M = 50.0
LONGEST_RUN_S = 1e6
MOST_COMPLAINTS = 5


def is_pose_table(path: Path) -> bool:
    """Whether a file is named as a table."""
    return path.suffix.lower() in SUFFIXES


@dataclass(frozen=True)
class PoseTable:
    """Rows of a table: its headings, its cells and the lines that they stand in."""

    headings: Headings
    rows: list[list[str]]
    lines: list[int]
    decimal_comma: bool

    @staticmethod
    def read(path: Path) -> PoseTable:
        """Read a text file whose first row, after comments, holds the headings.

        Raises:
            RecordingError: the file cannot be read, or holds no rows.
        """
        try:
            content = path.read_bytes()
        except OSError as error:
            raise RecordingError(f'cannot read {path}: {error.strerror}') from None
        text, _ = decoded(content) or (content.decode('cp1252', errors='replace'), '')
        lines = text.splitlines()
        used = [k for k, line in enumerate(lines) if line.strip() and line.strip()[0] != '#']
        # A heading may be marked as a comment, as NumPy writes it.
        first = used[0] if used else 0
        marked = [k for k in range(first) if _separator(lines[k]) and 'x' in lines[k].casefold()]
        if used and marked and lines[first].strip()[0] in '+-.0123456789':
            used = [marked[-1], *used]
        if len(used) < 2:
            raise RecordingError(f'{path}: no poses; expected a row of headings and rows below it')
        separator = _separator(lines[used[0]])
        if not separator:
            raise RecordingError(f'{path}: one column only; separate columns by commas')
        texts = list(csv.reader((lines[k] for k in used), delimiter=separator))
        rows = [[cell.strip() for cell in row] for row in texts]
        if len(rows) < 2:
            raise RecordingError(f'{path}: no poses; a quotation mark in it is not closed')
        headings = Headings([Heading.of(text) for text in rows[0]])
        comma = separator != ',' and any(',' in cell for row in rows[1:] for cell in row)
        return PoseTable(headings, rows[1:], [k + 1 for k in used[1:]], comma)

    def numbers(self, columns: Sequence[int]) -> np.ndarray:
        """The values (N, C) of columns.

        Raises:
            RecordingError: every cell that is no number, with its line, up to a few.
        """
        values = np.full((len(self.rows), len(columns)), np.nan)
        wrong = []
        for index, row in enumerate(self.rows):
            for place, column in enumerate(columns):
                cell = row[column] if column < len(row) else ''
                try:
                    values[index, place] = self._number(cell)
                except ValueError:
                    name = self.headings.all[column].text.strip()
                    wrong.append(f"line {self.lines[index]}: {name} is '{cell}'")
        if wrong:
            more = len(wrong) - MOST_COMPLAINTS
            rest = f'; and {more} more' if more > 0 else ''
            raise RecordingError('; '.join(wrong[:MOST_COMPLAINTS]) + rest + '; give numbers')
        return values

    def _number(self, cell: str) -> float:
        cell = cell.replace(',', '.') if self.decimal_comma else cell
        return SWITCHED[cell.lower()] if cell.lower() in SWITCHED else float(cell)

    def stamps_ns(self, column: int) -> tuple[np.ndarray, str]:
        """Times (N,) int64 [ns], exact, and their unit."""
        unit = self.headings.all[column].unit or 's'
        if unit not in h.TIMES:
            raise RecordingError(f"{self.headings.written([column])}: '{unit}' is no unit of time")
        written, scale = self.headings.written([column]), round(h.UNITS[unit] * 1e9)
        times = self.numbers([column])[:, 0].tolist()
        if not all(map(math.isfinite, times)):
            raise RecordingError(f'{written} has a time that is not finite')
        # Written out, a time of a few letters may have a thousand million digits.
        span_s = (max(times) - min(times)) * h.UNITS[unit]
        if span_s > LONGEST_RUN_S or max(map(abs, times)) * scale >= 2**63:
            raise RecordingError(
                f'{written} spans {span_s:.3g} s; write its unit in the heading, as in time [ms]'
            )
        try:
            cells = [row[column].replace(',', '.') for row in self.rows]
            stamps = [round(Decimal(cell) * scale) for cell in cells]
        except InvalidOperation:
            raise RecordingError(f'{written} has a word for a number; give numbers') from None
        return np.array(stamps, dtype=np.int64), unit

    @cached_property
    def frame_id(self) -> str:
        """The frame that a column names, '' if there is none.

        Raises:
            RecordingError: it names several.
        """
        column = self.headings.find(*h.FRAME)
        names = set() if column is None else {row[column] for row in self.rows}
        if len(names) > 1:
            raise RecordingError(f'poses in frames {", ".join(sorted(names))}; give one frame')
        return ''.join(names).lstrip('/')


@dataclass(frozen=True)
class PoseLayout:
    """What the user says of a table of poses; None is found or has its usual value.

    Attributes:
        trigger: heading of the column that opens the gun.
        pose_unit, angle_unit: for headings that tell no unit.
        rotation: see ``ROTATION_WORDS``.
    """

    trigger: str | None = None
    pose_unit: str | None = None
    rotation: str | None = None
    angle_unit: str | None = None


def read_pose_table(path: Path, layout: PoseLayout) -> Trajectory:
    """The motion in a table, with what was understood as a note.

    A table with times holds poses as recorded; one with speeds, passes as programmed, such as
    ``passes.csv``.

    Raises:
        RecordingError: naming the file, the column and the remedy.
    """
    table = PoseTable.read(path)
    try:
        return replace(_trajectory(table, layout), frame_id=table.frame_id)
    except RecordingError as error:
        raise RecordingError(f'{path}: {error}') from None


def _trajectory(table: PoseTable, layout: PoseLayout) -> Trajectory:
    headings = table.headings
    positions, unit = read_positions_m(table, layout.pose_unit)
    quaternions, orientation = read_rotations(
        headings, table.numbers, layout.rotation, layout.angle_unit
    )
    flows, trigger = _flows(table, layout.trigger)
    brushes, by_brush = _brushes(table)
    if flows is None and brushes.any():
        flows = np.ones(len(brushes))
    said = f'{len(table.rows)} poses: x y z in {unit}; {orientation}; {trigger}{by_brush}'
    time, speed = headings.find(*h.TIME), headings.find(*h.SPEED)
    if time is not None:
        stamps, time_unit = table.stamps_ns(time)
        said = f'{said}; {headings.written([time])} in {time_unit}'
        on = slice(0, 0) if flows is None else slice(None)
        levels = np.zeros(len(stamps)) if flows is None else flows
        return Trajectory(
            stamps, positions, quaternions, trigger_stamps_ns=stamps[on],
            trigger_flow=levels[on], notes=(said,),
            trigger_brush=numbered(brushes[on]),
        )  # fmt: skip
    if speed is None:
        raise RecordingError(
            f'no time among the columns {headings.written(range(len(headings.all)))}; give a '
            'column time_s, or speed_m_per_s for programmed passes'
        )
    speed_unit = headings.all[speed].unit or 'm/s'
    if speed_unit not in h.SPEEDS:
        raise RecordingError(f"{headings.written([speed])}: '{speed_unit}' is no unit of speed")
    speeds = table.numbers([speed])[:, 0] * h.UNITS[speed_unit]
    spraying = np.ones(len(speeds)) if flows is None else flows
    moves = [
        Move(position, quaternion, speed, bool(flow), line=line, flow=flow or 1.0, brush=brush)
        for position, quaternion, speed, flow, line, brush in zip(
            positions,
            quaternions,
            speeds.tolist(),
            spraying.tolist(),
            table.lines,
            brushes.tolist(),
            strict=True,
        )
    ]
    programmed = timed(moves, flows is not None)
    return replace(programmed, notes=(PROGRAMMED, said))


def read_positions_m(table: PoseTable, given: str | None) -> tuple[np.ndarray, str]:
    """Positions (N, 3) [m], and their unit as it was understood."""
    headings = table.headings
    columns = headings.find_all(h.POSITION)
    if columns is None:
        written = headings.written(range(len(headings.all)))
        raise RecordingError(f'no x, y, z among the columns {written}; name them x_m, y_m, z_m')
    told = {headings.all[column].unit for column in columns}
    if len(told) > 1 or not told <= {'', *h.LENGTHS}:
        found = ', '.join(sorted(unit or 'no unit' for unit in told))
        raise RecordingError(f'{headings.written(columns)} in {found}; give all in m or in mm')
    unit = told.pop() or given or ''
    positions = table.numbers(columns) * h.UNITS[unit or 'm']
    largest = float(np.nanmax(np.abs(positions), initial=0.0))
    if not unit and largest > LARGEST_CELL_M:
        raise RecordingError(
            f'{headings.written(columns)} reach {largest:.4g} and tell no unit; write it in the '
            'heading, as in x [mm], or give --pose-unit mm'
        )
    return positions, unit or 'm (no unit is given)'


def _flows(table: PoseTable, name: str | None) -> tuple[np.ndarray | None, str]:
    """Flow (N,) from each row on, relative to the calibrated one, and how it was read."""
    headings = table.headings
    trigger = headings.find(*h.TRIGGER) if name is None else headings.named(name)
    if name is not None and trigger is None:
        texts = [heading.text.strip() for heading in headings.all]
        raise RecordingError(f'no column is called {name}; {did_you_mean(name, texts)}')
    flow = headings.find(*h.FLOW) if name is None else None
    if trigger is None and flow is None:
        return None, 'no trigger, the gun sprays throughout'
    if flow is not None and headings.all[flow].unit not in ('', '-'):
        raise RecordingError(
            f'{headings.written([flow])}: the flow is relative to the calibrated one, 1 for the '
            'same; divide by it and drop the unit'
        )
    used = [column for column in (trigger, flow) if column is not None]
    values = table.numbers(used)
    on = np.nan_to_num(values[:, 0]) != 0.0
    relative = values[:, -1] if flow is not None else np.full(len(on), np.nan)
    flows = [relative_flow(bool(a), float(b)) for a, b in zip(on, relative, strict=True)]
    return np.array(flows), f'gun by {headings.written(used)}'


def _brushes(table: PoseTable) -> tuple[np.ndarray, str]:
    """Number of the brush (N,) from each row on, and how it was read."""
    column = table.headings.find(*h.BRUSH)
    if column is None:
        return np.full(len(table.rows), ONLY_BRUSH, np.int64), ''
    values, written = table.numbers([column])[:, 0], table.headings.written([column])
    strange = np.flatnonzero(~((values >= 0) & (values <= MOST) & (values == np.round(values))))
    if len(strange):
        raise RecordingError(
            f'line {table.lines[strange[0]]}: {written} is {values[strange[0]]:g}; give the '
            'number of a brush, 0 for the only one'
        )
    return values.astype(np.int64), f', brush by {written}'


def _separator(line: str) -> str:
    """The separator of most columns, '' if there is none."""
    most = max(SEPARATORS, key=line.count)
    return most if most in line else ''
