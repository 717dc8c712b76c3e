"""Which rows of a table are readings or points, which lack one, and their order."""

import statistics
from bisect import bisect
from collections.abc import Sequence

from paint_deposition.files.tables.gauge_formats import STATISTIC
from paint_deposition.files.tables.headings import (
    words_of,
)
from paint_deposition.files.tables.reading_columns import (
    AXES,
    ON_FACE,
    format_of,
    plain,
)
from paint_deposition.files.tables.sheets import is_nothing, is_value, text_of
from paint_deposition.files.tables.table import Table


def without_failed(table: Table, films: list[int]) -> tuple[Table, str]:
    """The table without the readings that the gauge itself marks as none, and how many, in words.

    Raises ReadingsError where what a layout calls a count of readings is none.
    """
    gauge = format_of(table.headings)
    words = [plain(heading) for heading in table.headings]
    if gauge is None:
        return table, ''
    if (count := gauge.columns.get('number')) and films != [words.index(count)]:
        texts = table.texts(words.index(count))
        if odd := next((text for text in texts if '.' in text or ',' in text), ''):
            raise table.error(
                f"'{table.headings[words.index(count)].text}' counts the readings of a "
                f"{gauge.name}, and is '{odd}'; name the column of the film with columns: "
                '{thickness: ...} in the campaign'
            )
    states = {k: good for k, word in enumerate(words) if (good := gauge.status.get(word))}
    cells = {k: table.texts(k) for k in states}
    failed = {
        row: table.headings[k].text
        for k, good in states.items()
        for row, text in enumerate(cells[k])
        if text.casefold() not in good
    }
    if not failed:
        return table, ''
    named = ', '.join(dict.fromkeys(failed.values()))
    table = table.without(films, lambda row, _: row in failed)
    return table, f', {len(failed)} of them failed by {named}'


def rows_of_readings(
    table: Table,
    at: dict[str, list[int]],
    films: bool,
    numeric: list[int],
    labels: set[str],
    bare: bool,
) -> tuple[list[int], list[int], str]:
    """Rows that are readings or points, rows without a reading, and in words what else there is.

    A row with a place is one, whatever its label. One without a place, or in a table without
    places, is a statistic if it begins with the name of one and not with the label of a listed
    point. In a ``bare`` file, without headings, a row as wide as the others is one too.
    """
    kept: list[int] = []
    unread: list[int] = []
    nowhere: list[int] = []  # the last rows, if they have neither place nor label
    count = {'without a reading': 0, 'of statistics': 0, 'of other text': 0}
    width = len(table.headings)
    places = [k for q in (*AXES, *ON_FACE) for k in at.get(q, [])]
    both = 'point' not in at and {'row', 'column'} <= {*at}
    (label,) = at['column'] if both else at.get('point') or at.get('number') or [-1]
    thick = at['thickness'] if films else []
    # The other columns in which the first reading has a number.
    measured = (row for row in table.rows if any(c < len(row) and is_value(row[c]) for c in thick))
    first = next(measured, [])[:width]
    numbered = [c for c, cell in enumerate(first) if is_value(cell) and c not in thick]
    for k, row in enumerate(table.rows):
        cells = [*row, *[''] * (width - len(row))]
        values = [cells[c] for c in thick]
        placed = any(is_value(cells[c]) for c in places)
        begins = next(text_of(cell) for cell in cells if cell != '')
        listed = label >= 0 and (both or text_of(cells[label]) in labels) and cells[label] != ''
        missing = bool(values) and all(map(is_nothing, values))
        named = STATISTIC.match(' '.join(words_of(begins))) and not is_nothing(begins)
        if named and not placed and not listed:
            count['of statistics'] += 1
        elif not placed and not any(map(is_value, values)):
            # A remark has no reading either, but not all other numbers and no n/a in its place.
            full = bool(numbered) and all(is_value(cells[c]) for c in numbered)
            missing &= any(values) or full or (bare and len(row) == width)
            count['without a reading' if missing else 'of other text'] += 1
            unread += [k] * missing
        elif len(row) <= max(numeric) or any(cell != '' for cell in cells[width:]):
            table.complain_of_width(k)
        elif missing:
            count['without a reading'] += 1
            unread.append(k)
        else:
            kept.append(k)
            homeless = not placed and (places or label >= 0) and cells[label] == ''
            nowhere = [*nowhere, k] if homeless else []
    # Apart from the table, a block of numbers without places or labels is its statistics.
    if nowhere and nowhere[0] and table.lines[nowhere[0]] > table.lines[nowhere[0] - 1] + 1:
        kept = kept[: -len(nowhere)]
        count['of statistics'] += len(nowhere)
    parts = [f'{n} row{"s" * (n > 1)} {what}' for what, n in count.items() if n]
    return kept, unread, f'left out: {", ".join(parts)}' if parts else ''


def orders_of(
    table: Table, kept: list[int], unread: list[int], begin: int
) -> tuple[tuple[list[int], int], ...]:
    """Numbers of the kept rows from 1 and the number of all; of cells also with blank rows.

    A blank line of a text, or a blank row beside other columns, may part two groups of readings.
    """
    lines = table.lines
    rows, end = sorted([*kept, *unread]), lines[max(kept)] + 1
    without = [bisect(rows, k) for k in kept]
    if not table.form.startswith('sheet') or sum(bool(h.text) for h in table.headings) > 1:
        return ((without, len(rows)),)
    blank = sorted({*range(begin, end)} - {*lines})
    with_blank = [n + bisect(blank, lines[k]) for n, k in zip(without, kept, strict=True)]
    return (without, len(rows)), (with_blank, len(rows) + len(blank))


def figures_at_end(texts: Sequence[str]) -> str:
    """In words the last of these numbers if they are statistics of the rest; else ''.

    One of them is the mean of the rest, as exactly as it is written.
    """
    values = [float(text) for text in texts]
    decimals = [len(text.partition('.')[2]) for text in texts]
    for count in range(min(6, len(values) - 3), 0, -1):
        before = values[:-count]
        least, most = min(before), max(before)
        if least == most:
            continue
        means = {statistics.fmean(before)}
        figures = means | {
            statistics.stdev(before), statistics.pstdev(before), statistics.median(before),
            least, most, most - least, sum(before), float(len(before)),
        }  # fmt: skip

        def are(known: set[float], count: int = count) -> list[bool]:
            """Which of the last numbers is one of these."""
            finest = max(decimals[:-count])
            half = [0.5 * 10.0 ** -max(d, finest) + 1e-9 for d in decimals[-count:]]
            last = zip(values[-count:], half, strict=True)
            return [any(abs(v - one) <= near for one in known) for v, near in last]

        if any(are(means)) and all(are(figures)):
            named = ', '.join(texts[-count:])
            last = f'its last {count} values' if count > 1 else 'its last value'
            return (
                f'{last}, {named}, may be {"statistics" if count > 1 else "the mean"} of the rest'
            )
    return ''
