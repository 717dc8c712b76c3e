"""Tables of gauge readings and of measuring points: their rows, units and numbers."""

import re
from bisect import bisect
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paint_deposition.errors import ReadingsError
from paint_deposition.files.tables import reading_columns as known_columns
from paint_deposition.files.tables import table as cells_of
from paint_deposition.files.tables.headings import UNIT_NAMES, Heading, length_of, words_of
from paint_deposition.files.tables.reading_columns import AXES, NORMALS, ON_FACE, Layout
from paint_deposition.files.tables.sheets import Sheet, text_of
from paint_deposition.files.tables.table import Table, is_nothing, is_value

# Coordinates without a unit that go beyond this are millimetres: no part is so large in metres.
LARGEST_PART_M = 20.0
GUESSED = 'no unit is given'
STATISTIC = re.compile(
    r'(mean|average|avg|mittel\w*|mw|median|std|sd|stand\w+|min\w*|max\w*|range|spannweite|cv|'
    r'lowest|highest|(high|low|upper|lower) limit|coef\w*|vari\w*|statist\w*|number of|count|'
    r'anzahl|sum|total|n|s|x)\b'
)


@dataclass(frozen=True)
class ReadingTable:
    """Rows of readings or points, apart from all that stands around them."""

    table: Table
    # Columns of each quantity; several of the thickness where each row holds repeats.
    at: dict[str, list[int]]
    layout: Layout
    # Number of each row from 1, those without a reading counted, and of all of them; then the same
    # with blank rows counted, too.
    orders: tuple[tuple[list[int], int], ...]
    # Metres in the unit of the thickness where a line above or a column has it.
    film_unit_m: float | None
    left_out: str  # what was not taken for a row, for the user

    @staticmethod
    def read(
        path: Path, films: bool, layout: Layout, labels: Collection[str] = ()
    ) -> 'ReadingTable':
        """Find the table of readings (``films``) or places in a file.

        A row with one of ``labels``, those of the listed points, is no statistic. Raises
        ReadingsError where there is no such table; its lines are complained of later, all at once.
        """
        numbers = [n for n in layout.columns.values() if isinstance(n, int)]
        numbered = 0 < len(numbers) == len(layout.columns)

        def known(headings: list[Heading]) -> int:
            at = known_columns.columns_of(headings, layout)
            needed = (('thickness',),) if films else (AXES, ON_FACE)
            return len(at) if any({*names} <= {*at} for names in needed) else 0

        least = max(numbers) if numbered else 0
        sheet, header = cells_of.find_table(path, ReadingsError, known, layout.sheet, least)
        first = 0 if numbered or header is None else header + 1
        headings = cells_of.headings_in(sheet.rows[header or 0]) if sheet.rows else []
        if numbered:
            headings = [Heading(f'column {k + 1}', ()) for k in range(len(headings))]
        units_too = 'unit' not in known_columns.columns_of(headings, layout)
        headings, rows = cells_of.rows_below(sheet, headings, first, units_too)
        at = known_columns.columns_of(headings, layout)
        if not known(headings) or (header is None and not numbered):
            named = [] if header is None else headings
            why = known_columns.not_found(sheet, named, films, layout)
            raise ReadingsError(f'{path}: {why}')
        table = Table(path, sheet.form, headings, sheet.rows, sheet.lines, ReadingsError)
        table = table.select(rows)
        _refuse_rivals(table, at)
        _refuse_merged(table, [] if 'thickness' in layout.columns else at.get('thickness', []))
        if numbered and layout.decimal != '.':
            _refuse_cut_numbers(table)
        numeric = [k for q in (*AXES, *ON_FACE, *NORMALS, 'sigma') for k in at.get(q, [])]
        numeric += at['thickness'] if films else []
        table, doubt = table.with_decimal(numeric, layout.decimal)
        if doubt:
            raise table.error(doubt)
        if films and layout.zero == 'missing':
            table = table.without_zeros(at['thickness'])
        kept, missing, left_out = _rows_of_readings(table, at, films, numeric, {*labels})
        if not kept:
            table.refuse_errors()
            raise table.error('no readings below the header')
        begin = table.lines[0] if numbered else sheet.lines[header or 0] + 1
        orders = _orders(table.lines, kept, missing, begin)
        table = table.select(kept)
        return ReadingTable(
            table, at, layout, orders, _unit_beside(table, at, sheet, header or 0), left_out
        )

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
        ways = (('point',), ('row', 'column'), ('number',))
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
        if unknown or len(units) > 1 or not units <= {None, *known_columns.LENGTH_UNITS}:
            named = unknown or [UNIT_NAMES[unit] if unit else 'no unit' for unit in units]
            found = ' and '.join(named)
            raise self.table.error(
                f'{", ".join(quantities)} are in {found}; give all in one of m, mm, cm, inch'
            )
        unit, how = units.pop(), ''
        if unit is None:
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            unit = 1e-3 if largest > LARGEST_PART_M else 1.0
            how = f' ({GUESSED}; the largest is {largest:.4g})'
        # A division by 1000 comes nearer to the text than a product with 0.001.
        metric = unit in (1.0, 1e-2, 1e-3)
        metres = values / round(1.0 / unit) if metric else values * unit
        return metres, f'{", ".join(quantities)} in {UNIT_NAMES[unit]}{how}'

    def films_um(self) -> tuple[np.ndarray, np.ndarray, str]:
        """All readings (N,) [um], the row of each, and what they are in words.

        A row gives as many readings as it has columns of repeats that are not blank.
        """
        films = self.at['thickness']
        values = np.column_stack([self.table.numbers(k, may_be_empty=True) for k in films])
        row, which = np.nonzero(np.isfinite(values))
        unit = self.layout.unit.get('thickness', self.table.headings[films[0]].unit_m)
        unit = unit or self.film_unit_m
        headings = ', '.join(f"'{self.table.headings[k].text}'" for k in films)
        source = '' if headings == "'thickness_um'" else f' from {headings}'
        how = '' if unit else f' ({GUESSED})'
        factor = round((unit or 1e-6) * 1e6, 9)
        words = f'thickness in {UNIT_NAMES[unit or 1e-6]}{how}{source}'
        return values[row, which] * factor, row, words


def _refuse_rivals(table: Table, at: dict[str, list[int]]) -> None:
    """Refuse several columns of one quantity; those of the thickness may differ in a number."""
    every = [heading.text for heading in table.headings]
    for quantity, columns in at.items():
        texts = [every[k] for k in columns]
        if len({*texts}) < len(texts) or every.count(texts[0]) > 1:
            raise table.error(f"two columns are called '{texts[0]}'; keep one")
        stems = {re.sub(r'\d+', '', text) for text in texts}
        if len(columns) > 1 and (quantity != 'thickness' or len(stems) > 1):
            named = ', '.join(map(repr, texts))
            raise table.error(
                f'the {quantity} may be in {named}; name one, columns: {{{quantity}: ...}}'
            )


def _refuse_merged(table: Table, films: list[int]) -> None:
    """Refuse numbers without a heading right of the thickness's: it is merged over them."""
    for column in range(max(films, default=len(table.headings)) + 1, len(table.headings)):
        if table.headings[column].text:
            return
        for row, line in zip(table.rows, table.lines, strict=True):
            if column < len(row) and is_value(row[column]):
                raise table.error(
                    f"'{table.headings[films[-1]].text}' stands over several columns or is a "
                    f"title: '{text_of(row[column])}' beside it in line {line} has no heading; "
                    'give each column one, or say columns: {thickness: ...} in the campaign'
                )


def _refuse_cut_numbers(table: Table) -> None:
    """Refuse lines without headings that may be two numbers, or one with a decimal comma."""
    cells = [text_of(cell) for row in table.rows for cell in row]
    if (
        table.form.startswith('commas')
        and len(cells) == 2 * len(table)
        and all(map(str.isdigit, cells))
    ):
        raise table.error(
            f"'{cells[0]},{cells[1]}' in line {table.lines[0]} may be two numbers or one with a "
            'decimal comma; say decimal: point if it is two, else put a heading over the column'
        )


def _unit_beside(
    table: Table, at: dict[str, list[int]], sheet: Sheet, header: int
) -> float | None:
    """Metres in the unit of the thickness that a column, or a line above the table, has."""
    if 'unit' in at:
        texts = sorted({text for text in table.texts(at['unit'][0]) if text})
        units = {length_of(text) for text in texts}
        if len(units) > 1 or not units <= {*known_columns.FILM_UNITS}:
            found = ', '.join(map(repr, texts))
            raise table.error(f'the thickness is in {found}; give all of it in µm, mil or mm')
        return next(iter(units), None)
    for row in sheet.rows[:header]:
        cells = [part for cell in row for part in text_of(cell).split(':') if part]
        if len(cells) > 1 and ' '.join(words_of(cells[0])) in known_columns.ALIASES['unit']:
            return length_of(cells[1])
    return None


def _rows_of_readings(
    table: Table, at: dict[str, list[int]], films: bool, numeric: list[int], labels: set[str]
) -> tuple[list[int], list[int], str]:
    """Rows that are readings or points, rows without a reading, and in words what else there is.

    A row with a place is one, whatever its label. One without a place, or in a table without
    places, is a statistic if it begins with the name of one and not with the label of a listed
    point.
    """
    kept: list[int] = []
    unread: list[int] = []
    nowhere: list[int] = []  # the last rows, if they have neither place nor label
    count = {'without a reading': 0, 'of statistics': 0, 'of other text': 0}
    width = len(table.headings)
    places = [k for q in (*AXES, *ON_FACE) for k in at.get(q, [])]
    both = 'point' not in at and {'row', 'column'} <= {*at}
    (label,) = at['column'] if both else at.get('point') or at.get('number') or [-1]
    for k, row in enumerate(table.rows):
        cells = [*row, *[''] * (width - len(row))]
        values = [cells[c] for c in at['thickness']] if films else []
        placed = any(is_value(cells[c]) for c in places)
        begins = next(text_of(cell) for cell in cells if cell != '')
        listed = label >= 0 and (both or text_of(cells[label]) in labels) and cells[label] != ''
        missing = bool(values) and all(map(is_nothing, values))
        named = STATISTIC.match(' '.join(words_of(begins))) and not is_nothing(begins)
        if named and not placed and not listed:
            count['of statistics'] += 1
        elif not placed and not any(map(is_value, values)):
            # A remark has no reading either, but no other number and no n/a in its place.
            missing &= any(values) or any(map(is_value, cells))
            count['without a reading' if missing else 'of other text'] += 1
            unread += [k] * missing
        elif len(row) <= max(numeric) or any(cell != '' for cell in cells[width:]):
            table.complain(k, f'{len(row)} values under {width} column names')
        elif missing:
            count['without a reading'] += 1
            unread.append(k)
        else:
            kept.append(k)
            homeless = not placed and (places or label >= 0) and cells[label] == ''
            nowhere = [*nowhere, k] if homeless else []
    # Apart from the table, a block of numbers without places or labels is its statistics.
    if nowhere and nowhere[0] and table.lines[nowhere[0]] > table.lines[nowhere[0] - 1] + 1:
        kept = kept[: -len(nowhere)]
        count['of statistics'] += len(nowhere)
    parts = [f'{n} row{"s" * (n > 1)} {what}' for what, n in count.items() if n]
    return kept, unread, f'left out: {", ".join(parts)}' if parts else ''


def _orders(
    lines: list[int], kept: list[int], unread: list[int], begin: int
) -> tuple[tuple[list[int], int], ...]:
    """Numbers of the kept rows from 1 and the number of all, without and with blank rows."""
    rows, end = sorted([*kept, *unread]), lines[max(kept)] + 1
    blank = sorted({*range(begin, end)} - {*lines})
    without = [bisect(rows, k) for k in kept]
    with_blank = [n + bisect(blank, lines[k]) for n, k in zip(without, kept, strict=True)]
    return (without, len(rows)), (with_blank, len(rows) + len(blank))
