"""Tables of gauge readings and of measuring points: their rows, units and numbers."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paint_deposition.errors import ReadingsError
from paint_deposition.files.tables.headings import UNIT_NAMES, Heading, length_of, words_of
from paint_deposition.files.tables.reading_columns import (
    FILM_UNITS,
    LENGTH_UNITS,
    MEANS,
    SPREADS,
    THICKNESS,
    VALUES,
    Columns,
    Layout,
    columns_under,
    not_found,
)
from paint_deposition.files.tables.sheets import Cell, text_of
from paint_deposition.files.tables.table import (
    Table,
    is_comment,
    is_nothing,
    is_value,
    metres,
    read_table,
    unit_m,
)

# Coordinates without a unit that go beyond this are millimetres: no part is so large in metres.
LARGEST_PART_M = 20.0
STATISTICS = MEANS | SPREADS | {
    'statistics', 'statistik', 'summary', 'variation', 'variationskoeff', 'spannweite', 'anzahl',
    'median', 'total', 'sum', 'lowest', 'highest', 'readings', 'cp', 'cpk',
}  # fmt: skip
STATISTICS_LETTERS = {'n', 's', 'r', 'v', 'x', 'σ', 'μ'}


@dataclass(frozen=True)
class ReadingTable:
    """Rows of readings or points, apart from all that stands around them.

    Attributes:
        table: their cells.
        columns: what is in which.
        layout: what the user said of it.
        order: number of each row from 1, those without a reading counted.
        unit_above: metres in the unit of the thickness where a line above the table has it.
        left_out: what was not taken for a row, for the user.
    """

    table: Table
    columns: Columns
    layout: Layout
    order: list[int]
    unit_above: float | None
    left_out: str

    @staticmethod
    def read(path: Path, needs: str, layout: Layout, labels: Collection[str] = ()) -> ReadingTable:
        """Find the table in a file.

        Args:
            path: of a text file or workbook.
            needs: 'thickness' for readings, 'place' for measuring points.
            layout: what the user says of it.
            labels: of the listed points: a row with one of them is no statistic.

        Raises:
            ReadingsError: no such table; its lines are complained of later, all at once.
        """
        sheet, columns = read_table(
            path,
            ReadingsError,
            lambda sheet, row: columns_under(sheet, row, needs, layout),
            layout.sheet,
        )
        if columns is None or columns.rivals or not columns.serves():
            headings = [Heading.of(text_of(c)) for c in sheet.rows[0]] if sheet.rows else []
            raise ReadingsError(f'{path}: {not_found(columns, headings, needs, layout)}')
        rows = range(columns.first, len(sheet.rows))
        form = sheet.form + ('' if columns.header >= 0 else ', no headings')
        table = Table(
            path, form, columns.headings, sheet.rows[columns.first :], sheet.lines[rows.start :],
            ReadingsError,
        ).select([k - rows.start for k in rows if not is_comment(sheet.rows[k])])  # fmt: skip
        for column in columns.numeric:
            same = [h.text for h in columns.headings].count(columns.headings[column].text)
            if same > 1:
                text = columns.headings[column].text
                raise table.error(f"two columns are called '{text}'; keep one")
        table, doubt = table.with_decimal(columns.numeric, layout.decimal)
        if doubt:
            raise table.error(doubt)
        kept, numbers, left_out = _rows_of_readings(table, columns, set(labels))
        if not kept:
            table.refuse_complaints()
            raise table.error('no readings below the header')
        above = None
        for row in sheet.rows[: max(columns.header, 0)]:
            cells = [part for cell in row for part in text_of(cell).split(':') if part]
            if len(cells) > 1 and words_of(cells[0]) in (('unit',), ('units',), ('einheit',)):
                above = length_of(cells[1])
        return ReadingTable(table.select(kept), columns, layout, numbers, above, left_out)

    def __len__(self) -> int:
        return len(self.table)

    def has(self, *quantities: str) -> bool:
        """Whether there is a column for each."""
        return all(quantity in self.columns.at for quantity in quantities)

    def texts(self, quantity: str) -> list[str]:
        """A column as texts; empty ones where there is none."""
        return (
            self.table.texts(self.columns.at[quantity]) if self.has(quantity) else [''] * len(self)
        )

    def heading(self, quantity: str) -> str:
        """What stands over the column."""
        return self.columns.headings[self.columns.at[quantity]].text

    def numbers(self, quantity: str, may_be_empty: bool = False) -> np.ndarray:
        """A column (N,) of numbers without a unit."""
        return self.table.numbers(self.columns.at[quantity], may_be_empty=may_be_empty)[0]

    def _unit_m(self, column: int, kind: str) -> float | None:
        """Metres in the unit of a column where the user or its heading has it."""
        return self.layout.unit.get(kind, unit_m(self.columns.headings[column]))

    def lengths_m(self, quantities: Sequence[str]) -> tuple[np.ndarray, str]:
        """Columns of lengths (N, len(quantities)) [m], and their unit in words.

        Raises:
            ReadingsError: their units differ, or are none of a position.
        """
        at = [self.columns.at[quantity] for quantity in quantities]
        read = [self.table.numbers(column, LENGTH_UNITS) for column in at]
        values = np.column_stack([numbers for numbers, _ in read])
        behind = np.column_stack([units for _, units in read])
        units = {self._unit_m(column, 'position') for column in at}
        units |= {*behind[np.isfinite(behind)].tolist()}
        if len(units) > 1 and np.isfinite(behind).all():
            units -= {None}
        if len(units) > 1 or not units <= {None, *LENGTH_UNITS}:
            found = ' and '.join(UNIT_NAMES[unit] if unit else 'no unit' for unit in units)
            raise self.table.error(
                f'{", ".join(quantities)} are in {found}; give all in one of m, mm, cm, inch'
            )
        unit, how = units.pop(), ''
        if unit is None:
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            unit = 1e-3 if largest > LARGEST_PART_M else 1.0
            how = f' (no unit is given; the largest is {largest:.4g})'
        return metres(values, unit), f'{", ".join(quantities)} in {UNIT_NAMES[unit]}{how}'

    def films_um(self) -> tuple[np.ndarray, np.ndarray, str]:
        """All readings (N,) [um], the row of each, and what they are in words.

        A row gives as many readings as it has columns of repeats that are not blank.
        """
        films = self.columns.films
        read = [self.table.numbers(k, FILM_UNITS, may_be_empty=True) for k in films]
        row, which = np.nonzero(np.isfinite(np.column_stack([values for values, _ in read])))
        taken = np.array([read[c][0][r] for r, c in zip(row, which, strict=True)])
        units = np.array([read[c][1][r] for r, c in zip(row, which, strict=True)])
        units = np.where(np.isnan(units), self._units_beside()[row], units)
        common = self._unit_m(films[0], 'thickness') or self.unit_above
        if 'thickness' in self.layout.unit:  # the user knows better than the file
            units[:] = np.nan
        unknown = common is None and bool(np.isnan(units).any())
        units = np.where(np.isnan(units), common or 1e-6, units)
        factor = np.round(units * 1e6, 9)
        names = ' and '.join(UNIT_NAMES[unit] for unit in np.unique(units).tolist())
        headings = ', '.join(f"'{self.columns.headings[k].text}'" for k in films)
        source = '' if headings == "'thickness_um'" else f' from {headings}'
        how = ' (no unit is given)' if unknown else ''
        return taken * factor, row, f'thickness in {names or "µm"}{how}{source}'

    def _units_beside(self) -> np.ndarray:
        """(N,) metres in the unit that a column of its own has, nan where it is blank."""
        units = np.full(len(self), np.nan)
        for index, text in enumerate(self.texts('unit')):
            unit = length_of(text)
            if unit in FILM_UNITS:
                units[index] = unit
            elif text:
                self.table.complain(index, f"the unit is '{text}'; expected µm, mil or mm")
        return units


def _rows_of_readings(
    table: Table, columns: Columns, labels: set[str]
) -> tuple[list[int], list[int], str]:
    """Rows that are readings or points, their numbers, and in words what else there is.

    A row with a place is one, whatever its label. One without is a statistic if it is named so, or
    stands below such a row, unless its label is that of a listed point. A missing reading keeps
    its number.
    """
    kept: list[int] = []
    numbers: list[int] = []
    blank = statistics = other = 0
    width, below = len(columns.headings), False
    label = columns.at.get('point', columns.at.get('number'))
    texts = [heading.text for heading in columns.headings]
    for k, row in enumerate(table.rows):
        cells = [row[c] if c < len(row) else '' for c in range(max(width, len(row)))]
        films, place = [cells[c] for c in columns.films], [cells[c] for c in columns.place]
        placed = any(map(is_value, place))
        if placed or (label is not None and text_of(cells[label]) in labels):
            below = False
        elif _is_statistic(cells, below, bool(place)):
            statistics, below = statistics + 1, True
            continue
        if [text_of(cell) for cell in cells] == texts:
            continue
        missing = bool(films) and all(map(is_nothing, films))
        if not placed and not any(map(is_value, films)):
            # A remark has no reading either, but no other number and no n/a in its place.
            missing &= any(films) or any(map(is_value, cells))
            other += not missing
            blank += missing
        elif len(row) <= max(columns.numeric) or any(cell != '' for cell in cells[width:]):
            table.complain(k, f'{len(row)} values under {width} column names')
        elif missing:
            blank += 1
        else:
            kept.append(k)
            numbers.append(len(kept) + blank)
    kinds = {'without a reading': blank, 'of statistics': statistics, 'of other text': other}
    parts = [f'{n} row{"s" * (n > 1)} {what}' for what, n in kinds.items() if n]
    return kept, numbers, f'left out: {", ".join(parts)}' if parts else ''


def _is_statistic(cells: list[Cell], below: bool, has_place: bool) -> bool:
    """Whether a row without a place begins with the name of a statistic, such as Mean or n =.

    Below another one a lone letter is a statistic, too, and any row where others have a place.
    """
    text = next((text_of(cell) for cell in cells if cell != ''), '')
    words = set(words_of(text.partition('=')[0].partition(':')[0]))
    known = STATISTICS | VALUES | THICKNESS
    known |= {'of', 'number', 'reading', 'abw', 'quer', 'coefficient', 'standard'}
    letter = len(words) == 1 and words <= STATISTICS_LETTERS
    named = bool(words & STATISTICS) and words <= known and not words <= {'n'}
    return named or (letter and (below or '=' in text)) or (below and has_place)
