"""Gauge readings and measuring points from the files that gauges and spreadsheets write."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import replace
from io import StringIO
from itertools import pairwise
from pathlib import Path

import numpy as np

from paint_deposition.errors import ReadingsError, some
from paint_deposition.files.atomic import write_text
from paint_deposition.files.tables.headings import LENGTHS, shown
from paint_deposition.files.tables.reading_columns import AXES, NORMALS, ON_FACE, Layout, format_of
from paint_deposition.files.tables.readings import GUESSED, ReadingTable
from paint_deposition.files.tables.sheets import FORMULA
from paint_deposition.inference.readings.places import on_face_m
from paint_deposition.inference.readings.readings import Readings, require_repeats_close
from paint_deposition.part.surface import Surface

THINNEST_UM = -5.0
THICKEST_UM = 5000.0
NO_LABEL = 'the point has no label'


def read_readings(
    path: str | Path,
    points: str | Path | None = None,
    layout: Layout | None = None,
    surface: Surface | None = None,
) -> Readings:
    """Read gauge readings.

    Args:
        path: CSV, TSV, TXT, JSON, a workbook, or a folder. The project's own columns are
            ``x_m,y_m,z_m,thickness_um`` and optionally ``point``, ``sigma_um``, ``group``,
            ``session``, ``layer`` and ``nx,ny,nz``; others are known by usual headings, and the
            layouts of gauges by ``gauge_formats``. Without labels, readings at exactly one place
            are repeats.
        points: file of the measuring points (label, x, y, z) that readings name.
        layout: what the file does not say itself.
        surface: the part, for points that are given on its face.

    Raises:
        ReadingsError: what is wrong, with all lines at fault, and what to do.
    """
    path, layout = Path(path), layout or Layout()
    listed = None if points is None else read_list(Path(points), layout, surface)
    read = ReadingTable.read(path, True, layout, (listed and listed.labels) or ())
    thickness, row, layers, film_words = read.films_um()
    for k in np.flatnonzero((thickness < THINNEST_UM) | (thickness > THICKEST_UM)):
        found = f'{read.heading("thickness")} is {thickness[k]:g}'
        span = f'{THINNEST_UM:g} to {THICKEST_UM:g} micrometres'
        unit = ': it may be in another unit than is said' if thickness[k] > THICKEST_UM else ''
        read.add_error(row[k], f'{found}; expected {span}{unit}')
    doubts = tuple(read.doubts())
    if listed is not None:
        positions, normals, labels, place_words = _joined(listed, read)
        measured, count = len({*labels.tolist()}), len(listed)
        if 2 * measured < count:
            doubts += (
                f'only {measured} of the {count} points in {listed.path.name} have a reading; see '
                'whether the labels of the readings are those of the points',
            )
    else:
        positions, normals, place_words = _places(read, surface)
        labels = _labels(read, positions)
    sigma_um = np.full(len(read), np.nan)
    if read.has('sigma'):
        sigma_um = read.numbers(read.at['sigma'][0], may_be_empty=True)
        for k in np.flatnonzero(sigma_um <= 0.0):
            read.add_error(k, f'{read.heading("sigma")} is {sigma_um[k]:g}; expected above 0')
    read.refuse_errors()
    notes = [f'{len(row)} readings, {read.form}', f'{place_words}, {film_words}', read.left_out]
    groups, sessions = (np.array(c)[row] for c in (read.groups, read.of('session')))
    readings = Readings(
        positions[row], thickness, labels[row], groups, sigma_um[row],
        None if normals is None else normals[row], str(path), sessions,
        f'{path.name}: {"; ".join(filter(None, notes))}', layout.zero == 'film',
        GUESSED in place_words, doubts, layers, read.heading('thickness'),
    )  # fmt: skip
    require_repeats_close(readings)
    return readings


def read_points(path: str | Path, unit: str | None = None) -> dict[str, np.ndarray]:
    """Positions (3,) [m] by the names of points in a table with ``point`` and x, y, z, in order.

    ``unit`` is 'm', 'mm' or 'cm' where the headings have none.
    """
    points = read_list(Path(path), Layout(), None, LENGTHS[unit] if unit else None)
    return dict(zip(points.labels or (), points.positions_m, strict=True))


def read_list(
    path: Path, layout: Layout, surface: Surface | None, default_m: float | None = None
) -> ReadingTable:
    """Read a list of measuring points: their labels and x, y, z, or from_left, height.

    ``default_m`` is the unit of places whose headings have none [m].
    """
    try:
        read = ReadingTable.read(path, False, Layout(unit=layout.unit))
    except ReadingsError:
        # What is said of the readings may settle what the list leaves open.
        own = replace(layout, columns={}, zero='')
        if not (layout.decimal or layout.sheet):
            raise
        read = ReadingTable.read(path, False, own)
    columns = [k for axis in (*AXES, *ON_FACE) for k in read.at.get(axis, [])]
    if default_m and not any(read.headings[k].unit for k in columns):
        read.layout = replace(read.layout, unit={'position': default_m})
    positions, read.normals, place_words = _places(read, surface)
    labels = read.labels
    if labels is None:
        raise read.error(
            'the points have no labels; give a column point, with the labels of the readings'
        )
    first: dict[str, int] = {}
    for row, label in enumerate(labels):
        other = first.setdefault(label, row)
        if not label:
            read.add_error(row, NO_LABEL)
        elif not np.array_equal(positions[row], positions[other]):
            same = f"point '{label}' is elsewhere in line {read.lines[other]}"
            read.add_error(row, f'{same}; keep one')
    read.refuse_errors()
    read.positions_m = positions
    read.place_words = f'{place_words} of {len(labels)} points in {path.name} ({read.form})'
    return read


def _joined(
    listed: ReadingTable, readings: ReadingTable
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray, str]:
    """Positions (N, 3) [m], normals, labels (N,) of the rows of readings, and what was done.

    Rows that name no listed point are errors of the table of readings.
    """
    wanted, by = _wanted_by(listed, readings)
    labels = listed.labels or []
    places = {label: row for row, label in enumerate(labels)}
    known = f"its points are called '{labels[0]}' to '{labels[-1]}'"
    if any(wanted) and places.keys().isdisjoint(wanted):
        raise readings.error(
            f"the readings are called '{wanted[0]}' to '{wanted[-1]}', and there is no such "
            f'point in {listed.path.name} ({known}); name them alike, or leave the labels of '
            'the readings out where they are in the order of the points'
        )
    for row, label in enumerate(wanted):
        if label not in places:
            missing = f"no point '{label}' in {listed.path.name} ({known})"
            readings.add_error(row, missing if label else NO_LABEL)
    rows = [places.get(label, 0) for label in wanted]
    words = f'{listed.place_words}, joined {by}'
    if unmeasured := [label for label in labels if label not in set(wanted)]:
        named = some(unmeasured, 6)
        words += f' ({len(unmeasured)} of them without a reading: {named})'
    normals = None if listed.normals is None else listed.normals[rows]
    return listed.positions_m[rows], normals, np.array(wanted), words


def _wanted_by(listed: ReadingTable, readings: ReadingTable) -> tuple[list[str], str]:
    """Labels (N,) of the points that the rows belong to, and by what they are known.

    A gauge's own count of its readings is their order: it knows nothing of a point left out.
    """
    names, labels, by = listed.labels or [], readings.labels, readings.named_by
    orders = [([*map(str, order)], count) for order, count in readings.orders]
    if labels and {*labels}.isdisjoint(names) and len({*labels}) == 1:
        # The name of the part, or none.
        labels = labels if labels[0] and not format_of(readings.headings) else None
    again = ''
    if labels is not None and by[-1] == 'number':
        if {*labels}.isdisjoint(names):
            labels, by = readings.of('number'), ('number',)
        if by == ('number',):
            again = _counts_anew(readings)
            in_order = labels == orders[0][0] or (again and {*names} - {*labels})
            labels = None if in_order else labels
    if labels is not None:
        return labels, f"by '{' '.join(map(readings.heading, by))}'"
    for order, count in orders:
        if count == len(names):
            if not {*order} <= {*names}:
                order = [names[int(number) - 1] for number in order]
            _refuse_unknown_labels(listed, readings, order)
            unnamed = '' if readings.named_by else ' (no column is known as their label)'
            return order, f'by the order of the readings{unnamed}'
    if again:
        raise readings.error(f"{again}; give a column 'point' with the labels of the points")
    figures = readings.figures_at_end
    unknown = 'which is missing is not known; write n/a in its place'
    raise readings.error(
        f'{orders[0][1]} readings in order for the {len(names)} points in '
        f'{listed.path.name}: {f"{figures}; delete it if so" if figures else unknown}, or give '
        "a column 'point' with the labels of the points"
    )


def _refuse_unknown_labels(listed: ReadingTable, readings: ReadingTable, order: list[str]) -> None:
    """Refuse readings in order where a column that is not known holds the points' labels."""
    names = {*(listed.labels or ())}
    known = {column for columns in readings.at.values() for column in columns}
    for k in {*range(len(readings.headings))} - known:
        texts = readings.texts(k)
        counts = len({*texts}) < len(texts) and all(map(str.isdigit, texts))
        if {*texts} <= names and texts != order and not counts:
            heading = readings.headings[k].text
            raise readings.error(
                f"the column '{heading}' holds the labels of {listed.path.name} but is not "
                f'known as the label; say columns: {{point: {heading}}}'
            )


def _counts_anew(readings: ReadingTable) -> str:
    """In words that a count of readings begins anew and names no points, '' where it does not.

    It does so where another column changes, or from the same number each time.
    """
    numbers = readings.of('number')
    if not all(map(str.isdigit, numbers)) or len({*numbers}) == len(numbers):
        return ''
    counted = [*map(int, numbers)]
    falls = [row for row, (a, b) in enumerate(pairwise(counted), start=1) if b <= a]
    for column, heading in enumerate(readings.headings):
        texts = readings.texts(column)
        changes = [row for row, (a, b) in enumerate(pairwise(texts), start=1) if a != b]
        if changes == falls and column not in readings.at['thickness']:
            return f"'{readings.heading('number')}' counts anew in each {heading.text}"
    begins = {counted[row] for row in (0, *falls)}
    again = len(begins) == 1 < len(counted) / (len(falls) + 1)
    return f"'{readings.heading('number')}' counts anew" if again else ''


def write_predictions(path: str | Path, readings: Readings, predicted_um: np.ndarray) -> None:
    """Write the columns of the readings' file and ``predicted_um`` (N,), whole or not at all.

    A row with several readings is written once: they are at one place. Layers side by side have a
    column each, such as ``predicted_um base``. Numbers have a decimal point.
    """
    read = ReadingTable.read(Path(readings.source), True, Layout(), readings.point)
    _, row, layer, _ = read.films_um()
    names = [heading.text for heading in read.headings]
    kept = [k for k, name in enumerate(names) if name.split(' ')[0] != 'predicted_um']
    numeric = (*AXES, *ON_FACE, *NORMALS, 'sigma', 'thickness')
    words = {k for quantity, at in read.at.items() if quantity not in numeric for k in at}
    columns = {k: read.texts(k) for k in kept}
    for k in columns.keys() - words if read.decimal == ',' else ():
        columns[k] = [t if read.number(t) is None else t.replace(',', '.') for t in columns[k]]
    lines = {r: [texts[r] for texts in columns.values()] for r in sorted({*row.tolist()})}
    beside = list(dict.fromkeys(read.layers)) or ['']
    for one in beside:
        its = np.ones(len(row), dtype=bool) if one == '' else layer == one
        predicted = dict(zip(row[its][::-1].tolist(), predicted_um[its][::-1], strict=True))
        for r, line in lines.items():
            line.append(f'{predicted[r]:.4f}' if r in predicted else '')
    added = [f'predicted_um {one}'.strip() for one in beside]
    write_table(path, [[*(names[k] for k in kept), *added], *lines.values()])


def write_table(path: str | Path, lines: Iterable[Sequence[object]]) -> None:
    """Write lines of values as CSV, whole or not at all."""
    write_text(path, table_text(lines))


def table_text(lines: Iterable[Sequence[object]]) -> str:
    """Lines of values as CSV in which no program finds a formula: ' stands before such texts."""
    text = StringIO(newline='')
    writer = csv.writer(text, lineterminator='\n')
    writer.writerows(
        [FORMULA.sub("'", v) if isinstance(v, str) else v for v in line] for line in lines
    )
    return text.getvalue()


def _labels(read: ReadingTable, positions_m: np.ndarray) -> np.ndarray:
    """What the file calls the points, else the line of the first reading at each place."""
    names = [f'line {line}' for line in read.lines]
    _, first, place = np.unique(positions_m, axis=0, return_index=True, return_inverse=True)
    given = read.labels
    if given is not None and read.named_by[-1] == 'number':
        # A gauge counts the readings at one place, a list of points does not.
        one_each = len({*given}) == len(first) == len({*zip(given, place.ravel(), strict=True)})
        given = given if one_each else None
    if given is None:
        return np.array(names)[first[place.ravel()]]
    return np.array([label or name for label, name in zip(given, names, strict=True)])


def _places(
    read: ReadingTable, surface: Surface | None
) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Positions (N, 3) of the rows in the mesh frame [m], normals, and their unit in words."""
    if read.has(*AXES):
        positions, words = read.lengths_m(AXES)
        names = [name for name in NORMALS if read.has(name)]
        if not names:
            return positions, None, words
        if len(names) < len(NORMALS):
            raise read.error(f'has {", ".join(names)} only; give all of nx,ny,nz or none')
        normals = np.column_stack([read.numbers(read.at[name][0]) for name in names])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        for row in np.flatnonzero(lengths < 1e-6):
            read.add_error(row, 'the normal nx,ny,nz has length zero')
        return positions, normals / np.where(lengths < 1e-6, 1.0, lengths), words
    if read.has(*ON_FACE):
        if surface is None:
            raise read.error(
                f"'{read.heading('from_left')}' and '{read.heading('height')}' are places on a "
                'face; give x, y, z, or name the file in a campaign, which knows the part'
            )
        on_face, words = read.lengths_m(ON_FACE)
        positions, hit = on_face_m(surface, on_face)
        for row in np.flatnonzero(~hit & np.isfinite(on_face).all(axis=1)):
            left, height = on_face[row]
            read.add_error(
                row,
                f'{left:.3f} m from the left and {height:.3f} m from the lower edge there is no '
                'surface, as the gun sees the part',
            )
        return positions, None, words
    missing = [axis for axis in AXES if not read.has(axis)]
    if len(missing) < len(AXES):
        remedy = f'give it with columns: {{{missing[0]}: ...}} in the campaign'
        if not read.has('thickness'):
            remedy = f'rename it in {read.path.name}'
        raise read.error(
            f'no column is known as {" or ".join(missing)} {shown(read.headings)}; {remedy}'
        )
    raise read.error(
        f'the readings have no coordinates {shown(read.headings)}; give x, y, z, or a list of '
        'measuring points (points: in a campaign, else --points)'
    )
