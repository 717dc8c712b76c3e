"""Which rows of a sheet are readings, and which are statistics, remarks or blanks."""

from dataclasses import dataclass

from paint_deposition.files.tables import words as trade
from paint_deposition.files.tables.columns import (
    AXES,
    NUMBERS,
    ON_FACE,
    Columns,
    is_comment,
    is_value,
)
from paint_deposition.files.tables.complaints import Complaints
from paint_deposition.files.tables.numbers import Decimals, is_nothing
from paint_deposition.files.tables.sheets import Cell, Sheet, text_of


@dataclass(frozen=True)
class Rows:
    """The rows under the headings.

    Attributes:
        kept: rows of the sheet that are readings.
        blank, statistics, other: number of rows without a reading, of a block of statistics, and
            of anything else.
    """

    kept: list[int]
    blank: int
    statistics: int
    other: int

    @property
    def left_out_words(self) -> str:
        """What was not taken for a reading, for the user."""
        kinds = {'without a reading': self.blank, 'of statistics': self.statistics}
        kinds['of other text'] = self.other
        parts = [f'{n} row{"s" * (n > 1)} {what}' for what, n in kinds.items() if n]
        return f'left out: {", ".join(parts)}' if parts else ''


def numbers_among(sheet: Sheet, columns: Columns, mark: str) -> Decimals:
    """How the numbers under the headings are written; the mark is the user's, if any."""
    if mark:
        return Decimals(mark)
    return Decimals.among(
        (sheet.lines[k], row[column])
        for k, row in enumerate(sheet.rows[columns.first :], columns.first)
        for column in _numeric(columns)
        if column < len(row) and not is_comment(row)
    )


def sorted_rows(sheet: Sheet, columns: Columns, complaints: Complaints) -> Rows:
    """Sort the rows; those that should be readings and have another width are complained of."""
    rows = {
        k: row
        for k, row in enumerate(sheet.rows[columns.first :], columns.first)
        if not is_comment(row)
    }
    statistics = _statistics(rows, columns)
    header = sheet.rows[columns.header] if columns.header >= 0 else None
    numeric = _numeric(columns)
    with_values = {
        k
        for k, row in rows.items()
        if k not in statistics and any(is_value(row[c]) for c in numeric if c < len(row))
    }
    last, width = max(with_values, default=-1), len(columns.headings)
    kept, blank, other = [], 0, 0
    for k, row in rows.items():
        films = [row[c] for c in columns.repeats if c < len(row)]
        empty = all(map(is_nothing, films))
        if k in statistics or row == header:
            continue
        if k > last or (k not in with_values and empty):
            other += 1
        elif films and empty:
            blank += 1
        elif any(cell != '' for cell in row[width:]) or len(row) <= max(numeric):
            complaints.at(sheet.lines[k], f'{len(row)} values under {width} column names')
        else:
            kept.append(k)
    return Rows(kept, blank, len(statistics), other)


def _numeric(columns: Columns) -> set[int]:
    return {c for q, c in columns.at.items() if q in NUMBERS} | set(columns.repeats)


def _statistics(rows: dict[int, list[Cell]], columns: Columns) -> set[int]:
    """Rows of the blocks that a gauge appends: mean, standard deviation, ..., n."""
    order = list(rows)
    found = {k for k in order if _is_statistic(rows[k], columns)}
    for ways in (order, order[::-1]):
        inside = False
        for k in ways:
            inside = k in found or (inside and _may_be_statistic(rows[k], columns))
            if inside:
                found.add(k)
    return found


def _is_statistic(row: list[Cell], columns: Columns) -> bool:
    text, place = _first_text(row), _place(row, columns)
    if is_value(text) or (place and all(map(is_value, place))):
        return False
    words, _ = trade.split_unit(text.partition('=')[0].partition(':')[0])
    if '=' in text and len(words) == 1 and words[0] in trade.STATISTICS_LETTERS:
        return True
    known = set(words)
    beside = trade.STATISTICS | trade.BESIDE_STATISTICS
    return bool(known & trade.STATISTICS) and known <= beside


def _may_be_statistic(row: list[Cell], columns: Columns) -> bool:
    """Beside other statistics a lone letter, n or s, is one, and a text without a place."""
    text, place = _first_text(row), _place(row, columns)
    words = trade.words_of(text)
    if len(words) == 1 and words[0] in trade.STATISTICS_LETTERS:
        return True
    return bool(place) and not is_value(text) and all(cell == '' for cell in place)


def _place(row: list[Cell], columns: Columns) -> list[Cell]:
    at = [columns.at[q] for q in (*AXES, *ON_FACE) if q in columns.at]
    return [row[k] if k < len(row) else '' for k in at]


def _first_text(row: list[Cell]) -> str:
    return next((text_of(cell) for cell in row if cell != ''), '')
