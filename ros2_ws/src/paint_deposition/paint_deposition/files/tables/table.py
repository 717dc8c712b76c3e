"""A table in a file: its rows of readings or points, apart from all that stands around them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from paint_deposition.files.tables import words as trade
from paint_deposition.files.tables.columns import LENGTHS, Columns
from paint_deposition.files.tables.complaints import Complaints
from paint_deposition.files.tables.layout import Layout
from paint_deposition.files.tables.numbers import MARKS, Decimals, is_nothing
from paint_deposition.files.tables.sheets import Cell, text_of

# Coordinates without a unit that go beyond this are millimetres: no part is so large in metres.
LARGEST_PART_M = 20.0


@dataclass(frozen=True)
class Table:
    """Rows of values under known columns.

    Attributes:
        path: of the file.
        columns: what is in which.
        rows: of cells, as wide as the headings.
        lines: of the file that each row stands in.
        form: how the file was understood, for the user.
        left_out: what was not taken for a row, for the user.
        decimals: how numbers are written.
        layout: what the user said of it.
        units_above: metres in the unit of 'position' and 'thickness' where lines above tell it.
        complaints: gathered while values are taken.
    """

    path: Path
    columns: Columns
    rows: list[list[Cell]]
    lines: list[int]
    form: str
    left_out: str
    decimals: Decimals
    layout: Layout
    units_above: dict[str, float]
    complaints: Complaints

    def __len__(self) -> int:
        return len(self.rows)

    def has(self, *quantities: str) -> bool:
        """Whether there is a column for each."""
        return all(quantity in self.columns.at for quantity in quantities)

    def texts(self, quantity: str) -> list[str]:
        """A column as texts; empty ones where there is none."""
        if not self.has(quantity):
            return [''] * len(self)
        return [text_of(row[self.columns.at[quantity]]) for row in self.rows]

    def heading(self, quantity: str) -> str:
        """What stands over the column."""
        return self.columns.headings[self.columns.at[quantity]]

    def numbers(
        self,
        quantity: str,
        column: int | None = None,
        units: Sequence[float] = (),
        may_be_empty: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """A column (N,) as written, and metres in the unit behind each number (N,).

        Args:
            quantity: of the column.
            column: where it has several.
            units: that may stand behind a number, in metres.
            may_be_empty: whether blank cells give nan without a complaint.
        """
        at = self.columns.at[quantity] if column is None else column
        name = self.columns.headings[at] or quantity
        wanted = f'expected a number with a {MARKS[self.decimals.mark]}'
        values, behind = np.full(len(self), np.nan), np.full(len(self), np.nan)
        for index, row in enumerate(self.rows):
            if may_be_empty and is_nothing(row[at]):
                continue
            value, text = self.decimals.number(row[at]) or (None, '')
            unit = trade.unit_of(text) if text else None
            if value is None or (text and unit not in units):
                self.complain(index, f"{name} is '{text_of(row[at])}'; {wanted}")
            elif not np.isfinite(value):
                self.complain(index, f'{name} is {row[at]}; expected a finite number')
            else:
                values[index] = value
                behind[index] = np.nan if unit is None else unit
        return values, behind

    def unit_m(self, quantity: str) -> float | None:
        """Metres in the unit of a column where the user, its heading or a line above it tells."""
        kind = 'position' if quantity in LENGTHS else 'thickness'
        of_heading = self.columns.units.get(quantity, self.units_above.get(kind))
        return self.layout.unit.get(kind, of_heading)

    def complain(self, row: int, text: str) -> None:
        """Note what is wrong in a row."""
        self.complaints.at(self.lines[row], text)

    def lengths_m(self, quantities: Sequence[str]) -> tuple[np.ndarray, str]:
        """Columns of lengths (N, len(quantities)) [m], and their unit in words.

        Raises:
            ReadingsError: their units differ, or are none of a position.
        """
        read = [self.numbers(quantity, units=trade.LENGTH_UNITS) for quantity in quantities]
        values = np.column_stack([numbers for numbers, _ in read])
        behind = np.column_stack([units for _, units in read])
        told = {self.unit_m(quantity) for quantity in quantities}
        names = f'{", ".join(quantities)} are in '
        if told == {None}:
            told = {None if np.isnan(unit) else unit for unit in np.unique(behind)} or told
        elif not np.isin(behind[np.isfinite(behind)], [unit for unit in told if unit]).all():
            told |= {None}
        if len(told) > 1 or not told <= {None, *trade.LENGTH_UNITS}:
            units = ' and '.join(trade.UNIT_NAMES[unit] if unit else 'no unit' for unit in told)
            raise self.complaints.of_file(f'{names}{units}; give all in one of m, mm, cm, inch')
        unit, how = told.pop(), ''
        if unit is None:
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            unit = 1e-3 if largest > LARGEST_PART_M else 1.0
            how = f' (no unit is given; the largest is {largest:.4g})'
        # A division by 1000 comes nearer to the text than a product with 0.001.
        metres = values / round(1.0 / unit) if unit in (1.0, 1e-2, 1e-3) else values * unit
        return metres, f'{", ".join(quantities)} in {trade.UNIT_NAMES[unit]}{how}'

    def films_um(self) -> tuple[np.ndarray, np.ndarray, str]:
        """All readings (N,) [um], the row of each, and what they are in words.

        A row gives as many readings as it has columns of repeats that are not blank.
        """
        repeats = self.columns.repeats
        read = [
            self.numbers('thickness', column, trade.FILM_UNITS, may_be_empty=True)
            for column in repeats
        ]
        row, which = np.nonzero(np.isfinite(np.column_stack([values for values, _ in read])))
        taken = np.array([read[c][0][r] for r, c in zip(row, which, strict=True)])
        units = np.array([read[c][1][r] for r, c in zip(row, which, strict=True)])
        if 'thickness' in self.layout.unit:  # the user knows better than the file
            units[:] = np.nan
        else:
            beside = self._units_beside()[row]
            units = np.where(np.isnan(units), beside, units)
        common = self.unit_m('thickness')
        untold = common is None and bool(np.isnan(units).any())
        units = np.where(np.isnan(units), common or 1e-6, units)
        factor = np.round(units * 1e6, 9)
        films = np.where(factor == 1.0, taken, taken * factor)
        names = ' and '.join(trade.UNIT_NAMES[unit] for unit in np.unique(units).tolist())
        how = ' (no unit is given)' if untold else ''
        headings = ', '.join(f"'{self.columns.headings[column]}'" for column in repeats)
        source = '' if self.columns.own else f' from {headings}'
        return films, row, f'thickness in {names or "µm"}{how}{source}'

    def _units_beside(self) -> np.ndarray:
        """(N,) metres in the unit that a column of its own tells, nan where it is blank."""
        units = np.full(len(self), np.nan)
        for index, text in enumerate(self.texts('unit')):
            unit = trade.unit_of(text) if text else None
            if unit in trade.FILM_UNITS:
                units[index] = unit
            elif text:
                self.complain(index, f"the unit is '{text}'; expected µm, mil or mm")
        return units

    def select(self, rows: np.ndarray) -> 'Table':
        """The chosen rows (indices)."""
        return replace(
            self, rows=[self.rows[k] for k in rows], lines=[self.lines[k] for k in rows]
        )
