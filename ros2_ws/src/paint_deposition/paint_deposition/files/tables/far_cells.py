"""Refuses a workbook that claims more cells than a table of readings has, before it is read.

A reader of workbooks keeps all cells between the first and the last one of a sheet: a single cell
far away, or one that is said to repeat, would take the memory of the machine.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from functools import reduce
from io import BytesIO
from pathlib import Path
from xml.parsers.expat import ExpatError, ParserCreate
from zipfile import BadZipFile, ZipFile

from paint_deposition.errors import ReadingsError

# Some 30 bytes each.
MOST_CELLS = 10_000_000
MOST_BYTES = 300_000_000
PLACE = re.compile(r'([A-Z]{1,3})(\d{1,7})', re.IGNORECASE)
COUNT = re.compile(r'\d{1,12}')


def refuse_far_cells(path: Path, content: bytes) -> None:
    """Look through the sheets of a workbook, if it is of XML (.xlsx, .ods).

    Raises:
        ReadingsError: its sheets are too large, or no XML.
    """
    try:
        with ZipFile(BytesIO(content)) as package:
            members = [i for i in package.infolist() if i.filename.lower().endswith('.xml')]
            if sum(info.file_size for info in members) > MOST_BYTES:
                raise ReadingsError(
                    f'{path}: is too large for a table of readings; keep only the sheet with them'
                )
            sheets = [package.read(info) for info in members]
    except (BadZipFile, NotImplementedError, RuntimeError, OSError, ValueError, zlib.error):
        return  # an older workbook, or damaged: its reader says so
    try:
        for sheet in sheets:
            _Extent(path).read(sheet)
    except ExpatError as error:
        raise ReadingsError(f'{path}: cannot be read as a workbook ({error})') from None


class _Extent:
    """How far the cells of a sheet reach: by their places in .xlsx, by their counts in .ods."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._last_row = self._last_column = 0
        # Of .ods: cells of the row so far, up to the last one that is not empty, and the rows.
        self._columns = self._filled = self._rows = self._repeats = 0

    def read(self, sheet: bytes) -> None:
        parser = ParserCreate()
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.Parse(sheet, True)

    def _start(self, tag: str, attributes: Mapping[str, str]) -> None:
        if tag == 'table:table':
            self._last_row = self._last_column = self._rows = 0
        elif tag == 'table:table-row':
            self._columns = self._filled = 0
            self._repeats = _count(attributes, 'table:number-rows-repeated')
        elif tag in ('table:table-cell', 'table:covered-table-cell'):
            self._columns += _count(attributes, 'table:number-columns-repeated')
            if any(name.startswith(('office:', 'table:formula')) for name in attributes):
                self._fill()
        elif tag == 'text:p':
            self._fill()
        elif tag.rpartition(':')[2] == 'c' and (place := PLACE.match(attributes.get('r', ''))):
            self._reach(int(place[2]), _column(place[1]), f'cell {place[0]}')

    def _fill(self) -> None:
        self._filled = self._columns

    def _end(self, tag: str) -> None:
        if tag == 'table:table-row':
            self._rows += self._repeats
            if self._filled:
                what = f'row {self._rows} and column {self._filled} by cells that repeat'
                self._reach(self._rows, self._filled, what)

    def _reach(self, row: int, column: int, what: str) -> None:
        self._last_row = max(self._last_row, row)
        self._last_column = max(self._last_column, column)
        if self._last_row * self._last_column > MOST_CELLS:
            raise ReadingsError(
                f'{self._path}: a sheet reaches to {what}; delete what lies outside the table'
            )


def _column(letters: str) -> int:
    return reduce(lambda sum_, letter: 26 * sum_ + ord(letter) - 64, letters.upper(), 0)


def _count(attributes: Mapping[str, str], name: str) -> int:
    """How often a cell or row stands there; a count that is none is the reader's to refuse."""
    text = attributes.get(name, '1')
    return int(text) if COUNT.fullmatch(text) else 1
