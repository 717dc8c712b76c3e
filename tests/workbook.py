"""Workbooks written by hand, as little of them as spreadsheets need."""

import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import escape

TYPES = """<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels"
 ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="xml"
 ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"/>
<Override PartName="/xl/workbook.xml"
 ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/>
</Types>"""
OFFICE = 'http://schemas.openxmlformats.org/officeDocument/2006/relationships'
PACKAGE = 'http://schemas.openxmlformats.org/package/2006/relationships'
MAIN = 'http://schemas.openxmlformats.org/spreadsheetml/2006/main'


def write_workbook(path: Path, sheets: Mapping[str, Sequence[Sequence[object]]]) -> Path:
    """Write named sheets of rows; None leaves a cell out."""
    with zipfile.ZipFile(path, 'w') as book:
        book.writestr('[Content_Types].xml', TYPES)
        book.writestr('_rels/.rels', _relations({'workbook.xml': 'officeDocument'}, 'xl/'))
        files = {f'sheet{k}.xml': 'worksheet' for k in range(1, len(sheets) + 1)}
        book.writestr('xl/_rels/workbook.xml.rels', _relations(files, ''))
        names = ''.join(
            f'<sheet name="{escape(name)}" sheetId="{k}" r:id="r{k}"/>'
            for k, name in enumerate(sheets, 1)
        )
        book.writestr(
            'xl/workbook.xml',
            f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><sheets>{names}</sheets></workbook>',
        )
        for k, rows in enumerate(sheets.values(), 1):
            cells = ''.join(
                f'<row r="{number}">'
                f'{"".join(_cell(value, number, c) for c, value in enumerate(row))}</row>'
                for number, row in enumerate(rows, 1)
            )
            text = f'<worksheet xmlns="{MAIN}"><sheetData>{cells}</sheetData></worksheet>'
            book.writestr(f'xl/sheet{k}.xml', text)
    return path


def _relations(files: Mapping[str, str], folder: str) -> str:
    links = ''.join(
        f'<Relationship Id="r{k}" Type="{OFFICE}/{kind}" Target="{folder}{file}"/>'
        for k, (file, kind) in enumerate(files.items(), 1)
    )
    return f'<Relationships xmlns="{PACKAGE}">{links}</Relationships>'


def _cell(value: object, row: int, column: int) -> str:
    place = f'{chr(ord("A") + column)}{row}'
    if value is None:
        return ''
    if isinstance(value, int | float):
        return f'<c r="{place}"><v>{value}</v></c>'
    return f'<c r="{place}" t="inlineStr"><is><t>{escape(str(value))}</t></is></c>'
