"""A table in a file: headings, the rows under them, and their numbers."""

import re
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from paint_deposition.errors import PaintError
from paint_deposition.files.tables.headings import MOST_LINES_ABOVE, UNITS, Heading, unit_of
from paint_deposition.files.tables.sheets import Cell, cell_at, is_nothing, is_value, text_of

MOST_ERRORS_SHOWN, MOST_REPEATS = 8, 50
NUMBER_AND_MORE = re.compile(r'([+\-−]?[\d.,]+)\s*([^\W\d]\D*|°)')
NUMBER = re.compile(r'[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|[+-]?(?:nan|inf(?:inity)?)')
Kind = TypeVar('Kind', bound='Table')
SWITCHED = {
    **dict.fromkeys(('true', 'on', 'yes', 'wahr', 'ein', 'an', 'ja'), 1.0),
    **dict.fromkeys(('false', 'off', 'no', 'falsch', 'aus', 'nein'), 0.0),
}


@dataclass
class Table:
    """Headings and the rows of cells under them, without comments and blank rows.

    ``form`` says how it was understood, for the user; ``lines`` are those of the file that the
    rows stand in; ``refusal`` is the class of its errors; ``decimal`` the mark of its numbers.
    """

    path: Path
    form: str
    headings: list[Heading]
    rows: list[list[Cell]]
    lines: list[int]
    refusal: type[PaintError]
    decimal: str = '.'
    _errors: dict[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.rows)

    def texts(self, column: int) -> list[str]:
        """A column as texts."""
        return [text_of(cell_at(row, column)) for row in self.rows]

    def numbers(
        self, column: int, may_be_empty: bool = False, finite: bool = True, switch: bool = False
    ) -> np.ndarray:
        """A column (N,) as written; what is no number is an error.

        Blank cells may give nan, nan and inf may be taken (not ``finite``),
        and with ``switch`` on, off, yes, no, true and false are numbers too.
        """
        values = np.full(len(self), np.nan)
        name = self.headings[column].text or f'column {column + 1}'
        for index, row in enumerate(self.rows):
            cell = cell_at(row, column)
            value = self.number(cell)
            if may_be_empty and is_nothing(cell):
                continue
            if switch and text_of(cell).lower() in SWITCHED:
                value = SWITCHED[text_of(cell).lower()]
            if value is None:
                mark = 'comma' if self.decimal == ',' else 'point'
                wanted = f'expected a number with a decimal {mark}'
                wanted += ', or n/a where there is none' if may_be_empty else ''
                if NUMBER_AND_MORE.fullmatch(text_of(cell)):
                    wanted += '; write the one unit in the heading'
                self.add_error(index, f"{name} is '{text_of(cell)}'; {wanted}")
            elif finite and not np.isfinite(value):
                self.add_error(index, f'{name} is {cell}; expected a finite number')
            else:
                values[index] = value
        return values

    def number(self, cell: Cell) -> float | None:
        """The number in a cell, None where it is none."""
        if isinstance(cell, float):
            return cell
        text = cell.replace('−', '-').lower()
        if self.decimal == ',':
            text = text.replace('.', '?').replace(',', '.')
        return float(text) if NUMBER.fullmatch(text) else None

    def written(self, columns: Sequence[int]) -> str:
        """Headings as the file has them; of all columns where none are given."""
        return ' '.join(self.headings[k].text for k in columns or range(len(self.headings)))

    def add_error(self, row: int, text: str) -> None:
        """Note what is wrong in a row; the first of a row counts, others may follow from it."""
        self._errors.setdefault(self.lines[row], text)

    def add_width_error(self, row: int) -> None:
        """Note that a row has not as many values as there are headings."""
        cells = self.rows[row]
        text = f'{len(cells)} values under {len(self.headings)} column names'
        if self.form.startswith('commas') and len(cells) > len(self.headings):
            text += '; with decimal commas, put semicolons between the columns'
        self.add_error(row, text)

    def error(self, text: str) -> PaintError:
        """What is wrong with the file as a whole, as an error to raise."""
        return self.refusal(f'{self.path}: {text}')

    def refuse_errors(self) -> None:
        """Refuse the file with all that is wrong in its lines, up to a number."""
        if not self._errors:
            return
        sheet = re.match(r"sheet '.*'", self.form)
        place = f'{sheet[0]}, row' if sheet else 'line'
        lines = [f'{place} {line}: {text}' for line, text in sorted(self._errors.items())]
        count = f'{len(lines)} errors: ' if len(lines) > 1 else ''
        if (more := len(lines) - MOST_ERRORS_SHOWN) > 0:
            lines[MOST_ERRORS_SHOWN:] = [f'and {more} more']
        raise self.error(count + '; '.join(lines))

    def select(self: Kind, rows: Sequence[int]) -> Kind:
        """The chosen rows (indices); errors are shared."""
        return replace(
            self, rows=[self.rows[k] for k in rows], lines=[self.lines[k] for k in rows]
        )

    def without(
        self: Kind, columns: Collection[int], is_none: Callable[[int, Cell], bool]
    ) -> Kind:
        """The table with n/a in place of the cells of columns that are none, by row and cell."""
        rows = [
            ['n/a' if k in columns and is_none(n, c) else c for k, c in enumerate(row)]
            for n, row in enumerate(self.rows)
        ]
        return replace(self, rows=rows)

    def with_repeats_apart(self: Kind, columns: Sequence[int]) -> tuple[Kind, list[int]]:
        """The table with a column for each of several numbers in one cell, as in '21.5; 22.1'.

        Then the columns of all these numbers.
        """
        headings, found, width = [*self.headings], [*columns], len(self.headings)
        repeats = any(';' in text for k in columns for text in self.texts(k))
        if not repeats or max(map(len, self.rows)) > width:
            return self, found
        rows = [[*row, *[''] * (width - len(row))] for row in self.rows]
        for k in columns:
            cells = [[part.strip() for part in text.split(';')] for text in self.texts(k)]
            most = max(map(len, cells))
            if not 1 < most <= MOST_REPEATS:
                continue
            found += range(len(headings), len(headings) + most - 1)
            headings += [
                replace(headings[k], text=f'{headings[k].text} ({number})')
                for number in range(2, most + 1)
            ]
            for row, parts in zip(rows, cells, strict=True):
                row[k] = parts[0]
                row += [*parts[1:], *[''] * (most - len(parts))]
        return replace(self, headings=headings, rows=rows), found

    def without_units_in_cells(self: Kind, columns: Iterable[int]) -> Kind:
        """The table with the unit behind the numbers of a column in its heading instead.

        Units that differ, also from the heading's, stay where they are, to be refused.
        """
        headings, rows = [*self.headings], self.rows
        for k in columns:
            texts, heading = self.texts(k), self.headings[k]
            if not any(map(NUMBER_AND_MORE.fullmatch, texts[:MOST_LINES_ABOVE])):
                continue
            split = [NUMBER_AND_MORE.fullmatch(text) for text in texts]
            units = {
                unit_of(one[2]) if one else heading.unit
                for one, text in zip(split, texts, strict=True)
                if one or is_value(text)
            }
            units |= {heading.unit} - {''}
            if len(units) > 1 or not units <= {*UNITS}:
                continue
            (unit,) = units
            text = heading.text if heading.unit else f'{heading.text} [{unit}]'
            headings[k] = replace(heading, text=text, unit=unit)
            rows = [
                [*row[:k], one[1], *row[k + 1 :]] if one else row
                for row, one in zip(rows, split, strict=True)
            ]
        return replace(self, headings=headings, rows=rows)

    def with_decimal(
        self: Kind, columns: Iterable[int], given: str = '', certain: bool = True
    ) -> Kind:
        """The table with the decimal mark of these columns, ``given`` where the user says it.

        A mark that is in doubt is refused, unless it need not be ``certain``.
        """
        seen: dict[str, str] = {}
        only_in_doubt = True
        for row, line in zip(self.rows, self.lines, strict=True):
            for cell in (cell_at(row, column) for column in columns):
                if isinstance(cell, str) and re.fullmatch(r'[+−-]?[\d.,]+(e[+-]?\d+)?', cell):
                    for mark in {'.', ','} & {*cell}:
                        seen.setdefault(mark, f"'{cell}' in line {line}")
                    # With one mark only, three digits behind it may be thousands.
                    only_in_doubt &= ',' not in cell or bool(
                        re.fullmatch(r'[+-]?[1-9]\d{0,2},\d{3}', cell)
                    )
        mark, doubt = given or (',' if ',' in seen else '.'), ''
        if not given and len(seen) > 1:
            doubt = (
                f'decimal point ({seen["."]}) and decimal comma ({seen[","]}) are mixed; use one, '
                'and no mark between thousands'
            )
        elif not given and ',' in seen and only_in_doubt:
            doubt = (
                f'{seen[","]} may have a decimal comma or a comma between thousands; say '
                'decimal: comma, or leave the thousands unmarked'
            )
        if doubt and certain:
            raise self.error(doubt)
        form = self.form + (', decimal comma' if mark == ',' else '')
        return replace(self, decimal=mark, form=form)
