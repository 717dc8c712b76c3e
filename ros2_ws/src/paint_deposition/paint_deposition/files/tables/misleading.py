"""Tables of readings that would be read wrongly: they are refused."""

import re
from collections.abc import Callable

from paint_deposition.files.tables.headings import Heading
from paint_deposition.files.tables.sheets import text_of
from paint_deposition.files.tables.table import Table, headings_in, is_value


def headings_again(table: Table, header: int, known: Callable[[list[Heading]], int]) -> list[int]:
    """Rows that repeat the row of headings; a second table with others is refused."""
    wide = len(table.rows[header]) > 1
    again = [
        k
        for k, row in enumerate(table.rows)
        if k != header and not any(map(is_value, row))
        and (not wide or sum(cell != '' for cell in row) > 1)
        and known(headings_in(row))
    ]  # fmt: skip
    for k in again:
        if table.rows[k] != table.rows[header]:
            lines = sorted([table.lines[k], table.lines[header]])
            raise table.error(
                f'lines {lines[0]} and {lines[1]} are headings of two tables; put each into a '
                'file of its own, or both under one row of headings'
            )
    return again


def refuse_rivals(table: Table, at: dict[str, list[int]]) -> None:
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


def refuse_merged(table: Table, films: list[int]) -> None:
    """Refuse numbers without a heading right of the thickness's: it is merged over them."""
    for column in range(max(films, default=len(table.headings)) + 1, len(table.headings)):
        if table.headings[column].text:
            return
        for row, line in zip(table.rows, table.lines, strict=True):
            if column < len(row) and is_value(row[column]):
                raise table.error(
                    f"'{table.headings[films[-1]].text}' stands over several columns or is a "
                    f"title: '{text_of(row[column])}' beside it in line {line} has no heading; "
                    'give each column one, or say columns: {thickness: ...} in the campaign'
                )


def refuse_cut_numbers(table: Table) -> None:
    """Refuse lines without headings that may be two numbers, or one with a decimal comma."""
    cells = [text_of(cell) for row in table.rows for cell in row]
    if (
        table.form.startswith('commas')
        and len(cells) == 2 * len(table)
        and all(map(str.isdigit, cells))
    ):
        raise table.error(
            f"'{cells[0]},{cells[1]}' in line {table.lines[0]} may be two numbers or one with a "
            'decimal comma; say decimal: point if it is two, else put a heading over the column'
        )
