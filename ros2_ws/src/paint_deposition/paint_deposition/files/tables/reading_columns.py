"""The columns of a table of readings: what each holds, and which would be read wrongly."""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import Any

from paint_deposition.errors import did_you_mean
from paint_deposition.files.tables.gauge_formats import (
    ALIASES,
    FILM_ENDINGS,
    FORMATS,
    LAYERS,
    NO_READING,
    OTHER_DICKEN,
    OTHER_THICKNESS,
    OWN,
    WET,
    GaugeFormat,
)
from paint_deposition.files.tables.headings import (
    BESIDE,
    LENGTHS,
    NOMINAL,
    Heading,
    headings_in,
    shown,
    widest,
)
from paint_deposition.files.tables.sheets import Sheet, is_value, text_of
from paint_deposition.files.tables.table import Table

AXES = ('x', 'y', 'z')
ON_FACE = ('from_left', 'height')
NORMALS = ('nx', 'ny', 'nz')
LENGTH_UNITS, FILM_UNITS = (1.0, 1e-2, 1e-3, 25.4e-3), (1e-6, 25.4e-6, 1e-3)
QUANTITY = {name: quantity for quantity, names in ALIASES.items() for name in names}


@dataclass(frozen=True)
class Layout:
    """What the user says of a table; what is left out is found."""

    # Heading, or number from 1, of a quantity's column; of thickness also several, of 'layers' by
    # the name of each; 'none' for a quantity that there is not.
    columns: Mapping[Any, Any] = field(default_factory=dict)
    # Metres in the unit of 'position' and of 'thickness'.
    unit: Mapping[Any, float] = field(default_factory=dict)
    decimal: str = ''  # '.' or ','
    sheet: str = ''  # name of a workbook's sheet
    zero: str = ''  # 'missing' or 'film', what a reading of 0 is; '' where not known

    def named(self, quantity: str) -> list[str | int]:
        """What the user says of a quantity's columns; nothing where there is none."""
        said = self.columns.get(quantity)
        said = [*said.values()] if isinstance(said, Mapping) else said
        said = said if isinstance(said, list) else [said]
        return [name for name in said if str(name).casefold() != 'none']


def columns_of(headings: list[Heading], layout: Layout) -> dict[str, list[int]]:
    """The columns of each quantity under these headings; the user's, else those that are known.

    Empty where there is no column that the user names.
    """
    texts = [heading.text for heading in headings]
    own = {q: [k for k, t in enumerate(texts) if t == n] for q, n in OWN.items() if n in texts}
    all_own = {*AXES, 'thickness'} <= {*own}
    at = own if all_own else _known_columns(headings) | own
    small = [text.casefold() for text in texts]
    for quantity in layout.columns:
        wanted = []
        for name in layout.named(quantity):
            if isinstance(name, int) and 1 <= name <= len(headings):
                wanted.append(name - 1)
            elif isinstance(name, str) and name.strip().casefold() in small:
                wanted.append(small.index(name.strip().casefold()))
            else:
                return {}
        _assign(at, 'thickness' if quantity == 'layers' else quantity, wanted)
    return at


def _known_columns(headings: list[Heading]) -> dict[str, list[int]]:
    """The columns of each quantity by the names of any table, of a gauge's layout, of layers."""
    at: dict[str, list[int]] = {}
    every = (*AXES, *NORMALS, *ALIASES)
    for quantities, beside in ((every, BESIDE), (AXES, BESIDE | NOMINAL)):
        found = [_quantity(heading, beside) for heading in headings]
        for quantity in (q for q in quantities if q in found and q not in at):
            at[quantity] = [k for k, one in enumerate(found) if one == quantity]
    if {*AXES} <= {*at}:
        at = {q: columns for q, columns in at.items() if q not in ON_FACE}
    if gauge := format_of(headings):
        words = [plain(heading) for heading in headings]
        _assign(at, '', [k for k, word in enumerate(words) if word in gauge.unused])
        for quantity, word in gauge.columns.items():
            _assign(at, quantity, [k for k, its in enumerate(words) if its == word])
    layers = [k for k, heading in enumerate(headings) if _layer(heading)]
    if len(layers) > 1 and 'thickness' not in at:
        _assign(at, 'thickness', layers)
    also = [k for k, heading in enumerate(headings) if _begins_as_thickness(heading)]
    ending = [k for k, heading in enumerate(headings) if _ends_as_thickness(heading)]
    also = also or ending[: len(ending) == 1]
    return at if 'thickness' in at or not also else at | {'thickness': also}


def _assign(at: dict[str, list[int]], quantity: str, columns: list[int]) -> None:
    """Let columns be those of one quantity alone, or of none ('')."""
    for other in [*at]:
        at[other] = [k for k in at[other] if k not in columns and other != quantity]
        if not at[other]:
            del at[other]
    if quantity and columns:
        at[quantity] = columns


def layers_of(headings: list[Heading], layout: Layout, films: list[int]) -> list[str]:
    """The layer that each column of the thickness holds; none where they are no layers."""
    if layers := layout.columns.get('layers'):
        return [name for name, column in layers.items() if str(column).casefold() != 'none']
    names = [_layer(headings[k]) for k in films]
    return names if len(films) > 1 and all(names) and 'thickness' not in layout.columns else []


def format_of(headings: list[Heading]) -> GaugeFormat | None:
    """The known layout that these headings are of."""
    words = {plain(heading) for heading in headings}
    return next((one for one in FORMATS if {*one.shown_by} <= words), None)


def plain(heading: Heading) -> str:
    """The words of a heading as ``FORMATS`` has them, '#' for a number."""
    return ' '.join('#' if word.isdigit() else word for word in heading.words)


def _is_of_film(heading: Heading) -> bool:
    """Whether a heading has the unit of a film, or none."""
    return not heading.unit or LENGTHS.get(heading.unit) in FILM_UNITS


def _layer(heading: Heading) -> str:
    """The layer whose thickness a column holds by its heading, '' for none."""
    of_any = {'schichtdicke', 'lackschichtdicke', 'dicke', 'thickness', 'dft', 'film'}
    words = tuple(word for word in heading.words if word not in of_any)
    own = plain(replace(heading, words=words)) if _is_of_film(heading) else None
    layer = next((layer for layer, names in LAYERS.items() if own in names), '')
    return layer and layer + ''.join(filter(str.isdigit, words))


def _quantity(heading: Heading, beside: Collection[str] = BESIDE) -> str | None:
    """What a heading names, None where it is not known; ``beside`` an axis means nothing."""
    words = [word for word in heading.words if not word.isdigit()]
    without = [word for word in words if word not in beside]
    if ''.join(without) in (*AXES, *NORMALS):
        return ''.join(without)
    dicke = any(w.endswith('dicke') and not w.startswith(OTHER_DICKEN) for w in without[-1:])
    known = QUANTITY.get(' '.join(words)) or QUANTITY.get(' '.join(without))
    if dicke or known == 'thickness':
        return 'thickness' if _is_of_film(heading) else None
    return known


def _begins_as_thickness(heading: Heading) -> bool:
    """'Schichtdicke Klarlack [µm]', and no target or statistic such as 'DFT max [µm]'.

    The unit ends it: more behind that is a remark.
    """
    if not (heading.unit and heading.text.endswith((']', ')'))) or {*heading.words} & NO_READING:
        return False
    return any(
        words[-1].endswith(('dicke', 'dft', 'thickness'))
        and _quantity(replace(heading, words=words)) == 'thickness'
        for words in (heading.words[:1], heading.words[:2])
        if words
    )


def _ends_as_thickness(heading: Heading) -> bool:
    """'Dry film thickness [µm]' or 'Total DFT', and no target, wet film or sheet of metal."""
    words = heading.words
    other = not NO_READING.isdisjoint(words) or not OTHER_THICKNESS.isdisjoint(words)
    other |= any(map(WET.match, words)) or not _is_of_film(heading)
    # A line that holds several headings is none.
    whole = words[-1:] != () and words[-1] in FILM_ENDINGS and not re.search('[;,|]', heading.text)
    return whole and not other


def not_found(sheet: Sheet, headings: list[Heading], films: bool, layout: Layout) -> str:
    """Why a file has no such table, and what to do.

    Without ``headings`` those of its widest row count.
    """
    if not sheet.rows:
        return 'there is nothing to read in it; give a table with a heading over each column'
    headings = headings or headings_in(widest(sheet))
    texts = [heading.text for heading in headings if heading.text]
    for quantity in layout.columns:
        for name in layout.named(quantity):
            if isinstance(name, str) and name not in texts:
                remedy = did_you_mean(name, texts, 'copy the heading')
                return f"no column '{name}' for {quantity} {shown(headings)}; {remedy}"
    wide = [row for row in sheet.rows if len(row) > 1] or sheet.rows
    if all(any(map(is_value, row)) for row in wide):
        remedy = 'put a row of headings on top'
        if films:
            remedy += ', or number its columns, columns: {point: 1, thickness: 2} in the campaign'
        return f"there are no headings (it begins with '{' '.join(texts)}'); {remedy}"
    if not films:
        missing = 'no columns are known as x, y, z, or from_left, height'
        return f'{missing} {shown(headings)}; rename them'
    last = [replace(heading, words=heading.words[-1:], unit='') for heading in headings]
    likely = [h for h, its in zip(headings, last, strict=True) if _quantity(its) == 'thickness']
    remedy = 'call it thickness_um, DFT, film thickness or Schichtdicke, or name it'
    if foreign := [heading for heading in likely if not _is_of_film(heading)]:
        remedy = f"'{foreign[0].text}' is in '{foreign[0].unit}': give it in µm, mil or mm"
        remedy += ', or say unit: {thickness: ...} and name it'
    elif wet := [h.text for h in headings if h.words and WET.match(' '.join(h.words))]:
        remedy = f"'{wet[0]}' is a wet film: say wet: true, give its solids, and name it"
    elif likely:
        remedy = f'it may be {" or ".join(repr(heading.text) for heading in likely)}: name one'
    return (
        f'no column is known as the thickness {shown(headings)}; {remedy} '
        'with columns: {thickness: ...} in the campaign'
    )


def headings_again(table: Table, header: int, known: Callable[[list[Heading]], int]) -> list[int]:
    """Rows that repeat the row of headings; a second table with others is refused."""
    again, wide = [], len(table.rows[header]) > 1
    for k, row in enumerate(table.rows):
        if k == header or any(map(is_value, row)) or not known(headings_in(row)):
            continue
        if wide and sum(cell != '' for cell in row) < 2:
            continue
        if row != table.rows[header]:
            lines = sorted([table.lines[k], table.lines[header]])
            raise table.error(
                f'lines {lines[0]} and {lines[1]} are headings of two tables; put each into a '
                'file of its own, or both under one row of headings'
            )
        again.append(k)
    return again


def refuse_misleading(
    table: Table, at: dict[str, list[int]], layout: Layout, layers: list[str], bare: bool
) -> None:
    """Refuse columns that may not be what they are taken for, unless the user names them.

    Two of one quantity, of which those of the thickness may differ in a number or be ``layers``;
    a heading that is merged over several; in a ``bare`` file numbers that commas may have cut.
    """
    every = [heading.text for heading in table.headings]
    of_user = not {'thickness', 'layers'}.isdisjoint(layout.columns)
    for quantity, columns in at.items():
        texts = [every[k] for k in columns]
        if len({*texts}) < len(texts) or every.count(texts[0]) > 1:
            raise table.error(f"two columns are called '{texts[0]}'; keep one")
        stems = {re.sub(r'\d+', '', text) for text in texts}
        alike = quantity == 'thickness' and (of_user or layers or len(stems) == 1)
        if len(columns) > 1 and not alike:
            named = ', '.join(map(repr, texts))
            remedy = f'name one, columns: {{{quantity}: ...}}'
            if 'thickness' not in at:
                remedy = f'rename one of them in {table.path.name}'
            raise table.error(f'the {quantity} may be in {named}; {remedy}')
    # Numbers without a heading right of that of the thickness.
    films = [] if of_user else at.get('thickness', [])
    beside = range(max(films, default=len(every)) + 1, len(every))
    for column in takewhile(lambda k: not every[k], beside):
        for text, line in zip(table.texts(column), table.lines, strict=True):
            if is_value(text):
                raise table.error(
                    f"'{every[films[-1]]}' stands over several columns or is a title: "
                    f"'{text}' beside it in line {line} has no heading; "
                    'give each column one, or say columns: {thickness: ...} in the campaign'
                )
    cells = [text_of(cell) for row in table.rows for cell in row] if bare else []
    in_doubt = layout.decimal != '.' and table.form.startswith('commas')
    if cells and in_doubt and len(cells) == 2 * len(table) and all(map(str.isdigit, cells)):
        raise table.error(
            f"'{cells[0]},{cells[1]}' in line {table.lines[0]} may be two numbers or one with "
            'a decimal comma; say decimal: point if it is two, else put a heading over the '
            'column'
        )
