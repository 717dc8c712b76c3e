"""A table in a file: headings, the rows under them, and their numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from paint_deposition.errors import PaintError
from paint_deposition.files.tables.headings import LENGTHS, Heading, length_of
from paint_deposition.files.tables.sheets import Cell, Sheet, read_sheets, text_of

# A heading further down than this is none.
MOST_LINES_ABOVE = 200
MOST_HEADINGS_SHOWN = 20
MOST_COMPLAINTS_SHOWN = 8
NUMBER = re.compile(r'([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|[+-]?(?:nan|inf(?:inity)?))\s*(.*)')
# Cells with which a gauge says that it has no reading.
NOTHING = re.compile(r'[-–—.*]*|n\.?/?a\.?|#n/a|none|null', re.IGNORECASE)
SWITCHED = {'true': 1.0, 'on': 1.0, 'yes': 1.0, 'false': 0.0, 'off': 0.0, 'no': 0.0}


class Header(Protocol):
    """What is known of the columns under a row of headings."""

    header: int

    @property
    def score(self) -> int:
        """How much is known: of several ways to read a file the one that knows most is right."""

    def serves(self) -> bool:
        """Whether the columns that are needed are among them."""


Found = TypeVar('Found', bound=Header)


@dataclass
class Table:
    """Headings and the rows under them; comments and blank rows are left out.

    Attributes:
        path: of the file. form: how it was understood, for the user.
        headings: of all columns.
        rows: of cells. lines: of the file that each row stands in.
        refusal: the class of the errors.
        decimal: the decimal mark of its numbers, '.' or ','.
    """

    path: Path
    form: str
    headings: list[Heading]
    rows: list[list[Cell]]
    lines: list[int]
    refusal: type[PaintError]
    decimal: str = '.'
    _complaints: dict[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.rows)

    def texts(self, column: int) -> list[str]:
        """A column as texts."""
        return [text_of(_cell(row, column)) for row in self.rows]

    def numbers(
        self,
        column: int,
        units: Container[float] = (),
        may_be_empty: bool = False,
        finite: bool = True,
        switch: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """A column (N,) as written, and metres in the unit behind each number (N,).

        Args:
            column: its index.
            units: of length that may stand behind a number, in metres.
            may_be_empty: whether blank cells give nan without a complaint.
            finite: whether nan and inf are complained of.
            switch: whether on, off, yes, no, true and false are numbers too.
        """
        values, behind = np.full(len(self), np.nan), np.full(len(self), np.nan)
        for index, row in enumerate(self.rows):
            cell = _cell(row, column)
            if may_be_empty and is_nothing(cell):
                continue
            if switch and text_of(cell).lower() in SWITCHED:
                values[index] = SWITCHED[text_of(cell).lower()]
                continue
            value, text = self._number(cell)
            unit = length_of(text) if text else None
            if value is None or (text and unit not in units):
                mark = 'comma' if self.decimal == ',' else 'point'
                wanted = f'expected a number with a decimal {mark}'
                self.complain(index, f"{self._name(column)} is '{text_of(cell)}'; {wanted}")
            elif finite and not np.isfinite(value):
                self.complain(index, f'{self._name(column)} is {cell}; expected a finite number')
            else:
                values[index] = value
                behind[index] = np.nan if unit is None else unit
        return values, behind

    def _name(self, column: int) -> str:
        return self.headings[column].text or f'column {column + 1}'

    def _number(self, cell: Cell) -> tuple[float | None, str]:
        """The number in a cell and the text behind it, its unit."""
        if isinstance(cell, float):
            return cell, ''
        text = cell.replace('−', '-').lower()
        other = '.' if self.decimal == ',' else ','
        if other in text:  # between thousands
            grouped = re.match(rf'[+-]?\d{{1,3}}(\{other}\d{{3}})+(?!\d)', text)
            text = text.replace(other, '') if grouped else ''
        text = text.replace(',', '.')
        found = NUMBER.fullmatch(text)
        return (float(found[1]), found[2]) if found else (None, '')

    def written(self, columns: Sequence[int]) -> str:
        """Headings as the file has them."""
        return ' '.join(self.headings[column].text for column in columns)

    def complain(self, row: int, text: str) -> None:
        """Note what is wrong in a row; the first of a row counts, others may follow from it."""
        self._complaints.setdefault(self.lines[row], text)

    def error(self, text: str) -> PaintError:
        """What is wrong with the file as a whole, as an error to raise."""
        return self.refusal(f'{self.path}: {text}')

    def refuse_complaints(self) -> None:
        """Refuse the file if anything is wrong in its lines.

        Raises:
            PaintError: with every complaint and its line, up to a number.
        """
        if not self._complaints:
            return
        lines = [f'line {line}: {text}' for line, text in sorted(self._complaints.items())]
        more = len(lines) - MOST_COMPLAINTS_SHOWN
        rest = f'; and {more} more' if more > 0 else ''
        count = f'{len(lines)} complaints: ' if len(lines) > 1 else ''
        raise self.error(f'{count}{"; ".join(lines[:MOST_COMPLAINTS_SHOWN])}{rest}')

    def select(self, rows: Sequence[int]) -> Table:
        """The chosen rows (indices); complaints are shared."""
        return replace(
            self, rows=[self.rows[k] for k in rows], lines=[self.lines[k] for k in rows]
        )

    def with_decimal(self, columns: Iterable[int], given: str = '') -> tuple[Table, str]:
        """The table with the decimal mark that these columns have in common, and what is in doubt.

        Args:
            columns: of numbers.
            given: the mark, if the user gives it.
        """
        certain: dict[str, str] = {}
        unsure = ''
        for row, line in zip(self.rows, self.lines, strict=True):
            for cell in (_cell(row, column) for column in columns):
                digits = re.match(r'[+-]?[\d.,]+', cell) if isinstance(cell, str) else None
                marks = set(digits[0]) & {'.', ','} if digits else set()
                if not digits or not marks:
                    continue
                if re.fullmatch(r'[+-]?[1-9]\d{0,2}[.,]\d{3}', digits[0]):
                    unsure = unsure or (f"'{cell}' in line {line}" if ',' in marks else '')
                else:
                    certain.setdefault(max(marks, key=digits[0].rfind), f"'{cell}' in line {line}")
        mark, doubt = given or next(iter(certain), ',' if unsure else '.'), ''
        if not given and len(certain) > 1:
            point, comma = certain['.'], certain[',']
            doubt = f'decimal point ({point}) and decimal comma ({comma}) are mixed; use one'
        elif not given and not certain and unsure:
            doubt = (
                f'{unsure} may have a decimal comma or a comma between thousands; say which with '
                'decimal: comma or decimal: point'
            )
        form = self.form + (', decimal comma' if mark == ',' else '')
        return replace(self, decimal=mark, form=form), doubt


def read_table(
    path: Path,
    refusal: type[PaintError],
    find: Callable[[Sheet, int], Found | None],
    sheet: str = '',
) -> tuple[Sheet, Found | None]:
    """The sheet of a file, or the way to separate its cells, of which most is known.

    Args:
        path: of a text file or workbook.
        refusal: the class of the errors.
        find: what is known of the columns of a sheet if this row has the headings.
        sheet: name of a workbook's sheet, or ''.

    Raises:
        PaintError: the file cannot be read, or several sheets serve alike.
    """
    best: tuple[Sheet, Found] | None = None
    widest = Sheet([], [], '')
    for sheets in read_sheets(path, refusal):
        if sheet:
            named = [s for s in sheets if s.form == f"sheet '{sheet}'"]
            if not named:
                there = ', '.join(s.form for s in sheets)
                raise refusal(f"{path}: there is no sheet '{sheet}' (there are: {there})")
            sheets = named
        widest = max([widest, *sheets], key=lambda s: len(s.rows[0]) if s.rows else 0)
        known = [(s, found) for s in sheets if (found := _best_header(s, find))]
        for way in known:
            if best is None or _rank(way[1]) > _rank(best[1]):
                best = way
        if best and best[1].serves():
            alike = [s.form for s, found in known if _rank(found) == _rank(best[1])]
            if len(alike) > 1 and alike[0].startswith('sheet'):
                found_in = ' and '.join(alike)
                raise refusal(f'{path}: there are tables in {found_in}; name one, sheet:')
            return best
    return best or (widest, None)


def _best_header(sheet: Sheet, find: Callable[[Sheet, int], Found | None]) -> Found | None:
    rows = range(min(len(sheet.rows), MOST_LINES_ABOVE))
    found = [columns for row in rows if (columns := find(sheet, row)) is not None]
    # A commented line heads a table only where no other one does.
    plain = [c for c in found if not is_comment(sheet.rows[c.header])]
    if not any(columns.serves() for columns in plain):
        plain = found
    return max(plain, key=_rank, default=None)


def _rank(found: Header) -> tuple[bool, int]:
    return found.serves(), found.score


def shown(headings: Sequence[Heading]) -> str:
    """The headings of a table in brackets, for a message."""
    named = [repr(heading.text) for heading in headings if heading.text]
    if len(named) > MOST_HEADINGS_SHOWN:
        named[MOST_HEADINGS_SHOWN:] = [f'and {len(named) - MOST_HEADINGS_SHOWN} more']
    return f'(columns: {", ".join(named) or "none"})'


def is_comment(row: list[Cell]) -> bool:
    """Whether a row is a comment; '#' alone heads a column of numbers."""
    return text_of(row[0]).startswith('#') and (row[0] != '#' or len(row) == 1)


def is_value(cell: Cell) -> bool:
    """Whether a cell looks like a number, with or without a unit behind it."""
    return isinstance(cell, float) or re.match(r'[+\-−<>]?\s*[.,]?\d', cell) is not None


def is_nothing(cell: Cell) -> bool:
    """Whether a cell is blank or says that there is no reading."""
    return not isinstance(cell, float) and NOTHING.fullmatch(cell) is not None


def metres(values: np.ndarray, unit_m: float) -> np.ndarray:
    """Lengths in metres; a division by 1000 comes nearer to the text than a product with 0.001."""
    return values / round(1.0 / unit_m) if unit_m in (1.0, 1e-2, 1e-3) else values * unit_m


def unit_m(heading: Heading) -> float | None:
    """Metres in the unit of a heading, None where it has no unit of length."""
    return LENGTHS.get(heading.unit)


def _cell(row: list[Cell], column: int) -> Cell:
    return row[column] if column < len(row) else ''
