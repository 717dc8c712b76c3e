"""Finding the table in a file: its sheet or separator, its headings, its rows."""

from itertools import pairwise
from pathlib import Path

from paint_deposition.errors import did_you_mean
from paint_deposition.files.tables import words as trade
from paint_deposition.files.tables.columns import (
    NUMBERS,
    Columns,
    find_columns,
    is_comment,
    unheaded_points,
)
from paint_deposition.files.tables.complaints import Complaints
from paint_deposition.files.tables.layout import Layout
from paint_deposition.files.tables.rows import numbers_among, sorted_rows
from paint_deposition.files.tables.sheets import Sheet, sheets_of, text_of
from paint_deposition.files.tables.table import Table

SHOWN_HEADINGS = 20


def read_table(path: Path, needs: str, layout: Layout) -> Table:
    """Find the table in a file.

    Args:
        path: of a text file or workbook.
        needs: 'thickness' for readings, 'place' for measuring points.
        layout: what the user says of it.

    Raises:
        ReadingsError: no such table; its lines are complained of later, all at once.
    """
    complaints = Complaints(path)
    sheet, columns = _sheet_and_columns(sheets_of(path), needs, layout, complaints)
    if needs == 'place':
        columns = columns.without_thickness()
    for quantity, column in columns.at.items():
        heading = columns.headings[column]
        if quantity in NUMBERS and columns.headings.count(heading) > 1:
            raise complaints.of_file(f"two columns are called '{heading}'; keep one")
    decimals = numbers_among(sheet, columns, layout.decimal)
    if decimals.doubt:
        raise complaints.of_file(decimals.doubt)
    rows = sorted_rows(sheet, columns, complaints)
    if not rows.kept:
        complaints.refuse_any()
        empty = f", '{columns.headings[columns.repeats[0]]}' is empty" if rows.blank else ''
        raise complaints.of_file(f'no readings below the header{empty}')
    width = len(columns.headings)
    cells = [[*sheet.rows[k][:width], *[''] * (width - len(sheet.rows[k]))] for k in rows.kept]
    form = sheet.form + ('' if columns.header >= 0 else ', no headings')
    form += ', decimal comma' if decimals.mark == ',' else ''
    return Table(
        path, columns, cells, [sheet.lines[k] for k in rows.kept], form, rows.left_out_words,
        decimals, layout, _units_above(sheet, columns), complaints,
    )  # fmt: skip


def _sheet_and_columns(
    sheets: list[Sheet], needs: str, layout: Layout, complaints: Complaints
) -> tuple[Sheet, Columns]:
    """The sheet, or the way to separate the cells, of which most is known."""
    if layout.sheet:
        named = [sheet for sheet in sheets if sheet.form == f"sheet '{layout.sheet}'"]
        if not named:
            there = ', '.join(sheet.form for sheet in sheets)
            raise complaints.of_file(f"there is no sheet '{layout.sheet}' (there are: {there})")
        sheets = named
    found = [(sheet, find_columns(sheet, layout)) for sheet in sheets]
    if needs == 'place' and not any(columns and columns.has_place for _, columns in found):
        found += [(sheet, unheaded_points(sheet)) for sheet in sheets]
    known = [(sheet, columns) for sheet, columns in found if columns is not None]
    best = max(known, key=lambda pair: _likelihood(pair[0], pair[1], needs), default=None)
    if best is None or not _fits(best[1], needs):
        raise complaints.of_file(
            _no_table(sheets, None if best is None else best[1], needs, layout)
        )
    alike = [s.form for s, c in known if _fits(c, needs) and c.score == best[1].score]
    if len(alike) > 1 and best[0].form.startswith('sheet'):
        raise complaints.of_file(f'there are readings in {" and ".join(alike)}; name one, sheet:')
    return best


def _fits(columns: Columns, needs: str) -> bool:
    return 'thickness' in columns.at if needs == 'thickness' else columns.has_place


def _likelihood(sheet: Sheet, columns: Columns, needs: str) -> tuple[int | bool, ...]:
    """Orders ways to read a file: blanks may stand within a cell, so they separate last."""
    blanks = sheet.form.startswith('blanks')
    serves = _fits(columns, needs) or (needs == 'thickness' and bool(columns.rivals))
    return serves, not blanks, columns.score, len(columns.headings)


def _no_table(sheets: list[Sheet], best: Columns | None, needs: str, layout: Layout) -> str:
    """Why no sheet serves, and what to do."""
    if best is not None and best.rivals and needs == 'thickness':
        rivals = ', '.join(f"'{heading}'" for heading in best.rivals)
        return f'the thickness may be in {rivals}; name one, columns: {{thickness: ...}}'
    rows = [row for sheet in sheets for row in sheet.rows if not is_comment(row)]
    if not rows:
        return 'there is nothing to read in it; give a table with a heading over each column'
    widest = max((sheet.rows[0] for sheet in sheets if sheet.rows), key=len)
    headings = [text_of(cell) for cell in widest] if best is None else best.headings
    named = [repr(heading) for heading in headings if heading]
    if len(named) > SHOWN_HEADINGS:
        named[SHOWN_HEADINGS:] = [f'and {len(named) - SHOWN_HEADINGS} more']
    shown = f'(columns: {", ".join(named) or "none"})'
    for quantity, name in layout.columns.items():
        if isinstance(name, str) and name not in headings:
            known = did_you_mean(name, filter(None, headings), 'copy the heading')
            return f"no column '{name}' for {quantity} {shown}; {known}"
    if needs == 'thickness':
        return (
            f'no column with numbers is known as the thickness {shown}; call it thickness, or '
            'give its heading or number with columns: {thickness: ...}'
        )
    return f'no columns with numbers are known as x, y, z, or from_left, height {shown}'


def _units_above(sheet: Sheet, columns: Columns) -> dict[str, float]:
    """Units that lines above the table tell: 'Units: mils', or 'Position [mm]' over x, y, z."""
    told = {}
    for row in sheet.rows[: max(columns.header, 0)]:
        cells = [part for cell in row for part in text_of(cell).split(':')]
        for name, value in pairwise(cells):
            known, unit = set(trade.words_of(name)), trade.unit_of(value)
            if unit and known and known <= trade.UNIT:
                told['thickness' if unit in trade.FILM_UNITS[:2] else 'position'] = unit
    for cell in sheet.rows[columns.header - 1] if columns.header > 0 else []:
        words, unit = trade.split_unit(text_of(cell))
        if unit and unit in trade.LENGTH_UNITS and set(words) & trade.BESIDE_AXIS:
            told['position'] = unit
    return told
