"""Sheets of cells, from text files of any usual encoding and separator and from workbooks."""

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO, StringIO
from pathlib import Path

from paint_deposition.errors import ReadingsError
from paint_deposition.files.parquet import MAGIC, require_libraries
from paint_deposition.files.tables.far_cells import MOST_CELLS, refuse_far_cells
from paint_deposition.files.text import decoded

# Texts without blanks around them; the numbers of a workbook are numbers.
Cell = str | float

SEPARATORS = {',': 'commas', ';': 'semicolons', '\t': 'tabs', '|': 'bars'}
# Columns of a printed list stand apart by blanks; headings of two words by one only.
BLANKS = (re.compile(r'\s{2,}|\t'), re.compile(r'\s+'))
WORKBOOKS = (b'PK\x03\x04', b'\xd0\xcf\x11\xe0')
EXPECTED = 'give gauge readings as CSV, TSV, TXT or Parquet, or a workbook (.xlsx, .xls, .ods)'


@dataclass(frozen=True)
class Sheet:
    """Rows of cells, before anything is known of their meaning; blank rows are left out.

    Attributes:
        rows: of cells.
        lines: of the file or sheet that each row stands in, from 1.
        form: how the cells were found, for the user: 'semicolons, cp1252'.
    """

    rows: list[list[Cell]]
    lines: list[int]
    form: str

    @staticmethod
    def of(numbered: Iterator[tuple[int, list[Cell]]], form: str) -> 'Sheet':
        """The rows that are not blank."""
        kept = [(line, row) for line, row in numbered if any(cell != '' for cell in row)]
        return Sheet([row for _, row in kept], [line for line, _ in kept], form)


def sheets_of(path: Path) -> list[Sheet]:
    """The sheets of a workbook, or a text file once for each separator that it may have.

    Raises:
        ReadingsError: the file cannot be read, or is neither text nor workbook.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise ReadingsError(f'{path}: no such file; {EXPECTED}') from None
    except OSError as error:
        raise ReadingsError(f'{path}: cannot be read ({error.strerror}); {EXPECTED}') from None
    if content.startswith(WORKBOOKS):
        return _sheets_of_workbook(path, content)
    if content.startswith(MAGIC):
        return [_sheet_of_parquet(path, content)]
    found = decoded(content)
    if found is None:
        raise ReadingsError(f'{path}: cannot be read as text; {EXPECTED}')
    text, encoding = found
    split = [
        Sheet.of(_separated(path, text, separator), f'{name}, {encoding}')
        for separator, name in SEPARATORS.items()
        if separator in text
    ]
    lines = text.splitlines()
    blanks = [
        Sheet.of(enumerate((list(pattern.split(line.strip())) for line in lines), 1), form)
        for pattern in BLANKS
        for form in [f'blanks, {encoding}']
    ]
    return split + blanks


def _separated(path: Path, text: str, separator: str) -> Iterator[tuple[int, list[Cell]]]:
    reader = csv.reader(StringIO(text, newline=''), delimiter=separator)
    try:
        for row in reader:
            yield reader.line_num, [_in_one_line(cell) for cell in row]
    except csv.Error as error:
        reason = f'{path}: line {reader.line_num}: cannot be read as CSV text ({error})'
        raise ReadingsError(reason) from None


def _sheets_of_workbook(path: Path, content: bytes) -> list[Sheet]:
    from python_calamine import CalamineError, CalamineWorkbook

    refuse_far_cells(path, content)
    try:
        workbook = CalamineWorkbook.from_filelike(BytesIO(content))
        tables = {
            name: workbook.get_sheet_by_name(name).to_python(skip_empty_area=False)
            for name in workbook.sheet_names
        }
    except CalamineError as error:
        reason = ' '.join(str(error).split())
        raise ReadingsError(f'{path}: cannot be read as a workbook ({reason})') from None
    return [
        Sheet.of(
            enumerate(([_cell(value) for value in row] for row in rows), 1), f"sheet '{name}'"
        )
        for name, rows in tables.items()
    ]


def _sheet_of_parquet(path: Path, content: bytes) -> Sheet:
    require_libraries(str(path))
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(BytesIO(content))
        # A few bytes may claim any number of rows.
        cells = file.metadata.num_rows * file.metadata.num_columns
        if cells > MOST_CELLS:
            raise ReadingsError(
                f'{path}: tells of {cells} values, more than {MOST_CELLS}; give fewer readings'
            )
        table = file.read()
        columns = [
            ['' if value is None or value != value else _cell(value) for value in column]
            for column in (column.to_pylist() for column in table.columns)
        ]
    except (pa.ArrowException, ValueError, OSError) as error:  # of texts that are none, too
        reason = ' '.join(str(error).split())
        raise ReadingsError(f'{path}: cannot be read as Parquet ({reason})') from None
    rows = [list(table.column_names), *map(list, zip(*columns, strict=True))]
    return Sheet.of(enumerate(rows, 1), 'Parquet')


def _cell(value: object) -> Cell:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return _in_one_line(str(value))


def _in_one_line(text: str) -> str:
    return ' '.join(text.strip().splitlines())


def text_of(cell: Cell) -> str:
    """A cell as text; a whole number of a workbook without its point."""
    return f'{cell:.15g}' if isinstance(cell, float) else cell
