"""Tables of gauge readings and of measuring points: their rows, units and numbers."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.errors import ReadingsError
from paint_deposition.files.tables.gauge_formats import ALIASES, STATISTIC
from paint_deposition.files.tables.headings import (
    LENGTHS,
    UNIT_NAMES,
    Heading,
    find_table,
    headings_in,
    rows_below,
    unit_of,
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
    format_of,
    headings_again,
    layers_of,
    not_found,
    plain,
    refuse_misleading,
)
from paint_deposition.files.tables.sheets import (
    Sheet,
    cell_at,
    is_comment,
    is_nothing,
    is_value,
    text_of,
)
from paint_deposition.files.tables.table import Table

GUESSED = 'no unit is given'


@dataclass
class ReadingTable(Table):
    """Rows of readings or points, apart from all that stands around them."""

    # Columns of each quantity; several of the thickness where each row holds repeats or layers.
    at: dict[str, list[int]] = field(default_factory=dict)
    layout: Layout = field(default_factory=Layout)
    # Number of each row from 1, those without a reading counted, and of all of them; of a workbook
    # with one column then the same with blank rows, which are its empty cells.
    orders: list[tuple[list[int], int]] = field(default_factory=list)
    # Metres in the unit of the thickness where a line above or a column has it.
    film_unit_m: float | None = None
    # What each column of the thickness is a layer of; none where it is not.
    layers: list[str] = field(default_factory=list)
    left_out: str = ''  # what was not taken for a row, for the user
    # Of a list of points: where they are (N, 3) in the mesh frame [m], outward unit normals, and
    # that in words.
    positions_m: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    normals: np.ndarray | None = None
    place_words: str = ''

    @staticmethod
    def read(
        path: Path, films: bool, layout: Layout, labels: Collection[str] = ()
    ) -> 'ReadingTable':
        """Find the table of readings (``films``) or places in a file.

        A row with one of ``labels``, those of the listed points, is no statistic. Raises
        ReadingsError where there is no such table; errors of its lines are raised later, at once.
        """
        # The sheet, its headings, and the columns of the quantities.
        named = [name for quantity in layout.columns for name in layout.named(quantity)]
        numbers = [name for name in named if isinstance(name, int)]
        bare = 0 < len(numbers) == len(named)
        sheet, header, table = _rows_in(path, films, layout, max(numbers) if bare else 0)
        thick = table.at['thickness'] if films else []
        table.layers = layers_of(table.headings, layout, thick)
        refuse_misleading(table, table.at, layout, table.layers, bare)
        # The cells: one reading in each, its unit in the heading, and n/a for what is none.
        if films and not table.layers:
            table, thick = table.with_repeats_apart(thick)
            table.at['thickness'] = thick
        numeric = [k for q in (*AXES, *ON_FACE, *NORMALS, 'sigma') for k in table.at.get(q, [])]
        numeric += thick
        table = table.without_units_in_cells(numeric).with_decimal(numeric, layout.decimal)
        failed = table._mark_failed() if films else ''
        if films and layout.zero == 'missing':
            table = table.without(thick, lambda _, cell: table.number(cell) == 0.0)
        # The rows that are readings or points, and their order.
        below = sheet.rows[0 if header is None else header + 1 :]
        marked = sum(is_comment(row) and any(map(is_value, row[1:])) for row in below)
        kept, missing, table.left_out = table._sorted_rows(films, numeric, {*labels}, bare, marked)
        table.left_out += failed
        if not kept:
            table.refuse_errors()
            missed = 'no readings below the header' if films else 'no points below the header'
            if films and missing:
                missed += f': {len(missing)} rows without one under '
                missed += ', '.join(repr(table.headings[k].text) for k in thick)
            raise table.error(missed)
        begin = table.lines[0] if bare else sheet.lines[header or 0] + 1
        table.orders = [*table._orders(kept, missing, begin)]
        table = table.select(kept)
        table.film_unit_m = table._unit_beside(sheet, header or 0)
        return table

    def _mark_failed(self) -> str:
        """Write n/a for the readings that the gauge itself marks as none; how many, in words.

        Raises ReadingsError where what a layout calls a count of readings is none.
        """
        gauge, films = format_of(self.headings), self.at['thickness']
        if gauge is None:
            return ''
        column = {plain(heading): k for k, heading in enumerate(self.headings)}
        if (count := gauge.columns.get('number')) and films != [column[count]]:
            texts = self.texts(column[count])
            if odd := next((text for text in texts if '.' in text or ',' in text), ''):
                raise self.error(
                    f"'{self.headings[column[count]].text}' counts the readings of a "
                    f"{gauge.name}, and is '{odd}'; name the column of the film with columns: "
                    '{thickness: ...} in the campaign'
                )
        failed: dict[int, str] = {}
        for word, good in gauge.status.items():
            for row, text in enumerate(self.texts(column[word]) if word in column else []):
                if text.casefold() not in good:
                    failed[row] = self.headings[column[word]].text
        self.rows = self.without(films, lambda row, _: row in failed).rows
        named = ', '.join(dict.fromkeys(failed.values()))
        return f', {len(failed)} of them failed by {named}' if failed else ''

    def _sorted_rows(
        self, films: bool, numeric: list[int], labels: set[str], bare: bool, marked: int
    ) -> tuple[list[int], list[int], str]:
        """Rows that are readings or points, rows without a reading, and in words what else is.

        A row with a place is one, whatever its label. One without a place, or in a table without
        places, is a statistic if it begins with the name of one and not with the label of a
        listed point. In a ``bare`` file, without headings, a row as wide as the others is one too.
        So many others with numbers are ``marked`` as comments.
        """
        kept: list[int] = []
        missing: list[int] = []
        count = {'without a reading': 0, 'of statistics': 0, 'of other text': 0}
        count['that begin with #'] = marked
        width, thick = len(self.headings), self.at['thickness'] if films else []
        places = [k for q in (*AXES, *ON_FACE) for k in self.at.get(q, [])]
        by = self.named_by
        padded = [[*row, *[''] * (width - len(row))] for row in self.rows]
        # The other columns in which the first reading has a number.
        first = next((row for row in padded if any(is_value(row[c]) for c in thick)), [])
        numbered = [c for c, cell in enumerate(first[:width]) if is_value(cell) and c not in thick]
        for k, (row, cells) in enumerate(zip(self.rows, padded, strict=True)):
            values = [cells[c] for c in thick]
            placed = any(is_value(cells[c]) for c in places)
            begins = next(text_of(cell) for cell in cells if cell != '')
            label = text_of(cells[self.at[by[-1]][0]]) if by else ''
            listed = label != '' and (by == ('row', 'column') or label in labels)
            empty = bool(values) and all(map(is_nothing, values))
            named = STATISTIC.match(' '.join(words_of(begins))) and not is_nothing(begins)
            if named and not placed and not listed:
                count['of statistics'] += 1
            elif not placed and not any(map(is_value, values)):
                # A remark has no reading either, but not all other numbers, nor n/a in its place.
                full = bool(numbered) and all(is_value(cells[c]) for c in numbered)
                empty &= any(values) or full or (bare and len(row) == width)
                count['without a reading' if empty else 'of other text'] += 1
                missing += [k] * empty
            elif len(row) <= max(numeric) or any(cell != '' for cell in cells[width:]):
                self.add_width_error(k)
            elif empty:
                count['without a reading'] += 1
                missing.append(k)
            else:
                kept.append(k)
        # Last rows without place or label that stand apart from the table are statistics, too.
        columns = [*places, *(self.at[name][0] for name in by[-1:])]
        nameless = takewhile(
            lambda k: columns and all(cell_at(self.rows[k], c) == '' for c in columns),
            reversed(kept),
        )
        apart = min(nameless, default=0)
        if apart and self.lines[apart] > self.lines[apart - 1] + 1:
            count['of statistics'] += len(kept) - kept.index(apart)
            del kept[kept.index(apart) :]
        parts = [f'{n} row{"s" * (n > 1)} {what}' for what, n in count.items() if n]
        return kept, missing, f'left out: {", ".join(parts)}' if parts else ''

    def _orders(
        self, kept: list[int], missing: list[int], begin: int
    ) -> Iterator[tuple[list[int], int]]:
        """Numbers of the kept rows from 1 and the number of all; of cells also with blank rows.

        A blank line of a text, or a blank row beside other columns, may part two groups.
        """
        counted = {self.lines[k] for k in (*kept, *missing)}
        blank = {*range(begin, self.lines[max(kept)])} - {*self.lines}
        of_cells = self.form.startswith('sheet') and sum(bool(h.text) for h in self.headings) == 1
        for lines in (counted, counted | blank)[: 1 + of_cells]:
            number = {line: place for place, line in enumerate(sorted(lines), start=1)}
            yield [number[self.lines[k]] for k in kept], len(lines)

    def _unit_beside(self, sheet: Sheet, header: int) -> float | None:
        """Metres in the unit of the thickness that a column, or a line above the table, has."""
        if self.has('unit'):
            texts = sorted({*self.of('unit')} - {''})
            units = {LENGTHS.get(unit_of(text)) for text in texts}
            if len(units) > 1 or not units <= {*FILM_UNITS}:
                found = ', '.join(map(repr, texts))
                raise self.error(f'the thickness is in {found}; give all of it in µm, mil or mm')
            return next(iter(units), None)
        for row in sheet.rows[:header]:
            cells = [part for cell in row for part in text_of(cell).split(':') if part]
            if len(cells) > 1 and ' '.join(words_of(cells[0])) in ALIASES['unit']:
                return LENGTHS.get(unit_of(cells[1]))
        return None

    def has(self, *quantities: str) -> bool:
        """Whether there is a column for each."""
        return all(quantity in self.at for quantity in quantities)

    def of(self, quantity: str) -> list[str]:
        """The column of a quantity as texts; empty ones where there is none."""
        return self.texts(self.at[quantity][0]) if self.has(quantity) else [''] * len(self)

    def heading(self, quantity: str) -> str:
        """What stands over the column; the quantity's own name where there is none."""
        return self.headings[self.at[quantity][0]].text if self.has(quantity) else quantity

    @property
    def named_by(self) -> tuple[str, ...]:
        """The quantities that name a point."""
        ways = (('point',), ('row', 'column'), ('block', 'number'), ('number',))
        return next((way for way in ways if self.has(*way)), ())

    @property
    def labels(self) -> list[str] | None:
        """What the file calls the points of the rows, None where it names none."""
        by = self.named_by
        if len(by) < 2:
            return self.of(by[0]) if by else None
        pairs = zip(*(self.of(quantity) for quantity in by), strict=True)
        names = [self.heading(quantity) for quantity in by]
        return [' '.join(f'{n} {text}' for n, text in zip(names, p, strict=True)) for p in pairs]

    @property
    def groups(self) -> list[str]:
        """The group of each row, else its column where points are named by row and column."""
        if self.has('group') or not self.has('row', 'column'):
            return self.of('group')
        return [f'{self.heading("column")} {text}' for text in self.of('column')]

    def lengths_m(self, quantities: Sequence[str]) -> tuple[np.ndarray, str]:
        """Columns of lengths (N, len(quantities)) [m], and their one unit in words."""
        columns = [self.at[quantity][0] for quantity in quantities]
        values = np.column_stack([self.numbers(column) for column in columns])
        given = self.layout.unit.get('position')
        headings = [self.headings[column] for column in columns]
        units = {given} if given else {LENGTHS.get(h.unit) for h in headings}
        unknown = {repr(h.unit) for h in headings if h.unit and not (given or h.unit in LENGTHS)}
        if unknown or len(units) > 1 or not units <= {None, *LENGTH_UNITS}:
            named = unknown or [UNIT_NAMES[unit] if unit else 'no unit' for unit in units]
            raise self.error(
                f'{", ".join(quantities)} are in {" and ".join(named)}; give all in one of m, mm, '
                'cm, inch'
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

    def films_um(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
        """All readings (N,) [um], the row and the layer of each, and what they are in words.

        A row gives as many readings as it has columns of repeats or layers that are not blank.
        """
        films = self.at['thickness']
        values = np.column_stack([self.numbers(k, may_be_empty=True) for k in films])
        row, which = np.nonzero(np.isfinite(values))
        given = self.layout.unit.get('thickness')
        said = {self.film_unit_m, *(LENGTHS.get(self.headings[k].unit) for k in films)} - {None}
        units = [given] if given else sorted(unit for unit in said if unit)
        if len(units) > 1:
            found = ' and '.join(sorted(UNIT_NAMES[unit] for unit in units))
            raise self.error(f'the thickness is in {found}; give all of it in one of them')
        unit, how = (units[0], '') if units else (1e-6, f' ({GUESSED})')
        headings = ', '.join(f"'{self.headings[k].text}'" for k in films)
        source = '' if headings == "'thickness_um'" else f' from {headings}'
        layers = np.array(self.layers)[which] if self.layers else np.array(self.of('layer'))[row]
        words = f'thickness in {UNIT_NAMES[unit]}{how}{source}'
        return values[row, which] * round(unit * 1e6, 9), row, layers, words

    @property
    def figures_at_end(self) -> str:
        """What could be statistics of the rest at the end of readings in order, '' for nothing.

        One of them is the mean of the rest, as exactly as it is written.
        """
        films = self.at['thickness']
        if len(films) > 1 or self.labels or self.has(*AXES) or self.has(*ON_FACE):
            return ''
        texts = [text.replace(',', '.') for text in self.texts(films[0])]
        values = self.numbers(films[0], may_be_empty=True)
        if np.isnan(values).any():
            return ''
        decimals = [len(text.partition('.')[2]) for text in texts]
        for count in range(min(6, len(values) - 3), 0, -1):
            rest, last = values[:-count], values[-count:]
            least, most = rest.min(), rest.max()
            figures = np.array([
                rest.mean(), rest.std(), rest.std(ddof=1), np.median(rest), least, most,
                most - least, rest.sum(), len(rest),
            ])  # fmt: skip
            finest = np.maximum(decimals[-count:], max(decimals[:-count]))
            alike = abs(last[:, None] - figures) <= 0.5 * 10.0 ** -finest[:, None] + 1e-9
            if least < most and alike.any(axis=1).all() and alike[:, 0].any():
                what = f'last {count} values' if count > 1 else 'last value'
                kind = 'statistics' if count > 1 else 'the mean'
                return f'its {what}, {", ".join(texts[-count:])}, may be {kind} of the rest'
        return ''

    def doubts(self) -> Iterator[str]:
        """What may have been meant otherwise, for the user."""
        if figures := self.figures_at_end:
            yield (
                f"'{self.heading('thickness')}': {figures}, and counts as a reading; delete it if "
                "so, or give a column 'point' with the labels of the points"
            )
        beside = max(self.at['thickness']) + 1
        known = {column for columns in self.at.values() for column in columns}
        if not self.form.startswith('commas') or beside in {*known, len(self.headings)}:
            return
        cells = self.texts(beside)
        if any(cells) and all(map(str.isdigit, [*self.of('thickness'), *filter(None, cells)])):
            yield (
                f"'{self.heading('thickness')}' has whole numbers only, as has "
                f"'{self.headings[beside].text}' beside it: if decimal commas are cut, put "
                'semicolons between the columns'
            )


def _rows_in(
    path: Path, films: bool, layout: Layout, wide: int
) -> tuple[Sheet, int | None, ReadingTable]:
    """The sheet, the row of its headings, and all rows below with the columns of the quantities.

    ``wide`` is the number of columns of a table without headings, 0 for one that has them. A
    second table under other headings is refused; the same headings again are passed over.
    """
    needed = (('thickness',),) if films else (AXES, ON_FACE)

    def known(headings: list[Heading]) -> int:
        """How many quantities headings name, 0 where a needed one is missing."""
        at = columns_of(headings, layout)
        return len(at) if any({*names} <= {*at} for names in needed) else 0

    several: dict[str, Any] = {} if films else {'several': 'save the one of the points by itself'}
    sheet, header = find_table(path, ReadingsError, known, layout.sheet, wide, **several)
    headings = headings_in(sheet.rows[header or 0]) if sheet.rows else []
    if wide:
        headings = [Heading(f'column {k + 1}', ()) for k in range(len(headings))]
    first = 0 if wide or header is None else header + 1
    units_too = 'unit' not in columns_of(headings, layout)
    headings, rows = rows_below(sheet, headings, first, units_too)
    if not known(headings) or (header is None and not wide):
        why = not_found(sheet, [] if header is None else headings, films, layout)
        raise ReadingsError(f'{path}: {why}')
    table = ReadingTable(
        path, sheet.form, headings, sheet.rows, sheet.lines, ReadingsError,
        at=columns_of(headings, layout), layout=layout,
    )  # fmt: skip
    again = [] if header is None else headings_again(table, header, known)
    return sheet, header, table.select([row for row in rows if row not in again])
