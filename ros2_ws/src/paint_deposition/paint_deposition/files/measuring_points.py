"""Where readings were taken: coordinates, places on a face, or labels of listed points."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paint_deposition.files.tables.columns import AXES, NORMALS, ON_FACE
from paint_deposition.files.tables.finding import read_table
from paint_deposition.files.tables.layout import Layout
from paint_deposition.files.tables.table import Table
from paint_deposition.part.gauge_places import on_face_m
from paint_deposition.part.surface import Surface

MOST_NAMED = 6


@dataclass(frozen=True)
class MeasuringPoints:
    """A list of points on a part.

    Attributes:
        path: of its file.
        labels: one for each point.
        positions_m: (P, 3) in the mesh frame [m].
        normals: (P, 3) outward unit normals, or None.
        words: what was understood, for the user.
    """

    path: Path
    labels: list[str]
    positions_m: np.ndarray
    normals: np.ndarray | None
    words: str

    @staticmethod
    def read(path: Path, layout: Layout, surface: Surface | None) -> 'MeasuringPoints':
        """Read a list: point label and x, y, z, or from_left, height.

        Raises:
            ReadingsError: all that is wrong with the file.
        """
        table = read_table(path, 'place', Layout(unit=layout.unit))
        positions, normals, place_words = places_of(table, surface)
        quantity = 'point' if table.has('point') else 'number'
        if not table.has(quantity):
            raise table.complaints.of_file(
                'the points have no labels; give a column point, with the labels of the readings'
            )
        labels = table.texts(quantity)
        first: dict[str, int] = {}
        for row, label in enumerate(labels):
            other = first.setdefault(label, row)
            if not label:
                table.complaints.at(table.lines[row], 'the point has no label')
            elif not np.array_equal(positions[row], positions[other]):
                same = f"point '{label}' is elsewhere in line {table.lines[other]}"
                table.complaints.at(table.lines[row], f'{same}; keep one')
        table.complaints.refuse_any()
        words = f'{place_words} of {len(labels)} points in {path.name} ({table.form})'
        return MeasuringPoints(path, labels, positions, normals, words)

    def joined_to(self, readings: Table) -> tuple[np.ndarray, np.ndarray | None, np.ndarray, str]:
        """Positions (N, 3) [m], normals, labels (N,) of the rows of readings, and what was done.

        Rows that name no listed point are complained of in the table of readings.
        """
        quantity = 'point' if readings.has('point') else 'number'
        if readings.has(quantity):
            wanted, by = readings.texts(quantity), f"by '{readings.heading(quantity)}'"
        else:
            wanted, by = [f'{k + 1}' for k in range(len(readings))], 'by the order of the readings'
        places = {label: row for row, label in enumerate(self.labels)}
        rows = []
        for line, label in zip(readings.lines, wanted, strict=True):
            if label not in places:
                known = f"its points are called '{self.labels[0]}' to '{self.labels[-1]}'"
                readings.complaints.at(line, f"no point '{label}' in {self.path.name} ({known})")
            rows.append(places.get(label, 0))
        unmeasured = [label for label in self.labels if label not in set(wanted)]
        words = f'{self.words}, joined {by}'
        if unmeasured:
            more = ', ...' if len(unmeasured) > MOST_NAMED else ''
            named = ', '.join(unmeasured[:MOST_NAMED])
            words += f' ({len(unmeasured)} of them without a reading: {named}{more})'
        normals = None if self.normals is None else self.normals[rows]
        return self.positions_m[rows], normals, np.array(wanted), words


def places_of(table: Table, surface: Surface | None) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Positions (N, 3) of a table's rows in the mesh frame [m], normals, and their unit in words.

    Raises:
        ReadingsError: the table does not tell where its rows were taken.
    """
    if table.has(*AXES):
        positions, words = table.lengths_m(AXES)
        return positions, _normals(table), words
    if table.has(*ON_FACE):
        if surface is None:
            raise table.complaints.of_file(
                f"'{table.heading('from_left')}' and '{table.heading('height')}' are places on a "
                'face; give x, y, z, or name the file in a campaign, which knows the part'
            )
        on_face, words = table.lengths_m(ON_FACE)
        positions, hit = on_face_m(surface, on_face)
        for row in np.flatnonzero(~hit & np.isfinite(on_face).all(axis=1)):
            left, height = on_face[row]
            table.complaints.at(
                table.lines[row],
                f'{left:.3f} m from the left and {height:.3f} m from the lower edge there is no '
                'surface, as the gun sees the part',
            )
        return positions, None, words
    missing = [axis for axis in AXES if not table.has(axis)]
    shown = ', '.join(f"'{heading}'" for heading in table.columns.headings if heading)
    if len(missing) < len(AXES):
        raise table.complaints.of_file(
            f'no column with numbers is known as {" or ".join(missing)} (columns: {shown}); '
            f'the readings need x, y and z'
        )
    raise table.complaints.of_file(
        f'the readings have no coordinates (columns: {shown}); give x, y, z, or a list of '
        'measuring points (points: in a campaign, --points with simulate)'
    )


def _normals(table: Table) -> np.ndarray | None:
    names = [name for name in NORMALS if table.has(name)]
    if not names:
        return None
    if len(names) < len(NORMALS):
        raise table.complaints.of_file(
            f'has {", ".join(names)} only; give all of nx,ny,nz or none'
        )
    normals = np.column_stack([table.numbers(name)[0] for name in names])
    lengths = np.linalg.norm(normals, axis=1)
    for row in np.flatnonzero(lengths < 1e-6):
        table.complaints.at(table.lines[row], 'the normal nx,ny,nz has length zero')
    return normals / np.where(lengths < 1e-6, 1.0, lengths)[:, np.newaxis]
