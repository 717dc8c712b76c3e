"""Tables of gauge readings, CSV: read, checked, and written with predictions."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np

from paint_deposition.errors import ReadingsError, did_you_mean
from paint_deposition.files.atomic import write_text
from paint_deposition.readings.readings import Readings, require_repeats_close

REQUIRED = ('x_m', 'y_m', 'z_m', 'thickness_um')
UNITS = {'m': 'metres', 'um': 'micrometres'}
THINNEST_UM = -5.0
THICKEST_UM = 5000.0


@dataclass(frozen=True)
class Table:
    """A CSV file: names of the columns, rows of texts, and the line that each row stands in."""

    path: Path
    header: list[str]
    rows: list[list[str]]
    lines: list[int]

    def texts(self, name: str) -> list[str]:
        """A column, without blanks around the values; empty texts where there is none."""
        if name not in self.header:
            return [''] * len(self.rows)
        at = self.header.index(name)
        return [row[at].strip() for row in self.rows]

    def numbers(self, name: str, may_be_empty: bool = False) -> np.ndarray:
        """A column of finite numbers; nan where it may be empty and is.

        Raises:
            ReadingsError: the line and what stands there.
        """
        values = np.full(len(self.rows), np.nan)
        for index, text in enumerate(self.texts(name)):
            if may_be_empty and not text:
                continue
            try:
                values[index] = float(text)
            except ValueError:
                reason = f"{name} is '{text}'; expected a number with a point"
                raise self.refusal(index, reason) from None
            if not np.isfinite(values[index]):
                raise self.refusal(index, f'{name} is {text}; expected a finite number')
        return values

    def refusal(self, row: int, text: str) -> ReadingsError:
        """What is wrong in a row, as an error to raise."""
        return ReadingsError(f'{self.path}: line {self.lines[row]}: {text}')


def read_readings(path: str | Path) -> Readings:
    """Read gauge readings.

    Args:
        path: CSV with ``x_m,y_m,z_m,thickness_um`` and optionally ``point``, ``sigma_um``,
            ``group``, ``session`` and ``nx,ny,nz``; other columns are ignored. Without
            ``point``, readings at exactly one place are repeats.

    Raises:
        ReadingsError: the file, line and column at fault, and what to do.
    """
    table = read_table(Path(path))
    positions = np.column_stack([table.numbers(name) for name in ('x_m', 'y_m', 'z_m')])
    thickness = table.numbers('thickness_um')
    for row in np.flatnonzero((thickness < THINNEST_UM) | (thickness > THICKEST_UM)):
        span = f'{THINNEST_UM:g} to {THICKEST_UM:g} micrometres'
        raise table.refusal(row, f'thickness_um is {thickness[row]:g}; expected {span}')
    sigma_um = table.numbers('sigma_um', may_be_empty=True)
    for row in np.flatnonzero(sigma_um <= 0.0):
        raise table.refusal(row, f'sigma_um is {sigma_um[row]:g}; expected above 0')
    points, groups = _points(table, positions), np.array(table.texts('group'))
    sessions = np.array(table.texts('session'))
    normals = _normals(table)
    readings = Readings(
        positions, thickness, points, groups, sigma_um, normals, str(path), sessions
    )
    require_repeats_close(readings)
    return readings


def _points(table: Table, positions_m: np.ndarray) -> np.ndarray:
    if 'point' in table.header:
        labels = zip(table.texts('point'), table.lines, strict=True)
        return np.array([label or f'line {line}' for label, line in labels])
    _, first, place = np.unique(positions_m, axis=0, return_index=True, return_inverse=True)
    return np.array([f'line {table.lines[row]}' for row in first[place.ravel()]])


def _normals(table: Table) -> np.ndarray | None:
    names = [name for name in ('nx', 'ny', 'nz') if name in table.header]
    if not names:
        return None
    if len(names) < 3:
        raise ReadingsError(
            f'{table.path}: has {", ".join(names)} only; give all of nx,ny,nz or none'
        )
    normals = np.column_stack([table.numbers(name) for name in names])
    lengths = np.linalg.norm(normals, axis=1)
    for row in np.flatnonzero(lengths < 1e-6):
        raise table.refusal(row, 'the normal nx,ny,nz has length zero')
    return normals / lengths[:, np.newaxis]


def read_table(path: Path) -> Table:
    """A CSV file that begins with column names; blank lines and comments (#) are skipped.

    Raises:
        ReadingsError: no file, no rows, a column missing or there twice, or a ragged line.
    """
    try:
        with path.open(newline='', encoding='utf-8-sig') as file:
            reader = csv.reader(file)
            content = [(reader.line_num, line) for line in reader if not _is_blank(line)]
    except FileNotFoundError:
        raise ReadingsError(f'{path}: no such file; give a CSV of gauge readings') from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ReadingsError(f'{path}: cannot be read as CSV text ({error})') from None
    header = [name.strip() for name in content[0][1]] if content else []
    _check_header(path, header)
    table = Table(path, header, [row for _, row in content[1:]], [line for line, _ in content[1:]])
    if not table.rows:
        raise ReadingsError(f'{path}: no readings below the header')
    for index, row in enumerate(table.rows):
        if len(row) != len(header):
            raise table.refusal(index, f'{len(row)} values under {len(header)} column names')
    return table


def _check_header(path: Path, header: list[str]) -> None:
    for name in header:
        if name and header.count(name) > 1:
            raise ReadingsError(f"{path}: two columns are called '{name}'; keep one")
    for name in REQUIRED:
        if name not in header:
            known = f'(columns: {", ".join(header) or "none"})'
            raise ReadingsError(f"{path}: no column '{name}' {known}; {_hint(name, header)}")


def _hint(name: str, header: list[str]) -> str:
    """What to do about a required column that is not there."""
    if len(header) == 1 and any(separator in header[0] for separator in ';\t'):
        return 'separate the columns with commas, and write numbers with a point'
    quantity, _, unit = name.rpartition('_')
    same = [other for other in header if other.lower().partition('_')[0] == quantity]
    if same and same[0].lower() != name:
        return f"give '{same[0]}' in {UNITS[unit]} and call it {name}"
    strange = [other for other in header if other not in REQUIRED]
    needed = f'the readings need {", ".join(REQUIRED)}'
    return did_you_mean(name, same or strange, needed)


def write_predictions(
    path: str | Path, readings_path: str | Path, predicted_um: np.ndarray
) -> None:
    """Write the readings' own columns with ``predicted_um`` (N,) added, whole or not at all."""
    table = read_table(Path(readings_path))
    columns = [c for c in zip(table.header, *table.rows, strict=True) if c[0] != 'predicted_um']
    columns.append(('predicted_um', *(f'{value:.4f}' for value in predicted_um)))
    write_table(path, zip(*columns, strict=True))


def write_table(path: str | Path, lines: Iterable[Sequence[object]]) -> None:
    """Write lines of values as CSV, whole or not at all."""
    text = StringIO(newline='')
    csv.writer(text, lineterminator='\n').writerows(lines)
    write_text(path, text.getvalue())


def _is_blank(line: list[str]) -> bool:
    return not any(value.strip() for value in line) or line[0].lstrip().startswith('#')
