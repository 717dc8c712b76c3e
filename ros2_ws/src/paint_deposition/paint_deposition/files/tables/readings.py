"""Tables of gauge readings and of measuring points: their rows, units and numbers."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paint_deposition.errors import ReadingsError
from paint_deposition.files.tables.gauge_formats import ALIASES, FOLDERS
from paint_deposition.files.tables.headings import (
    UNIT_NAMES,
    Heading,
    find_table,
    headings_in,
    length_of,
    rows_below,
    words_of,
)
from paint_deposition.files.tables.reading_columns import (
    AXES,
    FILM_UNITS,
    LENGTH_UNITS,
    NORMALS,
    ON_FACE,
    Layout,
    columns_of,
    headings_again,
    layers_of,
    not_found,
    refuse_misleading,
)
from paint_deposition.files.tables.reading_rows import (
    figures_at_end,
    orders_of,
    rows_of_readings,
    without_failed,
)
from paint_deposition.files.tables.sheets import Sheet, text_of
from paint_deposition.files.tables.table import Table

GUESSED = 'no unit is given'


@dataclass(frozen=True)
class ReadingTable:
    """Rows of readings or points, apart from all that stands around them."""

    table: Table
    # Columns of each quantity; several of the thickness where each row holds repeats.
    at: dict[str, list[int]]
    layout: Layout
    # Number of each row from 1, those without a reading counted, and of all of them; of a workbook
    # with one column then the same with blank rows, which are its empty cells.
    orders: tuple[tuple[list[int], int], ...]
    # Metres in the unit of the thickness where a line above or a column has it.
    film_unit_m: float | None
    layers: list[str]  # what each column of the thickness is a layer of; none where it is not
    left_out: str  # what was not taken for a row, for the user

    @staticmethod
    def read(
        path: Path, films: bool, layout: Layout, labels: Collection[str] = ()
    ) -> 'ReadingTable':
        """Find the table of readings (``films``) or places in a file.

        A row with one of ``labels``, those of the listed points, is no statistic. Raises
        ReadingsError where there is no such table; its lines are complained of later, all at once.
        """
        # The sheet, its headings, and the columns of the quantities.
        named = [name for quantity in layout.columns for name in layout.named(quantity)]
        numbers = [name for name in named if isinstance(name, int)]
        bare = 0 < len(numbers) == len(named)
        sheet, header, table, at = _columns_in(path, films, layout, max(numbers) if bare else 0)
        layers = layers_of(table.headings, layout, at['thickness']) if films else []
        refuse_misleading(table, at, layout, layers, bare)
        # The cells: one reading in each, its unit in the heading, and none that is no reading.
        if films and not layers:
            table = table.with_repeats_apart(at)
        numeric = [k for q in (*AXES, *ON_FACE, *NORMALS, 'sigma') for k in at.get(q, [])]
        numeric += at['thickness'] if films else []
        table = table.without_units_in_cells(numeric).with_decimal(numeric, layout.decimal)
        table, failed = without_failed(table, at['thickness']) if films else (table, '')
        if films and layout.zero == 'missing':
            table = table.without(at['thickness'], lambda _, cell: table.is_zero(cell))
        # The rows that are readings or points, and their order.
        kept, missing, left_out = rows_of_readings(table, at, films, numeric, {*labels}, bare)
        if not kept:
            table.refuse_errors()
            raise table.error('no readings below the header')
        begin = table.lines[0] if bare else sheet.lines[header or 0] + 1
        orders = orders_of(table, kept, missing, begin)
        table = table.select(kept)
        unit_m = _unit_beside(table, at, sheet, header or 0)
        return ReadingTable(table, at, layout, orders, unit_m, layers, left_out + failed)

    def __len__(self) -> int:
        return len(self.table)

    def has(self, *quantities: str) -> bool:
        """Whether there is a column for each."""
        return all(quantity in self.at for quantity in quantities)

    def texts(self, quantity: str) -> list[str]:
        """A column as texts; empty ones where there is none."""
        return self.table.texts(self.at[quantity][0]) if self.has(quantity) else [''] * len(self)

    def heading(self, quantity: str) -> str:
        """What stands over the column; the quantity's own name where there is none."""
        return self.table.headings[self.at[quantity][0]].text if self.has(quantity) else quantity

    @property
    def labels(self) -> list[str] | None:
        """What the file calls the points of the rows, None where it names none."""
        by = self.named_by
        if len(by) < 2:
            return self.texts(by[0]) if by else None
        pairs = zip(*(self.texts(quantity) for quantity in by), strict=True)
        names = [self.heading(quantity) for quantity in by]
        return [' '.join(f'{n} {text}' for n, text in zip(names, p, strict=True)) for p in pairs]

    @property
    def named_by(self) -> tuple[str, ...]:
        """The quantities that name a point."""
        ways = (('point',), ('row', 'column'), ('block', 'number'), ('number',))
        return next((way for way in ways if self.has(*way)), ())

    @property
    def groups(self) -> list[str]:
        """The group of each row, else its column where points are named by row and column."""
        if self.has('group') or not self.has('row', 'column'):
            return self.texts('group')
        return [f'{self.heading("column")} {text}' for text in self.texts('column')]

    def numbers(self, quantity: str, may_be_empty: bool = False) -> np.ndarray:
        """A column (N,) of numbers as written."""
        return self.table.numbers(self.at[quantity][0], may_be_empty=may_be_empty)

    def lengths_m(self, quantities: Sequence[str]) -> tuple[np.ndarray, str]:
        """Columns of lengths (N, len(quantities)) [m], and their one unit in words."""
        values = np.column_stack([self.numbers(quantity) for quantity in quantities])
        given = self.layout.unit.get('position')
        headings = [self.table.headings[self.at[quantity][0]] for quantity in quantities]
        units = {given} if given else {heading.unit_m for heading in headings}
        unknown = {repr(h.unit) for h in headings if h.unit and not (given or h.unit_m)}
        if unknown or len(units) > 1 or not units <= {None, *LENGTH_UNITS}:
            named = unknown or [UNIT_NAMES[unit] if unit else 'no unit' for unit in units]
            found = ' and '.join(named)
            raise self.table.error(
                f'{", ".join(quantities)} are in {found}; give all in one of m, mm, cm, inch'
            )
        unit, how = units.pop(), ''
        if unit is None:
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            # No part is so large in metres.
            unit = 1e-3 if largest > 20.0 else 1.0
            how = f' ({GUESSED}; the largest is {largest:.4g})'
        # A division by 1000 comes nearer to the text than a product with 0.001.
        metric = unit in (1.0, 1e-2, 1e-3)
        metres = values / round(1.0 / unit) if metric else values * unit
        return metres, f'{", ".join(quantities)} in {UNIT_NAMES[unit]}{how}'

    @property
    def figures_at_end(self) -> str:
        """What could be statistics at the end of readings in order, in words; '' for nothing."""
        films, placed = self.at['thickness'], self.has(*AXES) or self.has(*ON_FACE)
        if placed or self.labels or len(films) > 1 or np.isnan(self.numbers('thickness')).any():
            return ''
        return figures_at_end([text.replace(',', '.') for text in self.texts('thickness')])

    @property
    def doubts(self) -> tuple[str, ...]:
        """What may have been meant otherwise, for the user."""
        film, found = self.heading('thickness'), []
        if figures := self.figures_at_end:
            found.append(
                f"'{film}': {figures}, and counts as a reading; delete it if so, or give a column "
                "'point' with the labels of the points"
            )
        beside = max(self.at['thickness']) + 1
        known = {column for columns in self.at.values() for column in columns}
        if self.table.form.startswith('commas') and beside < len(self.table.headings):
            cells = self.table.texts(beside)
            whole = all(map(str.isdigit, [*self.texts('thickness'), *filter(None, cells)]))
            if whole and any(cells) and beside not in known:
                found.append(
                    f"'{film}' has whole numbers only, as has '{self.table.headings[beside].text}'"
                    ' beside it: if decimal commas are cut, put semicolons between the columns'
                )
        return tuple(found)

    def films_um(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
        """All readings (N,) [um], the row and the layer of each, and what they are in words.

        A row gives as many readings as it has columns of repeats or layers that are not blank.
        """
        films = self.at['thickness']
        values = np.column_stack([self.table.numbers(k, may_be_empty=True) for k in films])
        row, which = np.nonzero(np.isfinite(values))
        given = self.layout.unit.get('thickness')
        said = {given} if given else {self.table.headings[k].unit_m for k in films}
        said |= set() if given else {self.film_unit_m}
        if len(said - {None}) > 1:
            found = ' and '.join(sorted(UNIT_NAMES[unit] for unit in said if unit))
            raise self.table.error(f'the thickness is in {found}; give all of it in one of them')
        unit = next(iter(said - {None}), None)
        headings = ', '.join(f"'{self.table.headings[k].text}'" for k in films)
        source = '' if headings == "'thickness_um'" else f' from {headings}'
        how = '' if unit else f' ({GUESSED})'
        factor = round((unit or 1e-6) * 1e6, 9)
        words = f'thickness in {UNIT_NAMES[unit or 1e-6]}{how}{source}'
        layers = (
            np.array(self.layers)[which] if self.layers else np.array(self.texts('layer'))[row]
        )
        return values[row, which] * factor, row, layers, words


def is_gauge_file(path: Path) -> bool:
    """Whether a path can be that of readings only: JSON, a zip, Parquet, or a gauge's folder."""
    if path.is_dir():
        names = {file.name for file in path.iterdir()}
        return any({*files} <= names for files in FOLDERS.values())
    return path.suffix.lower() in ('.json', '.zip', '.parquet')


def holds_readings(path: Path) -> bool:
    """Whether a file has a table in which a column is known as the thickness."""
    return find_table(path, ReadingsError, _known(True, Layout()))[1] is not None


def _columns_in(
    path: Path, films: bool, layout: Layout, wide: int
) -> tuple[Sheet, int | None, Table, dict[str, list[int]]]:
    """The sheet, the row of its headings, the rows below, and the columns of each quantity.

    ``wide`` is the number of columns of a table without headings, 0 for one that has them.
    """
    known = _known(films, layout)
    sheet, header = find_table(path, ReadingsError, known, layout.sheet, wide)
    headings = headings_in(sheet.rows[header or 0]) if sheet.rows else []
    if wide:
        headings = [Heading(f'column {k + 1}', ()) for k in range(len(headings))]
    first = 0 if wide or header is None else header + 1
    units_too = 'unit' not in columns_of(headings, layout)
    headings, rows = rows_below(sheet, headings, first, units_too)
    if not known(headings) or (header is None and not wide):
        why = not_found(sheet, [] if header is None else headings, films, layout)
        raise ReadingsError(f'{path}: {why}')
    table = Table(path, sheet.form, headings, sheet.rows, sheet.lines, ReadingsError)
    again = [] if header is None else headings_again(table, header, known)
    table = table.select([row for row in rows if row not in again])
    return sheet, header, table, columns_of(headings, layout)


def _known(films: bool, layout: Layout) -> Callable[[list[Heading]], int]:
    """What counts the quantities that headings name, 0 where a needed one is missing."""
    needed = (('thickness',),) if films else (AXES, ON_FACE)

    def known(headings: list[Heading]) -> int:
        at = columns_of(headings, layout)
        return len(at) if any({*names} <= {*at} for names in needed) else 0

    return known


def _unit_beside(
    table: Table, at: dict[str, list[int]], sheet: Sheet, header: int
) -> float | None:
    """Metres in the unit of the thickness that a column, or a line above the table, has."""
    if 'unit' in at:
        texts = sorted({text for text in table.texts(at['unit'][0]) if text})
        units = {length_of(text) for text in texts}
        if len(units) > 1 or not units <= {*FILM_UNITS}:
            found = ', '.join(map(repr, texts))
            raise table.error(f'the thickness is in {found}; give all of it in µm, mil or mm')
        return next(iter(units), None)
    for row in sheet.rows[:header]:
        cells = [part for cell in row for part in text_of(cell).split(':') if part]
        if len(cells) > 1 and ' '.join(words_of(cells[0])) in ALIASES['unit']:
            return length_of(cells[1])
    return None
