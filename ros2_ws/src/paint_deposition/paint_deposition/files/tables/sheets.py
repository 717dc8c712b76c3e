"""Sheets of cells, from text files of any usual encoding and separator and from workbooks."""

import csv
import re
import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from io import BytesIO, StringIO
from pathlib import Path

from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import read_file, require_small_package
from paint_deposition.files.parquet import MAGIC, require_pyarrow

# Texts without blanks around them; the numbers of a workbook are numbers.
Cell = str | float

SEPARATORS = {'\t': 'tabs', ';': 'semicolons', '|': 'bars', ',': 'commas'}
WORKBOOKS = (b'PK\x03\x04', b'\xd0\xcf\x11\xe0')
ENCODINGS = {b'\xef\xbb\xbf': 'utf-8-sig', b'\xff\xfe': 'utf-16', b'\xfe\xff': 'utf-16'}
# A reader of workbooks keeps all cells up to the last one: some 30 bytes each.
MOST_CELLS = 10_000_000
MOST_TABLE_MB = 500
# The place of a cell, of a row, or of the end of the table.
XLSX_CELL = re.compile(rb'\br=["\']([A-Za-z]{0,3})(\d{1,7})["\']')
# What a spreadsheet would take for a formula, and no number: written with a ' before it.
FORMULA = re.compile(r'[=@\t\r]|[+-](?![\d.,]*(e[+-]?\d+)?$)', re.IGNORECASE)
EXPECTED = 'give a table as CSV, TSV, TXT or Parquet, or a workbook (.xlsx, .xls, .ods)'


@dataclass(frozen=True)
class Sheet:
    """Rows of cells before anything is known of their meaning, without the blank ones.

    ``lines`` are those of the file, from 1; ``form`` says how the cells were found, for the user:
    'semicolons, cp1252'.
    """

    rows: list[list[Cell]]
    lines: list[int]
    form: str

    @staticmethod
    def of(numbered: Iterable[tuple[int, list[Cell]]], form: str) -> 'Sheet':
        """The rows that are not blank."""
        kept = [(line, row) for line, row in numbered if any(cell != '' for cell in row)]
        return Sheet([row for _, row in kept], [line for line, _ in kept], form)


def read_sheets(path: Path, refusal: type[PaintError]) -> list[Sheet]:
    """The sheets of a workbook, or a text once for each separator in it, by blanks and by lines.

    A file that is neither raises ``refusal``.
    """
    try:
        content = read_file(path, refusal, MOST_TABLE_MB)
    except FileNotFoundError:
        raise refusal(f'{path}: no such file; {EXPECTED}') from None
    except OSError as error:
        raise refusal(f'{path}: cannot be read ({error.strerror}); {EXPECTED}') from None
    try:
        if content.startswith(WORKBOOKS):
            return _sheets_of_workbook(content)
        if content.startswith(MAGIC):
            require_pyarrow(str(path))
            return [_sheet_of_parquet(content)]
        return _sheets_of_text(*_decoded(content))
    except ValueError as error:
        reason = ' '.join(str(error).split())
        raise refusal(f'{path}: cannot be read as {reason}; {EXPECTED}') from None


def text_of(cell: Cell) -> str:
    """A cell as text; a whole number of a workbook without its point."""
    return f'{cell:.15g}' if isinstance(cell, float) else cell


def _decoded(content: bytes) -> tuple[str, str]:
    """The text and the encoding's name: by its byte order mark, else UTF-8, else cp1252."""
    marked = [codec for mark, codec in ENCODINGS.items() if content.startswith(mark)]
    for codec in marked or ('utf-8', 'cp1252'):
        try:
            text = content.decode(codec)
        except UnicodeDecodeError:
            continue
        if '\0' not in text:
            name = codec.removesuffix('-sig')
            return text, name.upper() if name.startswith('utf') else name
    raise ValueError('text')


def _sheets_of_text(text: str, encoding: str) -> list[Sheet]:
    sheets = []
    for mark, name in SEPARATORS.items():
        if mark not in text:
            continue
        reader = csv.reader(StringIO(text, newline=''), delimiter=mark)
        try:
            rows = [(reader.line_num, [_cell(cell) for cell in row]) for row in reader]
        except csv.Error as error:
            raise ValueError(f'CSV text (line {reader.line_num}: {error})') from None
        sheets.append(Sheet.of(rows, f'{name}, {encoding}'))
    lines = text.splitlines()
    by_blanks = enumerate((list[Cell](line.split()) for line in lines), 1)
    by_lines = enumerate((list[Cell]([_cell(line)]) for line in lines), 1)
    whole = Sheet.of(by_lines, f'one column, {encoding}')
    return [*sheets, Sheet.of(by_blanks, f'blanks, {encoding}'), whole]


def _sheets_of_workbook(content: bytes) -> list[Sheet]:
    from python_calamine import CalamineError, CalamineWorkbook

    try:
        _refuse_far_cells(content)
        workbook = CalamineWorkbook.from_filelike(BytesIO(content))
        sheets = []
        for sheet in map(workbook.get_sheet_by_name, workbook.sheet_names):
            rows = ([_cell(value) for value in row] for row in sheet.to_python(False))
            sheets.append(Sheet.of(enumerate(rows, 1), f"sheet '{sheet.name}'"))
        return sheets
    except (CalamineError, zipfile.BadZipFile, zlib.error, RuntimeError, OSError) as error:
        raise ValueError(f'a workbook ({error})') from None


def _refuse_far_cells(content: bytes) -> None:
    """Refuse an .xlsx with a stray cell so far away that its sheet would fill the memory."""
    if not zipfile.is_zipfile(BytesIO(content)):
        return
    with zipfile.ZipFile(BytesIO(content)) as package:
        require_small_package(package)
        for name in package.namelist():
            if not (name.startswith('xl/') and name.endswith('.xml')):
                continue
            places = set(XLSX_CELL.findall(package.read(name)))
            widths = [sum(26**k * (c & 31) for k, c in enumerate(a[::-1])) for a, _ in places]
            if max(widths, default=0) * max((int(r) for _, r in places), default=0) > MOST_CELLS:
                raise ValueError('a workbook (delete what lies far outside the table)')


def _sheet_of_parquet(content: bytes) -> Sheet:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(BytesIO(content))
        # A few bytes may claim any number of rows.
        cells = file.metadata.num_rows * file.metadata.num_columns
        if cells > MOST_CELLS:
            raise ValueError(f'{cells} values, more than {MOST_CELLS}')
        table = file.read()
        columns = [
            ['' if value is None or value != value else _cell(value) for value in column]
            for column in (column.to_pylist() for column in table.columns)
        ]
    except (pa.ArrowException, ValueError, OSError) as error:  # of texts that are none, too
        raise ValueError(f'Parquet ({error})') from None
    rows = [list(table.column_names), *map(list, zip(*columns, strict=True))]
    return Sheet.of(enumerate(rows, 1), 'Parquet')


def _cell(value: object) -> Cell:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    text = ' '.join(str(value).strip().splitlines())
    return text[1:].strip() if text[:1] == "'" and FORMULA.match(text[1:]) else text
