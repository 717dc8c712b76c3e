"""Tables of gauge readings and of measuring points: their columns, rows and units.

Columns are known by the project's own names, by a few usual English and German headings, or as
the user names them, see ``Layout``.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.errors import ReadingsError, did_you_mean
from paint_deposition.files.tables.headings import UNIT_NAMES, Heading, length_of, words_of
from paint_deposition.files.tables.sheets import Sheet, text_of
from paint_deposition.files.tables.table import (
    Table,
    find_table,
    headings_in,
    is_comment,
    is_nothing,
    is_value,
    shown,
)

# Columns of our own; where those of a reading are all there, no other name is looked at.
OWN = {
    'x': 'x_m', 'y': 'y_m', 'z': 'z_m', 'thickness': 'thickness_um', 'point': 'point',
    'group': 'group', 'session': 'session', 'sigma': 'sigma_um',
    'nx': 'nx', 'ny': 'ny', 'nz': 'nz',
}  # fmt: skip
AXES = ('x', 'y', 'z')
ON_FACE = ('from_left', 'height')
NORMALS = ('nx', 'ny', 'nz')
LENGTH_UNITS, FILM_UNITS = (1.0, 1e-2, 1e-3, 25.4e-3), (1e-6, 25.4e-6, 1e-3)
# Headings without their unit, numbers of repeats and accents. A word that ends in 'dicke' is a
# thickness too.
ALIASES = {
    'thickness': (
        'thickness', 'film thickness', 'coating thickness', 'film build', 'film', 'dft',
        'reading', 'value', 'messwert',
    ),
    'from_left': ('from left', 'left', 'von links', 'links'),
    'height': ('height', 'from bottom', 'hohe', 'hohe von unten', 'hoehe', 'von unten'),
    'point': (
        'point', 'location', 'spot', 'label', 'position', 'name', 'punkt', 'messpunkt',
        'messstelle', 'stelle',
    ),
    'number': ('no', 'nr', '#', 'number', 'nummer', 'id', 'reading no', 'reading number'),
    'group': ('group', 'gruppe'),
    'unit': ('unit', 'units', 'einheit'),
}  # fmt: skip
QUANTITY = {name: quantity for quantity, names in ALIASES.items() for name in names}
BESIDE_AXIS = {'pos', 'position', 'coordinate', 'koordinate', 'act', 'actual', 'ist'}
# Coordinates without a unit that go beyond this are millimetres: no part is so large in metres.
LARGEST_PART_M = 20.0
STATISTIC = re.compile(
    r'(mean|average|avg|mittel\w*|median|std|sd|stand\w+|min\w*|max\w*|range|spannweite|cv|'
    r'lowest|highest|coefficient|vari\w*|statist\w*|number of|count|anzahl|sum|total|n|s|x)\b'
)


@dataclass(frozen=True)
class Layout:
    """What the user says of a table; what is left out is found.

    Attributes:
        columns: heading, or number from 1, of a quantity's column.
        unit: metres in the unit of 'position' and of 'thickness'.
        decimal: '.' or ',', or '' where it is to be found.
        sheet: name of a workbook's sheet, or ''.
    """

    columns: Mapping[Any, str | int] = field(default_factory=dict)
    unit: Mapping[Any, float] = field(default_factory=dict)
    decimal: str = ''
    sheet: str = ''


@dataclass(frozen=True)
class ReadingTable:
    """Rows of readings or points, apart from all that stands around them.

    Attributes:
        table: their cells.
        at: columns of each quantity; several of the thickness where each row holds repeats.
        layout: what the user said of it.
        order: number of each row from 1, those without a reading counted.
        film_unit_m: metres in the unit of the thickness where a line above or a column has it.
        left_out: what was not taken for a row, for the user.
    """

    table: Table
    at: dict[str, list[int]]
    layout: Layout
    order: list[int]
    film_unit_m: float | None
    left_out: str

    @staticmethod
    def read(
        path: Path, films: bool, layout: Layout, labels: Collection[str] = ()
    ) -> ReadingTable:
        """Find the table in a file.

        Args:
            path: of a text file or workbook.
            films: whether it holds readings, not only places.
            layout: what the user says of it.
            labels: of the listed points: a row with one of them is no statistic.

        Raises:
            ReadingsError: no such table; its lines are complained of later, all at once.
        """
        numbered = bool(layout.columns) and all(type(n) is int for n in layout.columns.values())

        def known(headings: list[Heading]) -> int:
            at = _columns(headings, layout)
            return len(at) if ('thickness' in at if films else _has_place(at)) else 0

        sheet, header = find_table(path, ReadingsError, known, layout.sheet)
        first = 0 if numbered or header is None else header + 1
        if header is None and not numbered:
            raise ReadingsError(f'{path}: {_not_found(sheet, films, layout)}')
        headings = headings_in(sheet.rows[header or 0])
        if numbered:
            headings = [Heading(f'column {k + 1}', ()) for k in range(len(headings))]
        at = _columns(headings, layout)
        rows = [k for k in range(first, len(sheet.rows)) if not is_comment(sheet.rows[k])]
        table = Table(path, sheet.form, headings, sheet.rows, sheet.lines, ReadingsError)
        table = table.select(rows)
        _refuse_rivals(table, at)
        numeric = [k for q in (*AXES, *ON_FACE, *NORMALS, 'sigma') for k in at.get(q, [])]
        numeric += at['thickness'] if films else []
        table, doubt = table.with_decimal(numeric, layout.decimal)
        if doubt:
            raise table.error(doubt)
        kept, order, left_out = _rows_of_readings(table, at, films, numeric, {*labels})
        if not kept:
            table.refuse_complaints()
            raise table.error('no readings below the header')
        table = table.select(kept)
        return ReadingTable(
            table, at, layout, order, _unit_beside(table, at, sheet, header or 0), left_out
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

    def numbers(self, quantity: str, may_be_empty: bool = False) -> np.ndarray:
        """A column (N,) of numbers as written."""
        return self.table.numbers(self.at[quantity][0], may_be_empty=may_be_empty)

    def lengths_m(self, quantities: Sequence[str]) -> tuple[np.ndarray, str]:
        """Columns of lengths (N, len(quantities)) [m], and their unit in words.

        Raises:
            ReadingsError: their units differ, or are none of a position.
        """
        values = np.column_stack([self.numbers(quantity) for quantity in quantities])
        given = self.layout.unit.get('position')
        headings = [self.table.headings[self.at[quantity][0]] for quantity in quantities]
        units = {given} if given else {heading.unit_m for heading in headings}
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
        how = '' if unit else ' (no unit is given)'
        factor = round((unit or 1e-6) * 1e6, 9)
        words = f'thickness in {UNIT_NAMES[unit or 1e-6]}{how}{source}'
        return values[row, which] * factor, row, words


def _columns(headings: list[Heading], layout: Layout) -> dict[str, list[int]]:
    """The columns of each quantity under these headings; the user's, else those that are known."""
    texts = [heading.text for heading in headings]
    small = [text.casefold() for text in texts]
    own = {q: [k for k, text in enumerate(texts) if text == name] for q, name in OWN.items()}
    own = {q: columns for q, columns in own.items() if columns}
    at: dict[str, list[int]] = {}
    if not {*AXES, 'thickness'} <= {*own}:
        for column, heading in enumerate(headings):
            if quantity := _quantity(heading):
                at.setdefault(quantity, []).append(column)
        if {*AXES} <= {*at}:
            at = {q: columns for q, columns in at.items() if q not in ON_FACE}
    at |= own
    for quantity, name in layout.columns.items():
        wanted = name - 1 if isinstance(name, int) else -1
        if isinstance(name, str) and name.strip().casefold() in small:
            wanted = small.index(name.strip().casefold())
        if not 0 <= wanted < len(headings):
            return {}
        at = {q: [k for k in columns if k != wanted] for q, columns in at.items()}
        at = {q: columns for q, columns in at.items() if columns} | {quantity: [wanted]}
    return at


def _quantity(heading: Heading) -> str | None:
    """What a heading names, None where it is not known."""
    words = [word for word in heading.words if not word.isdigit()]
    letters = ''.join(word for word in words if word not in BESIDE_AXIS)
    if letters in (*AXES, *NORMALS):
        return letters
    if (words and words[-1].endswith('dicke')) or QUANTITY.get(' '.join(words)) == 'thickness':
        return None if heading.unit and heading.unit_m not in FILM_UNITS else 'thickness'
    return QUANTITY.get(' '.join(words))


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


def _has_place(at: Collection[str]) -> bool:
    return {*AXES} <= {*at} or {*ON_FACE} <= {*at}


def _not_found(sheet: Sheet, films: bool, layout: Layout) -> str:
    """Why a file has no such table, and what to do."""
    if not sheet.rows:
        return 'there is nothing to read in it; give a table with a heading over each column'
    headings = headings_in(sheet.rows[0])
    texts = [heading.text for heading in headings]
    for quantity, name in layout.columns.items():
        if isinstance(name, str) and name not in texts:
            remedy = did_you_mean(name, filter(None, texts), 'copy the heading')
            return f"no column '{name}' for {quantity} {shown(headings)}; {remedy}"
    if films:
        return (
            f'no column is known as the thickness {shown(headings)}; call it thickness_um, or '
            'give its heading or number with columns: {thickness: ...} in the campaign'
        )
    return f'no columns are known as x, y, z, or from_left, height {shown(headings)}; rename them'


def _unit_beside(
    table: Table, at: dict[str, list[int]], sheet: Sheet, header: int
) -> float | None:
    """Metres in the unit of the thickness that a column, or a line above the table, has."""
    if 'unit' in at:
        for row, text in enumerate(table.texts(at['unit'][0])):
            if text and length_of(text) not in FILM_UNITS:
                table.complain(row, f"the unit is '{text}'; expected µm, mil or mm")
        units = {length_of(text) for text in table.texts(at['unit'][0]) if text}
        if len(units) > 1:
            table.refuse_complaints()
            raise table.error('the thickness is in several units; give all readings in one')
        return units.pop() if units else None
    for row in sheet.rows[:header]:
        cells = [part for cell in row for part in text_of(cell).split(':') if part]
        if len(cells) > 1 and words_of(cells[0]) in ((name,) for name in ALIASES['unit']):
            return length_of(cells[1])
    return None


def _rows_of_readings(
    table: Table, at: dict[str, list[int]], films: bool, numeric: list[int], labels: set[str]
) -> tuple[list[int], list[int], str]:
    """Rows that are readings or points, their numbers, and in words what else there is.

    A row with a place is one, whatever its label. One without a place, or in a table without
    places, is a statistic if it begins with the name of one and not with the label of a listed
    point. A missing reading keeps its number.
    """
    kept: list[int] = []
    order: list[int] = []
    count = {'without a reading': 0, 'of statistics': 0, 'of other text': 0}
    width = len(table.headings)
    places = [k for q in (*AXES, *ON_FACE) for k in at.get(q, [])]
    (label,) = at.get('point') or at.get('number') or [-1]
    for k, row in enumerate(table.rows):
        cells = [*row, *[''] * (width - len(row))]
        values = [cells[c] for c in at['thickness']] if films else []
        placed = any(is_value(cells[c]) for c in places)
        begins = next(text_of(cell) for cell in cells if cell != '')
        listed = label >= 0 and text_of(cells[label]) in labels
        missing = bool(values) and all(map(is_nothing, values))
        named = STATISTIC.match(' '.join(words_of(begins))) and not is_nothing(begins)
        if named and not placed and not listed:
            count['of statistics'] += 1
        elif not placed and not any(map(is_value, values)):
            # A remark has no reading either, but no other number and no n/a in its place.
            missing &= any(values) or any(map(is_value, cells))
            count['without a reading' if missing else 'of other text'] += 1
        elif len(row) <= max(numeric) or any(cell != '' for cell in cells[width:]):
            table.complain(k, f'{len(row)} values under {width} column names')
        elif missing:
            count['without a reading'] += 1
        else:
            kept.append(k)
            order.append(len(kept) + count['without a reading'])
    parts = [f'{n} row{"s" * (n > 1)} {what}' for what, n in count.items() if n]
    return kept, order, f'left out: {", ".join(parts)}' if parts else ''
