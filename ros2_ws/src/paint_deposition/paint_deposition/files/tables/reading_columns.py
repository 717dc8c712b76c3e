"""Which column of a table of gauge readings, or of measuring points, holds what.

Headings are known in English and German; any other is named by the user, see ``Layout``.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from paint_deposition.errors import did_you_mean
from paint_deposition.files.tables.headings import Heading, words_of
from paint_deposition.files.tables.sheets import Cell, Sheet, text_of
from paint_deposition.files.tables.table import is_comment, is_value, shown, unit_m

# Columns of our own, which are always read by exactly these names.
OWN = {
    'x': 'x_m', 'y': 'y_m', 'z': 'z_m', 'thickness': 'thickness_um', 'point': 'point',
    'group': 'group', 'session': 'session', 'sigma': 'sigma_um',
    'nx': 'nx', 'ny': 'ny', 'nz': 'nz',
}  # fmt: skip
AXES = ('x', 'y', 'z')
ON_FACE = ('from_left', 'height')
NORMALS = ('nx', 'ny', 'nz')
LENGTH_UNITS, FILM_UNITS = (1.0, 1e-2, 1e-3, 25.4e-3), (1e-6, 25.4e-6, 1e-3)

THICKNESS = {'dft', 'thickness', 'film', 'filmbuild', 'build', 'coating'}  # or ending in -dicke
VALUES = {
    'reading', 'value', 'measurement', 'result', 'wert', 'messwert', 'ergebnis',
}  # fmt: skip
MEANS = {'mean', 'average', 'avg', 'mittelwert', 'mittel'}
SPREADS = {
    'min', 'max', 'minimum', 'maximum', 'std', 'stdev', 'sd', 'stdabw', 'standardabweichung',
    'deviation', 'dev', 'sigma', 'cov', 'cv', 'range', 'count', 'n',
}  # fmt: skip
# What stands beside a thickness without being one.
NO_FILM = SPREADS | {
    'soll', 'target', 'nominal', 'predicted', 'limit', 'lower', 'upper', 'tolerance', 'toleranz',
    'no', 'nr', 'number', 'date', 'time', 'substrate', 'type',
}  # fmt: skip
MEASURED, NOMINAL = {'actual', 'act', 'ist', 'measured'}, {'nominal', 'nom', 'soll'}
BESIDE_AXIS = MEASURED | NOMINAL | {'pos', 'position', 'coordinate', 'koordinate'}
FROM_LEFT, HEIGHT = {'left', 'links'}, {'height', 'bottom', 'hohe', 'hoehe', 'unten'}
POINT = {
    'point', 'punkt', 'messpunkt', 'messstelle', 'stelle', 'spot', 'location', 'label',
    'position', 'pos',
}  # fmt: skip
NUMBER = {'no', 'nr', 'number', 'nummer', '#', 'id', 'name', 'index'}


@dataclass(frozen=True)
class Layout:
    """What the user says of a table; what is left out is found.

    Attributes:
        columns: heading, or number from 1, of a quantity's column.
        unit: metres in the unit of 'position' and of 'thickness'.
        decimal: '.' or ',', or '' where it is to be found.
        sheet: name of a workbook's sheet, or ''.
    """

    columns: Mapping[Any, str | int] = field(default_factory=dict)
    unit: Mapping[Any, float] = field(default_factory=dict)
    decimal: str = ''
    sheet: str = ''


@dataclass(frozen=True)
class Columns:
    """Which column holds what.

    Attributes:
        header: row of the headings, -1 where there are none. first: row of the first values.
        headings: of all columns.
        at: column of each quantity.
        films: columns of the thickness, several where each row holds repeats.
        needs: 'thickness' for readings, 'place' for measuring points.
        rivals: headings that could all be the thickness, where none is certain.
    """

    header: int
    first: int
    headings: list[Heading]
    at: dict[str, int]
    films: list[int]
    needs: str = 'thickness'
    rivals: tuple[str, ...] = ()

    @property
    def place(self) -> list[int]:
        """Columns that say where a row was taken."""
        return [self.at[q] for q in (*AXES, *ON_FACE) if q in self.at]

    @property
    def numeric(self) -> list[int]:
        """Columns of numbers."""
        more = [self.at[q] for q in (*NORMALS, 'sigma') if q in self.at]
        return [*self.place, *more, *self.films]

    @property
    def score(self) -> int:
        """How much is known."""
        named = any(is_thickness(self.headings[k].words) for k in self.films)
        own = all(OWN[q] in [h.text for h in self.headings] for q in (*AXES, 'thickness'))
        film = 2 * bool(self.films) + 3 * bool(self.rivals) + 2 * named
        return len(set(self.at) - {'unit'}) + film + 100 * own

    def serves(self) -> bool:
        """Whether there is what is needed."""
        if self.needs == 'thickness':
            return bool(self.films or self.rivals)
        return all(q in self.at for q in AXES) or all(q in self.at for q in ON_FACE)


def columns_under(sheet: Sheet, row: int, needs: str, layout: Layout) -> Columns | None:
    """The columns if the headings stand in this row."""
    cells = sheet.rows[row]
    numbers = {q: n - 1 for q, n in layout.columns.items() if isinstance(n, int)}
    if numbers and len(numbers) == len(layout.columns):
        if max(numbers.values()) >= len(cells) or min(numbers.values()) < 0:
            return None
        headings = [Heading(f'column {k + 1}', ()) for k in range(len(cells))]
        films = [numbers['thickness']] if 'thickness' in numbers else []
        return Columns(-1, 0, headings, numbers, films, needs)
    if needs == 'place' and row == 0 and all(map(is_value, cells[1:])) and len(cells) in (4, 7):
        # A list of points without headings: label, x, y, z and perhaps the normal.
        names = ('point', *AXES, *NORMALS)[: len(cells)]
        headings = [Heading(name, (name,)) for name in names]
        return Columns(-1, 0, headings, {name: k for k, name in enumerate(names)}, [], needs)
    headings = [Heading.of(text_of(cell)) for cell in cells]
    if text_of(cells[0]) == '#':
        headings[0] = Heading('#', ('#',))
    below = [r for r in sheet.rows[row + 1 : row + 12] if not is_comment(r)]
    units = _row_of_units(below[0]) if below else {}
    headings = [
        Heading(h.text, h.words, units[k]) if k in units else h for k, h in enumerate(headings)
    ]
    texts = [h.text for h in headings]
    wanted: dict[Any, str | int] = {}
    is_own = all(OWN[q] in texts for q in (*AXES, 'thickness'))
    if is_own:
        wanted = {q: name for q, name in OWN.items() if name in texts}
    small = [text.casefold() for text in texts]
    at: dict[str, int] = {}
    for quantity, name in (wanted | dict(layout.columns)).items():
        column = name - 1 if isinstance(name, int) else _index(small, name.strip().casefold())
        if not 0 <= column < len(headings):
            return None
        at[quantity] = column
    rivals: tuple[str, ...] = ()
    films = [at['thickness']] if 'thickness' in at else []
    if not is_own:
        filled = {k for r in below for k, cell in enumerate(r) if is_value(cell)}
        guessed = _places(headings, filled) | _labels(headings, below)
        guessed |= {q: texts.index(OWN[q]) for q in ('session', 'sigma') if OWN[q] in texts}
        at = guessed | at
        if not films:
            taken = {column for quantity, column in at.items() if quantity != 'unit'}
            films, rivals = _films(headings, filled - taken)
    if needs == 'place':
        films, rivals = [], ()
    if not at and not films and not rivals:
        return None
    return Columns(row, row + 1 + bool(units), headings, at, films, needs, rivals)


def _index(texts: list[str], text: str) -> int:
    return texts.index(text) if text in texts else -1


def _row_of_units(cells: list[Cell]) -> dict[int, str]:
    """Units in a row of their own under the headings, by column; nothing where it is no such."""
    parts = {k: Heading.of(text_of(cell)) for k, cell in enumerate(cells) if cell != ''}
    is_such = all(part.unit and not part.words for part in parts.values())
    return {k: part.unit for k, part in parts.items()} if is_such else {}


def _places(headings: list[Heading], filled: set[int]) -> dict[str, int]:
    """Columns of positions and normals; of nominal and measured coordinates the measured ones."""
    ranked: dict[str, list[tuple[int, int]]] = {}
    for column in sorted(filled & set(range(len(headings)))):
        words = headings[column].words + words_of(headings[column].bracket)
        letters = ''.join(word for word in words if word not in BESIDE_AXIS)
        rank = 2 if NOMINAL & set(words) else 0 if MEASURED & set(words) else 1
        if letters in AXES:
            ranked.setdefault(letters, []).append((rank, column))
        elif letters in NORMALS or letters in ('i', 'j', 'k'):
            axis = letters[-1].translate(str.maketrans('ijk', 'xyz'))
            ranked.setdefault(f'n{axis}', []).append((1, column))
        elif not is_thickness(words):
            for quantity, known in zip(ON_FACE, (FROM_LEFT, HEIGHT), strict=True):
                if known & set(words):
                    ranked.setdefault(quantity, []).append((1, column))
    at = {quantity: min(found)[1] for quantity, found in ranked.items()}
    if set(AXES) <= set(at):
        return {q: k for q, k in at.items() if q not in ON_FACE}
    return {q: k for q, k in at.items() if q in AXES or set(ON_FACE) <= set(at)}


def _labels(headings: list[Heading], below: list[list[Cell]]) -> dict[str, int]:
    """Columns of the point, its number, the group and the unit."""
    at: dict[str, int] = {}
    for column, heading in enumerate(headings):
        words = set(heading.words)
        if not words or heading.unit:
            continue
        if words <= {'unit', 'units', 'einheit'}:
            at.setdefault('unit', column)
        elif words <= {'group', 'gruppe'}:
            at.setdefault('group', column)
        elif words & POINT and words <= POINT | NUMBER:
            at.setdefault('point', column)
        elif words & NUMBER and words <= NUMBER | VALUES:
            labels = {text_of(row[column]) for row in below if column < len(row)}
            # Running numbers count readings, not points; other labels are those of points.
            running = any(label.isdigit() for label in labels)
            at.setdefault('number' if running else 'name', column)
    if 'name' in at:
        name = at.pop('name')
        at.setdefault('point', name)
    return at


def _films(headings: list[Heading], columns: set[int]) -> tuple[list[int], tuple[str, ...]]:
    """Columns of the thickness, and the headings between which the user must choose."""
    ranked: dict[int, list[int]] = {}
    for column in sorted(columns & set(range(len(headings)))):
        rank = _film_rank(headings[column])
        if rank is not None:
            ranked.setdefault(rank, []).append(column)
    if not ranked:
        return [], ()
    best = ranked[min(ranked)]
    # Headings that differ in a number only are repeats: DFT 1, DFT 2.
    stems = {re.sub(r'\d+', '', headings[column].text).casefold() for column in best}
    texts = [headings[column].text for column in best]
    if len(best) > 1 and (len(stems) > 1 or len({*texts}) < len(texts)):
        return [], tuple(texts)
    return best, ()


def _film_rank(heading: Heading) -> int | None:
    """0 where a heading names the thickness, 1 where it may be, 2 for a mean of readings."""
    known, unit = set(heading.words), unit_m(heading)
    if known & NO_FILM or (heading.unit and unit not in FILM_UNITS):
        return None
    named = is_thickness(heading.words)
    if known & MEANS:
        return 2 if named or unit else None
    if named:
        return 0
    repeat = any(re.fullmatch(r'[rmdv]\d+', word) for word in known)
    values = known & (VALUES | {f'{value}s' for value in VALUES} | {'werte', 'messwerte'})
    return 1 if values or repeat or unit in FILM_UNITS[:2] else None


def is_thickness(words: Collection[str]) -> bool:
    """Whether words name the thickness of the film."""
    return any(word in THICKNESS or word.endswith('dicke') for word in words)


def not_found(columns: Columns | None, headings: list[Heading], needs: str, layout: Layout) -> str:
    """Why a file has no such table, and what to do."""
    if not headings:
        return 'there is nothing to read in it; give a table with a heading over each column'
    if columns is not None and columns.rivals:
        rivals = ', '.join(f"'{heading}'" for heading in columns.rivals)
        return f'the thickness may be in {rivals}; name one, columns: {{thickness: ...}}'
    headings = headings if columns is None else columns.headings
    texts = [heading.text for heading in headings]
    for quantity, name in layout.columns.items():
        if isinstance(name, str) and name not in texts:
            known = did_you_mean(name, filter(None, texts), 'copy the heading')
            return f"no column '{name}' for {quantity} {shown(headings)}; {known}"
    if needs == 'thickness':
        return (
            f'no column with numbers is known as the thickness {shown(headings)}; call it '
            'thickness, or give its heading or number with columns: {thickness: ...}'
        )
    return f'no columns with numbers are known as x, y, z, or from_left, height {shown(headings)}'
