"""Sheets of cells, from text files of any usual encoding and separator and from workbooks."""

import csv
import re
import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from io import BytesIO, StringIO
from itertools import chain
from pathlib import Path
from xml.parsers import expat

from pydantic_core import from_json

from paint_deposition.errors import LONGEST_REASON, PaintError, shortened, some
from paint_deposition.files.atomic import read_file
from paint_deposition.files.tables.gauge_formats import FOLDERS, LINES, NOTHING

# Texts without blanks around them; the numbers of a workbook are numbers.
Cell = str | float

WORKBOOKS = (b'PK\x03\x04', b'\xd0\xcf\x11\xe0')
MOST_TABLE_MB = 150
# Of a table; a million rows take 1.2 GB and 40 s.
MOST_ROWS, MOST_COLUMNS, MOST_CELLS = 1_200_000, 16_384, 10_000_000
LINE_BREAK = re.compile(r'\r\n|[\n\r\v\f\x1c-\x1e\x85\u2028\u2029]')
# Of a workbook: its package when it is expanded, and the letters of all its cells.
MOST_EXPANDED_BYTES, MOST_LETTERS = 300_000_000, 300_000_000
DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError)
FAR = 'a workbook (delete what lies far outside the table)'
# Before what a spreadsheet would take for a formula, and no number, a ' is written: where a cell
# begins, also where a semicolon may part two.
FORMULA_BEGINS = r'(?=[=@\t\r]|[+-](?![\d.,]*(e[+-]?\d+)?(;|$)))'
FORMULA, DISARMED = (
    re.compile(rf'(?<![^;]){mark}{FORMULA_BEGINS}', re.IGNORECASE) for mark in ('', "'")
)
EXPECTED = 'give a table as CSV, TSV, TXT or JSON, or a workbook (.xlsx, .xls)'


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
        """The rows that are not blank. Raises ValueError for too many cells."""
        sheet, cells = Sheet([], [], form), 0
        for line, row in numbered:
            cells += len(row)
            if cells > MOST_CELLS or len(row) > MOST_COLUMNS:
                raise ValueError(f'a table ({form}: over {MOST_COLUMNS} columns, or too large)')
            if any(cell != '' for cell in row):
                sheet.rows.append(row)
                sheet.lines.append(line)
        return sheet


def read_sheets(path: Path, refusal: type[PaintError]) -> list[Sheet]:
    """The sheets of a workbook, or a text once for each separator in it, by blanks and by lines.

    Of a folder, the files that ``FOLDERS`` has, else its only one. A file that is neither raises
    ``refusal``.
    """
    files = [path]
    if path.is_dir():
        names = {file.name for file in path.iterdir() if file.is_file()}
        visible = sorted(name for name in names if not name.startswith('.'))
        batch = next((files for files in FOLDERS.values() if {*files} <= names), None)
        if batch is None and len(visible) != 1:
            named = some(visible, 6) or 'no file'
            raise refusal(f'{path} holds {named}; name the one with the table')
        files = [path / name for name in batch or visible]
    try:
        content = b'\n'.join(read_file(file, refusal, MOST_TABLE_MB) for file in files)
    except FileNotFoundError:
        raise refusal(f'{path}: no such file; {EXPECTED}') from None
    except OSError as error:
        raise refusal(f'{path}: cannot be read ({error.strerror}); {EXPECTED}') from None
    try:
        if content.startswith(WORKBOOKS):
            return _sheets_of_workbook(content)
        texts = _decoded(content)
        if records := _records(texts[0][0]):
            return [records]
        return [sheet for text, encoding in texts for sheet in _sheets_of_text(text, encoding)]
    except (ValueError, OverflowError) as error:  # a number of hundreds of digits
        reason = shortened(str(error), LONGEST_REASON)
        raise refusal(f'{path}: cannot be read as {reason}; {EXPECTED}') from None


def text_of(cell: Cell) -> str:
    """A cell as text; a whole number of a workbook without its point."""
    return f'{cell:.15g}' if isinstance(cell, float) else cell


def _decoded(content: bytes) -> list[tuple[str, str]]:
    """The text and the encoding's name: by its mark, else UTF-8, else what it may be."""
    marks = {b'\xef\xbb\xbf': 'utf-8-sig', b'\xff\xfe': 'utf-16', b'\xfe\xff': 'utf-16'}
    marked = [codec for mark, codec in marks.items() if content.startswith(mark)]
    found = []
    for codec in marked or ('utf-8', 'cp1252', 'cp932'):
        try:
            text = content.decode(codec)
        except UnicodeDecodeError:
            continue
        if '\0' not in text:
            name = codec.removesuffix('-sig')
            found.append((text, name.upper() if name.startswith('utf') else name))
        if codec.startswith('utf'):
            break
    if not found:
        raise ValueError('text')
    return found


def _records(text: str) -> Sheet | None:
    """The first list of records in JSON as a table, what stands beside it above; else None."""
    try:
        found = from_json(text) if text.lstrip()[:1] in ('[', '{') else None
    except ValueError:
        return None
    above: list[list[Cell]] = []
    while isinstance(found, dict):
        above += [[_cell(key), _cell(value)] for key, value in found.items()]
        found = next((value for value in found.values() if isinstance(value, list | dict)), None)
    records = [one for one in found or () if isinstance(one, dict)]
    if not records:
        return None
    keys = list(dict.fromkeys(key for record in records for key in record))
    rows = ([_cell(record.get(key)) for key in keys] for record in records)
    return Sheet.of(enumerate(chain(above, [[*map(_cell, keys)]], rows), 1), 'JSON')


def _sheets_of_text(text: str, encoding: str) -> list[Sheet]:
    if sum(1 for _ in LINE_BREAK.finditer(text)) > MOST_ROWS:
        raise ValueError(f'a table (over {MOST_ROWS} lines; split it)')
    sheets = []
    separators = {'\t': 'tabs', ';': 'semicolons', '|': 'bars', ',': 'commas'}
    for mark, name in separators.items():
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
    for name, pattern in LINES.items():
        rows = [
            (number, [_cell(part or '') for part in found.groups()])
            for number, line in enumerate(lines, 1)
            if (found := pattern.fullmatch(line))
        ]
        if 2 * len(rows) > len(whole.rows):
            sheets.append(Sheet.of([(0, [*pattern.groupindex]), *rows], f'{name}, {encoding}'))
    return [*sheets, Sheet.of(by_blanks, f'blanks, {encoding}'), whole]


def _sheets_of_workbook(content: bytes) -> list[Sheet]:
    from python_calamine import CalamineError, CalamineWorkbook

    try:
        if content.startswith(WORKBOOKS[0]):
            with zipfile.ZipFile(BytesIO(content)) as package:
                _require_small(package)
        workbook = CalamineWorkbook.from_filelike(BytesIO(content))
        sheets, left = [], MOST_CELLS
        for sheet in map(workbook.get_sheet_by_name, workbook.sheet_names):
            if (left := left - sheet.total_height * sheet.total_width) < 0:
                raise ValueError(FAR)
            rows = ([_cell(value) for value in row] for row in sheet.to_python(False))
            sheets.append(Sheet.of(enumerate(rows, 1), f"sheet '{sheet.name}'"))
        return sheets
    except (CalamineError, *DAMAGE) as error:
        raise ValueError(f'a workbook ({error})') from None


def _require_small(package: zipfile.ZipFile) -> None:
    """Raise ValueError for an .xlsx whose cells or texts would fill the memory.

    calamine keeps all cells up to the last one, some 30 bytes each, and the text of each. A sheet
    may have any name in the package.
    """
    names = {name.lower() for name in package.namelist()}
    if 'xl/workbook.xml' not in names or names & {'xl/workbook.bin', 'content.xml'}:
        raise ValueError('a workbook (an .ods or .xlsb; save it as .xlsx)')
    texts, left, cells, strings = [0], MOST_EXPANDED_BYTES, 0, 0
    row = column = height = width = 0
    letters: set[str] = set()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal cells, strings, row, column, height, width
        kind, place = tag.rpartition(':')[2], attributes.get('r', '')
        if kind == 'si':
            texts.append(0)
        elif kind == 'row':
            row, column = int(place or row + 1), 0
        elif kind == 'c':
            cells, column = cells + 1, column + (not place)
            strings += attributes.get('t') == 's'
            name = place.rstrip('0123456789')
            letters.add(name[:7])
            height, width = max(height, row, int(place[len(name) :] or 0)), max(width, column)
            if cells > MOST_CELLS:
                raise ValueError(FAR)

    for member in package.infolist():
        row = height = width = 0
        letters.clear()
        parser = expat.ParserCreate()
        parser.StartElementHandler = begin
        if is_texts := member.filename.lower() == 'xl/sharedstrings.xml':
            parser.CharacterDataHandler = lambda text: texts.append(texts.pop() + len(text))
        if (left := left - member.file_size) < 0:
            raise ValueError(f'a workbook (over {MOST_EXPANDED_BYTES / 1e6:g} MB, expanded)')
        try:
            with package.open(member) as content:  # the end is compared with what the head says
                parser.ParseFile(content)
        except expat.ExpatError as error:  # a picture, for instance
            if is_texts or b'sheetData' in package.read(member):
                raise ValueError(f'a workbook ({member.filename}: {error})') from None
        named = (sum(26**k * (ord(c) & 31) for k, c in enumerate(n[::-1])) for n in letters)
        if height * (max(named, default=0) + width) > MOST_CELLS:
            raise ValueError(FAR)
    if strings * max(texts) > MOST_LETTERS:
        raise ValueError(f'a workbook (a text of {max(texts)} letters; shorten it)')


def _cell(value: object) -> Cell:
    """A value as a cell; nothing of what JSON has nested."""
    if value is None or isinstance(value, list | dict):
        return ''
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    text = ' '.join(str(value).strip().splitlines())
    return DISARMED.sub('', text).strip() if "'" in text else text


def cell_at(row: list[Cell], column: int) -> Cell:
    """The cell of a row in a column, '' where the row is shorter."""
    return row[column] if column < len(row) else ''


def is_comment(row: list[Cell]) -> bool:
    """Whether a row is a comment; '#' alone heads a column of numbers."""
    return text_of(row[0]).startswith('#') and (row[0] != '#' or len(row) == 1)


def is_value(cell: Cell) -> bool:
    """Whether a cell looks like a number, with or without a unit behind it."""
    return isinstance(cell, float) or re.match(r'[+\-−<>]?\s*[.,]?\d', cell) is not None


def is_nothing(cell: Cell) -> bool:
    """Whether a cell is blank or says that there is no reading."""
    return not isinstance(cell, float) and NOTHING.fullmatch(cell) is not None
