"""Which column of a sheet holds what, by its heading or as the user names it."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from paint_deposition.files.tables import words as trade
from paint_deposition.files.tables.layout import Layout
from paint_deposition.files.tables.sheets import Cell, Sheet, text_of

OWN = {
    'x': 'x_m', 'y': 'y_m', 'z': 'z_m', 'thickness': 'thickness_um', 'point': 'point',
    'group': 'group', 'session': 'session', 'sigma': 'sigma_um',
    'nx': 'nx', 'ny': 'ny', 'nz': 'nz',
}  # fmt: skip
AXES = ('x', 'y', 'z')
ON_FACE = ('from_left', 'height')
LENGTHS = (*AXES, *ON_FACE)
NORMALS = ('nx', 'ny', 'nz')
NUMBERS = (*LENGTHS, *NORMALS, 'thickness', 'sigma')
# A heading further down than this is none.
MOST_LINES_ABOVE = 200


@dataclass(frozen=True)
class Columns:
    """Where a sheet has what.

    Attributes:
        header: row of the headings, -1 where there are none.
        first: row of the first values.
        at: column of each quantity.
        repeats: columns of the thickness, several where each row holds repeats.
        headings: of all columns.
        units: metres in the unit of each quantity, where a heading tells it.
        own: whether the headings are the project's own.
        rivals: headings that could all be the thickness, where none is certain.
    """

    header: int
    first: int
    at: dict[str, int]
    repeats: tuple[int, ...]
    headings: list[str]
    units: dict[str, float]
    own: bool = False
    rivals: tuple[str, ...] = ()

    @property
    def has_place(self) -> bool:
        """Whether the rows say where they were taken."""
        return all(q in self.at for q in AXES) or all(q in self.at for q in ON_FACE)

    def without_thickness(self) -> 'Columns':
        """The same for a list of places: what is measured there, or is yet to be, says nothing."""
        at = {quantity: column for quantity, column in self.at.items() if quantity != 'thickness'}
        return replace(self, at=at, repeats=())

    @property
    def score(self) -> int:
        """How much is known: of two ways to read a file the one that knows more is right."""
        labels = len(set(self.at) - {'unit'})
        film = 2 * ('thickness' in self.at) + 3 * bool(self.rivals)
        return labels + film + 2 * self.is_thickness_named + 100 * self.own

    @property
    def is_thickness_named(self) -> bool:
        """Whether a heading says thickness, not value or µm alone."""
        return any(trade.is_thickness(trade.words_of(self.headings[k])) for k in self.repeats)


def find_columns(sheet: Sheet, layout: Layout) -> Columns | None:
    """The columns under the row of headings that says most; None where no row says anything."""
    if layout.columns and all(isinstance(name, int) for name in layout.columns.values()):
        return _numbered(sheet, layout)
    found = [
        columns
        for row in range(min(len(sheet.rows), MOST_LINES_ABOVE))
        if (columns := _columns(sheet, row, layout)) is not None
    ]
    # '#' alone is a heading over numbers; a commented line only heads a table without another.
    plain = [c for c in found if not is_comment(sheet.rows[c.header]) or c.headings[0] == '#']
    if not any('thickness' in columns.at or columns.has_place for columns in plain):
        plain = found
    return max(plain, key=lambda columns: columns.score, default=None)


def unheaded_points(sheet: Sheet) -> Columns | None:
    """The columns of a list without headings: label, x, y, z and perhaps the normal, in order."""
    rows = [row for row in sheet.rows if not is_comment(row)]
    widths = {len(row) for row in rows}
    if widths not in ({4}, {7}) or not all(is_value(cell) for row in rows for cell in row[1:]):
        return None
    names = ('point', *AXES, *NORMALS)[: widths.pop()]
    return Columns(-1, 0, {name: k for k, name in enumerate(names)}, (), list(names), {})


def is_comment(row: list[Cell]) -> bool:
    """Whether a row is a comment."""
    return text_of(row[0]).startswith('#')


def is_value(cell: Cell) -> bool:
    """Whether a cell looks like a number, with or without a unit behind it."""
    return isinstance(cell, float) or re.match(r'[+\-−<>]?\s*[.,]?\d', cell) is not None


def _numbered(sheet: Sheet, layout: Layout) -> Columns | None:
    at = {quantity: int(number) - 1 for quantity, number in layout.columns.items()}
    width = max(map(len, sheet.rows), default=0)
    if not all(0 <= column < width for column in at.values()):
        return None
    repeats = (at['thickness'],) if 'thickness' in at else ()
    headings = [f'column {k + 1}' for k in range(width)]
    return Columns(-1, 0, at, repeats, headings, {})


def _columns(sheet: Sheet, row: int, layout: Layout) -> Columns | None:
    headings = [text_of(cell).lstrip('#').strip() for cell in sheet.rows[row]]
    if text_of(sheet.rows[row][0]) == '#':
        headings[0] = '#'
    below = [r for r in sheet.rows[row + 1 : row + 12] if not is_comment(r)]
    named = {q: _named(name, headings) for q, name in layout.columns.items()}
    if None in named.values():
        return None
    if all(OWN[q] in headings for q in (*AXES, 'thickness')) and not named:
        at = {q: headings.index(name) for q, name in OWN.items() if name in headings}
        units = {'thickness': 1e-6} | dict.fromkeys(AXES, 1.0)
        return Columns(row, row + 1, at, (at['thickness'],), headings, units, own=True)
    parts = [trade.split_unit(heading) for heading in headings]
    units_row = _units_row(below[0], headings) if below else {}
    parts = [(words, units_row.get(k, unit)) for k, (words, unit) in enumerate(parts)]
    filled = {k for r in below for k, cell in enumerate(r) if is_value(cell)}
    at = {q: headings.index(OWN[q]) for q in ('session', 'sigma') if OWN[q] in headings}
    at |= _places(parts, filled) | _labels(parts, below)
    at |= {q: column for q, column in named.items() if column is not None}
    taken = {column for quantity, column in at.items() if quantity != 'unit'}
    running = {k for k in filled if _is_running(below, k)}
    repeats, rivals = _thickness(headings, parts, filled - taken - running)
    if not repeats and not rivals:
        repeats, rivals = _thickness(headings, parts, filled - taken)
    if 'thickness' in named:
        repeats, rivals = (at['thickness'],), ()
    elif repeats:
        at['thickness'] = repeats[0]
    if not at and not rivals:
        return None
    units = {q: unit for q, column in at.items() if (unit := parts[column][1])}
    return Columns(row, row + (2 if units_row else 1), at, repeats, headings, units, rivals=rivals)


def _is_running(rows: list[list[Cell]], column: int) -> bool:
    """Whether a column counts its rows: 1, 2, 3."""
    cells = [text_of(row[column]) for row in rows[:2] if column < len(row)]
    return cells == ['1', '2']


def _named(name: str | int, headings: list[str]) -> int | None:
    if isinstance(name, int):
        return name - 1 if 0 < name <= len(headings) else None
    same = [
        k for k, heading in enumerate(headings) if heading.casefold() == name.strip().casefold()
    ]
    return same[0] if same else None


def _units_row(cells: list[Cell], headings: list[str]) -> dict[int, float]:
    """Units in a row of their own under the headings, by column; nothing where it is no such."""
    units = {}
    for column, cell in enumerate(cells[: len(headings)]):
        words = trade.words_of(text_of(cell))
        if not words:
            continue
        if len(words) > 1 or words[0] not in trade.UNITS_M:
            return {}
        units[column] = trade.UNITS_M[words[0]]
    return units


Part = tuple[list[str], float | None]


def _places(parts: list[Part], filled: set[int]) -> dict[str, int]:
    """Columns of positions and normals."""
    at = {}
    for axis in AXES:
        ranked = [
            (rank, column)
            for column, (words, _) in enumerate(parts)
            if column in filled and (rank := _axis_rank(words, axis)) is not None
        ]
        if ranked:
            at[axis] = min(ranked)[1]
    if set(at) == set(AXES):
        for letters in (('nx', 'ny', 'nz'), ('i', 'j', 'k')):
            found = [_only(parts, filled, letter) for letter in letters]
            if None not in found:
                return at | dict(zip(NORMALS, (c for c in found if c is not None), strict=True))
        return at
    for quantity, telling in zip(ON_FACE, (trade.FROM_LEFT, trade.HEIGHT), strict=True):
        columns = [
            column
            for column, (words, _) in enumerate(parts)
            if column in filled and telling & set(words) and not trade.OTHER_SIDE & set(words)
            and not trade.is_thickness(words)
        ]  # fmt: skip
        if len(columns) == 1:
            at[quantity] = columns[0]
    return at if set(ON_FACE) <= set(at) else {q: c for q, c in at.items() if q in AXES}


def _axis_rank(words: list[str], axis: str) -> int | None:
    """0 for the plain coordinate, 1 for a measured one, 2 for a nominal one."""
    rest = set(words)
    rank = 1 if rest & trade.ACTUAL else 2 if rest & trade.NOMINAL else 0
    beside = trade.ACTUAL | trade.NOMINAL | trade.BESIDE_AXIS
    letters = ''.join(w for w in words if w not in beside)
    ways = (axis, f'pos{axis}', f'{axis}pos', f'coord{axis}', f'{axis}coord', f'{axis}koordinate')
    return rank if letters in ways else None


def _only(parts: list[Part], filled: set[int], letter: str) -> int | None:
    for column, (words, _) in enumerate(parts):
        kept = [word for word in words if word not in trade.NORMAL]
        axis = letter.removeprefix('n')
        if column in filled and (words == [letter] or (kept == [axis] and kept != words)):
            return column
    return None


def _labels(parts: list[Part], below: list[list[Cell]]) -> dict[str, int]:
    """Columns of the point, the group and the unit."""
    at, ranked = {}, []
    for column, (words, _) in enumerate(parts):
        known = set(words)
        if not known:
            continue
        if known <= trade.UNIT:
            at['unit'] = column
        elif known <= trade.GROUP:
            at['group'] = column
        elif known & trade.POINT and known <= trade.POINT | trade.BESIDE_POINT:
            ranked.append((0, column))
        elif known <= trade.BESIDE_POINT and (
            known & trade.RUNNING_NUMBER or _is_running(below, column)
        ):
            # Running numbers count readings, not points; other labels tell the points apart.
            labels = {text_of(row[column]) for row in below if column < len(row)} - {''}
            named = len(labels) > 1 and not any(label.isdigit() for label in labels)
            ranked.append((1 if named else 2, column))
    if ranked:
        rank, column = min(ranked)
        at['point' if rank < 2 else 'number'] = column
    return at


def _thickness(
    headings: list[str], parts: list[Part], filled: Iterable[int]
) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Columns of the thickness, and the headings between which the user must choose."""
    ranked: dict[int, list[int]] = {}
    for column in sorted(set(filled)):
        if column < len(parts) and (rank := _thickness_rank(*parts[column])) is not None:
            ranked.setdefault(rank, []).append(column)
    if not ranked:
        return (), ()
    best = ranked[min(ranked)]
    stems = {re.sub(r'\d+', '', headings[column]).casefold() for column in best}
    if len(best) > 1 and (len(stems) > 1 or len({headings[c] for c in best}) < len(best)):
        return (), tuple(headings[column] for column in best)
    return tuple(best), ()


def _thickness_rank(words: list[str], unit: float | None) -> int | None:
    """0 where a heading names the thickness, 1 where it may, 2 for a mean of several readings."""
    known = set(words)
    if known & trade.LIMITS or not (unit is None or unit in trade.FILM_UNITS):
        return None
    named = trade.is_thickness(words)
    if known & trade.MEANS:
        return 2 if named or unit else None
    if named:
        return 0
    if (
        known & trade.VALUES
        or any(map(trade.REPEAT.fullmatch, words))
        or unit in trade.FILM_UNITS[:2]
    ):
        return 1
    return None
