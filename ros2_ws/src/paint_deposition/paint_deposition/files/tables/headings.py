"""Headings of columns: their words, their units, and where in a file they stand."""

import re
import unicodedata
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from paint_deposition.errors import PaintError, some
from paint_deposition.files.tables.sheets import (
    Cell,
    Sheet,
    cell_at,
    is_comment,
    is_value,
    read_sheets,
    text_of,
)

# A heading further down than this is none.
MOST_LINES_ABOVE = 200

# The ways to write a unit, by its metres, seconds, radians, or metres a second.
WAYS_TO_WRITE: dict[str, dict[float, str]] = {
    'length': {
        1.0: 'm meter meters metre metres',
        1e-2: 'cm centimeter centimeters centimetre centimetres zentimeter',
        1e-3: 'mm millimeter millimeters millimetre millimetres',
        25.4e-3: 'inch inches in zoll',
        1e-6: 'um μm micron microns mikrometer micrometer micrometers micrometre micrometres',
        25.4e-6: 'mil mils thou',
    },
    'time': {
        1.0: 's sec seconds sekunden sek', 1e-3: 'ms msec milliseconds millisekunden',
        1e-6: 'us μs microseconds mikrosekunden', 1e-9: 'ns nanoseconds nanosekunden',
    },
    'angle': {1.0: 'rad radian radians', 0.0174532925199432957: 'deg ° degree degrees grad'},
    'speed': {1.0: 'm/s', 1e-3: 'mm/s'},
}  # fmt: skip
LENGTHS, TIMES, ANGLES, SPEEDS = (
    {word: factor for factor, words in ways.items() for word in words.split()}
    for ways in WAYS_TO_WRITE.values()
)
UNITS = LENGTHS | TIMES | ANGLES | SPEEDS
# The first way to write a unit, by all of them.
SHORT = {
    word: words.split()[0]
    for ways in WAYS_TO_WRITE.values() for words in ways.values() for word in words.split()
}  # fmt: skip
# The name of a unit of length in messages, by its metres.
UNIT_NAMES = {1.0: 'm', 1e-2: 'cm', 1e-3: 'mm', 1e-6: 'µm', 25.4e-6: 'mil', 25.4e-3: 'inch'}
# What a heading says of a coordinate beside its axis. A nominal one counts if there is no other.
NOMINAL = {'nominal', 'nom', 'soll', 'cad', 'design'}
BESIDE = {
    'pos', 'position', 'coordinate', 'coordinates', 'koordinate', 'koordinaten', 'lage', 'act',
    'actual', 'ist', 'measured', 'gemessen',
}  # fmt: skip
# The columns of the log of abb_libegm that hold what the robot measured, as usual headings.
EGM_LOG = {
    'TIMESTAMP': 'time [ms]',
    **{f'R_FB_POS_{axis}': f'{axis} [mm]' for axis in 'XYZ'},
    **{f'R_FB_QUAT_U{k}': f'q{k + 1}' for k in range(4)},
    **{f'R_FB_POS_RJ{k}': f'J{k} [deg]' for k in range(1, 7)},
}
BRACKETED = re.compile(r'[\[(]\s*([^\])]*?)\s*[\])]')


@dataclass(frozen=True)
class Heading:
    """A heading as written, its words without the unit, and the unit ('' for none)."""

    text: str
    words: tuple[str, ...]
    unit: str = ''

    @staticmethod
    def of(text: str) -> 'Heading':
        """'X [mm]', 'x_mm', 'DFT, µm', 'Dicke in µm' and '/pose/orientation/w' are understood.

        A text in brackets that is no known unit, and says no more than 'actual', stays as the
        unit, for the reader to refuse.
        """
        text = text.strip().lstrip('#%').strip()
        small = re.sub(r'[\s_](mm?)_per_s$', r' [\1/s]', _small(text))
        small = re.sub(r'%$', ' [%]', small)
        bracketed = BRACKETED.findall(small)
        known = [unit for unit in bracketed if unit in UNITS]
        strange = [u for u in bracketed if u == '%' or not {*words_of(u)} <= BESIDE | NOMINAL]
        if units := known or strange:
            rest = BRACKETED.sub(lambda b: ' ' if b[1] == units[0] else b[0], small)
            return Heading(text, words_of(rest), SHORT.get(units[0], units[0]))
        words = words_of(small)
        if len(words) > 1 and words[-1] in UNITS:
            return Heading(text, tuple(w for w in words[:-1] if w != 'in'), SHORT[words[-1]])
        return Heading(text, words)


def words_of(text: str) -> tuple[str, ...]:
    """The words of a text, small and without accents; '#' counts as one."""
    spaced = re.sub(r'(?<=[\u3040-\u9fff])(?=\d)', ' ', _small(text))  # 測定値1
    return tuple(re.findall(r'[^\W_]+|#', spaced))


def unit_of(text: str) -> str:
    """What stands in a row of units, as a heading has its unit."""
    unit = _small(text).strip(' .[]()-–—')
    return SHORT.get(unit, unit)


def _small(text: str) -> str:
    text = unicodedata.normalize('NFKD', unicodedata.normalize('NFKC', text).casefold())
    return ''.join(letter for letter in text if not unicodedata.combining(letter))


def find_table(
    path: Path,
    refusal: type[PaintError],
    known: Callable[[list[Heading]], int],
    sheet: str = '',
    columns: int = 0,
    several: str = 'name one with sheet: ... in the campaign',
    sheets: Sequence[Sheet] = (),
) -> tuple[Sheet, int | None]:
    """The sheet with a table, and the row of its headings; None where none is found.

    ``known`` counts the quantities that a row of headings names, 0 where a needed one is missing.
    ``sheet`` names a workbook's sheet; ``columns`` is how many a table without headings has at
    least, 0 where that is not known; ``several`` what to do about tables in several sheets;
    ``sheets`` are those of the file where they are read already.
    Raises ``refusal`` for a file that cannot be read, or with tables in several sheets.
    """
    sheets = sheets or read_sheets(path, refusal)
    if sheet:
        named = [s for s in sheets if s.form == f"sheet '{sheet}'"]
        if not named:
            there = ', '.join(s.form for s in sheets)
            raise refusal(f"{path}: there is no sheet '{sheet}' (there are: {there})")
        sheets = named
    found: list[tuple[Sheet, int]] = []
    for one in sheets:
        above = [(one, k) for k in range(min(len(one.rows), MOST_LINES_ABOVE))]
        above += [(two, k) for k in range(40) if (two := _on_two_rows(one, k))]
        ranked = [
            (known(headings_in(its.rows[k])), not is_comment(its.rows[k]), its, k)
            for its, k in above
        ]
        count, _, best, row = max(ranked, key=lambda rank: rank[:2], default=(0, False, one, 0))
        # Numbers below headings of several cells stand in several cells, too. Else the headings
        # are cut at a mark, or a blank, that is part of them: 'DFT [mil]'.
        below = best.rows[row + 1 : row + 1 + MOST_LINES_ABOVE]
        split = [len(its) > 1 for its in below if re.search(r'\d', ''.join(map(text_of, its)))]
        if count and (len(best.rows[row]) == 1 or 2 * sum(split) >= len(split)):
            found.append((best, row))
    if len(found) > 1 and found[0][0].form.startswith('sheet'):
        found_in = ' and '.join(one.form for one, _ in found)
        raise refusal(f'{path}: there are tables in {found_in}; {several}')
    # A lone heading is a column of numbers, not of what their decimal commas would cut apart.
    wide = [(one, row) for one, row in found if len(one.rows[row]) > 1]
    if found:
        return (wide or found[-1:])[0]
    wide_enough = [s for s in sheets if sum(len(r) >= columns for r in s.rows) > len(s.rows) / 2]
    if columns and wide_enough:
        return wide_enough[0], None

    def likely(one: Sheet) -> tuple[bool, int]:
        """Whether most rows have as many cells as the widest one, not one only; how many."""
        cells = [len(row) for row in one.rows[:MOST_LINES_ABOVE]]
        most = max(cells, default=0)
        return most > 1 and 2 * cells.count(most) > len(cells), len(widest(one))

    return max(sheets, key=likely), None


def _on_two_rows(sheet: Sheet, first: int) -> Sheet | None:
    """The sheet with two rows as one of headings, None where they hold numbers.

    A blank cell belongs to the cell left of it, over which the upper heading is merged, or to the
    one above it.
    """
    upper, lower = [*sheet.rows[first : first + 2], [], []][:2]
    if len(lower) < 2 or any(map(is_value, [*upper, *lower])):
        return None
    texts, last = list[Cell](), ''
    for k in range(max(len(upper), len(lower))):
        above, below = text_of(cell_at(upper, k)), text_of(cell_at(lower, k))
        last = above or (last if below else '')
        texts.append(f'{last} {below}'.strip())
    rows = [*sheet.rows[:first], texts, *sheet.rows[first + 2 :]]
    return replace(sheet, rows=rows, lines=[*sheet.lines[:first], *sheet.lines[first + 1 :]])


def widest(sheet: Sheet) -> list[Cell]:
    """The cells of the first row of a sheet with the most of them that are not blank."""
    above = ([cell for cell in row if cell != ''] for row in sheet.rows[:MOST_LINES_ABOVE])
    return max(above, key=len, default=[])


def headings_in(row: list[Cell]) -> list[Heading]:
    """The cells of a row as headings.

    Those of a log of abb_libegm have the usual words and units; what it planned (R_PL) and was
    asked for (S_REF) has no words.
    """
    if not {'R_FB_POS_X', 'R_FB_POS_RJ1'}.isdisjoint(row):
        return [
            replace(Heading.of(EGM_LOG.get(text, '')), text=text) for text in map(text_of, row)
        ]
    return [Heading('#', ('#',)) if cell == '#' else Heading.of(text_of(cell)) for cell in row]


def rows_below(
    sheet: Sheet, headings: list[Heading], first: int, units_too: bool = True
) -> tuple[list[Heading], list[int]]:
    """Rows from ``first`` on without comments; a row of units, if any, goes to the headings."""
    rows = [k for k in range(first, len(sheet.rows)) if not is_comment(sheet.rows[k])]
    cells = sheet.rows[rows[0]] if rows and units_too else []
    units = [unit_of(text_of(cell)) for cell in cells]
    if not UNITS.keys() & {*units} or any(map(is_value, cells)):
        return headings, rows
    pairs = zip(headings, [*units, *[''] * len(headings)], strict=False)
    return [replace(heading, unit=unit or heading.unit) for heading, unit in pairs], rows[1:]


def shown(headings: Sequence[Heading]) -> str:
    """The headings of a table in brackets, for a message."""
    named = [repr(heading.text) for heading in headings if heading.text]
    return f'(columns: {some(named, 20) or "none"})'
