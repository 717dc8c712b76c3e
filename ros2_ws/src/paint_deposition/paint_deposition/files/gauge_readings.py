"""Gauge readings from the files that gauges and spreadsheets write, and tables that we write."""

import csv
from collections.abc import Iterable, Sequence
from io import StringIO
from pathlib import Path

import numpy as np

from paint_deposition.files.atomic import write_text
from paint_deposition.files.measuring_points import MeasuringPoints, places_of
from paint_deposition.files.tables.finding import read_table
from paint_deposition.files.tables.layout import Layout
from paint_deposition.files.tables.sheets import text_of
from paint_deposition.files.tables.table import Table
from paint_deposition.inference.readings.readings import Readings, require_repeats_close
from paint_deposition.part.surface import Surface

THINNEST_UM = -5.0
THICKEST_UM = 5000.0


def read_readings(
    path: str | Path,
    points: str | Path | None = None,
    layout: Layout | None = None,
    surface: Surface | None = None,
) -> Readings:
    """Read gauge readings.

    Args:
        path: CSV, TSV, TXT or a workbook. The project's own columns are
            ``x_m,y_m,z_m,thickness_um`` and optionally ``point``, ``sigma_um``, ``group``,
            ``session`` and ``nx,ny,nz``; others are known by the words of the trade. Without
            labels, readings at exactly one place are repeats.
        points: file of the measuring points (label, x, y, z) of readings that name their point
            only.
        layout: what the file does not tell itself.
        surface: the part, for points that are given on its face.

    Raises:
        ReadingsError: what is wrong, with all lines at fault, and what to do.
    """
    path, layout = Path(path), layout or Layout()
    table = read_table(path, 'thickness', layout)
    thickness, row, film_words = table.films_um()
    for k in np.flatnonzero((thickness < THINNEST_UM) | (thickness > THICKEST_UM)):
        span = f'{THINNEST_UM:g} to {THICKEST_UM:g} micrometres'
        found = f'{table.heading("thickness")} is {thickness[k]:g}'
        table.complaints.at(table.lines[row[k]], f'{found}; expected {span}')
    if points is not None:
        listed = MeasuringPoints.read(Path(points), layout, surface)
        positions, normals, labels, place_words = listed.joined_to(table)
    else:
        positions, normals, place_words = places_of(table, surface)
        labels = _labels(table, positions)
    sigma_um = _sigma_um(table)
    table.complaints.refuse_any()
    taken = table.select(row)
    counted = f'{len(row)} readings'
    parts = [f'{counted}, {table.form}', f'{place_words}, {film_words}', table.left_out]
    readings = Readings(
        positions[row],
        thickness,
        labels[row],
        np.array(taken.texts('group')),
        sigma_um[row],
        None if normals is None else normals[row],
        str(path),
        np.array(taken.texts('session')),
        f'{path.name}: {"; ".join(filter(None, parts))}',
    )
    require_repeats_close(readings)
    return readings


def _labels(table: Table, positions_m: np.ndarray) -> np.ndarray:
    if table.has('point'):
        labels = zip(table.texts('point'), table.lines, strict=True)
        return np.array([label or f'line {line}' for label, line in labels])
    _, first, place = np.unique(positions_m, axis=0, return_index=True, return_inverse=True)
    return np.array([f'line {table.lines[row]}' for row in first[place.ravel()]])


def _sigma_um(table: Table) -> np.ndarray:
    if not table.has('sigma'):
        return np.full(len(table), np.nan)
    sigma_um, _ = table.numbers('sigma', may_be_empty=True)
    for row in np.flatnonzero(sigma_um <= 0.0):
        text = f'{table.heading("sigma")} is {sigma_um[row]:g}; expected above 0'
        table.complaints.at(table.lines[row], text)
    return sigma_um


def write_predictions(
    path: str | Path, readings_path: str | Path, predicted_um: np.ndarray
) -> None:
    """Write the readings' own columns with ``predicted_um`` (N,) added, whole or not at all.

    A row with several readings is written once: they are at one place.
    """
    table = read_table(Path(readings_path), 'thickness', Layout())
    _, row, _ = table.films_um()
    rows, first = np.unique(row, return_index=True)
    names = table.columns.headings
    kept = [k for k, name in enumerate(names) if name != 'predicted_um']
    lines = [[text_of(table.rows[r][k]) for k in kept] for r in rows]
    for line, k in zip(lines, first, strict=True):
        line.append(f'{predicted_um[k]:.4f}')
    write_table(path, [[*(names[k] for k in kept), 'predicted_um'], *lines])


def write_table(path: str | Path, lines: Iterable[Sequence[object]]) -> None:
    """Write lines of values as CSV, whole or not at all."""
    text = StringIO(newline='')
    csv.writer(text, lineterminator='\n').writerows(lines)
    write_text(path, text.getvalue())
