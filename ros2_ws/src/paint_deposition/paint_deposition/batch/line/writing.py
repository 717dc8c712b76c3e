"""The files of a line: tables, figures, picture and report."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paint_deposition.batch.line.picture import write_line_picture
from paint_deposition.batch.line.report import write_line_report
from paint_deposition.batch.line.result import DERIVATIVES, Line
from paint_deposition.files.json_files import write_json
from paint_deposition.files.parquet import write_parquet

if TYPE_CHECKING:
    import pyarrow as pa


def write_line(line: Line, folder: Path, pictures: str = 'png') -> list[Path]:
    """Write everything to a folder; returns the paths."""
    table = line.table
    own = [name for name in DERIVATIVES if name in table.column_names]
    files = [
        write_parquet(folder / 'points.parquet', _with_time(table.drop_columns(own))),
        write_parquet(folder / 'parts.parquet', _with_time(_parts(line))),
        folder / 'line.json',
    ]
    write_json(files[-1], line.to_dict())
    if line.series:
        files.append(write_line_picture(folder / f'line.{pictures}', line))
    return [*files, write_line_report(folder / 'report.html', line)]


def _parts(line: Line) -> pa.Table:
    """A row for each part: when, its film as computed, and what its readings say."""
    import pyarrow as pa

    columns = line.table.to_pydict()
    there = columns.get('measured_um', [])
    measured = Counter(
        p for p, value in zip(columns['part'], there, strict=False) if value is not None
    )
    place = {part.name: row for row, part in enumerate(line.parts)}
    rows: list[dict[str, Any]] = []
    for run in line.runs:
        row = place.get(run['part'])
        told: dict[str, Any] = {'readings': measured[run['part']]}
        for series in line.series:
            name = {'level': 'level_percent'}.get(series.name, series.name)
            told[name] = None if row is None else float(series.values[row])
            told[f'{name}_sd'] = None if row is None else float(series.sd[row])
        rows.append(run | told)
    return pa.Table.from_pylist(rows)


def _with_time(table: pa.Table) -> pa.Table:
    """With the column ``time_s``, seconds since 1970, also as date and time."""
    import pyarrow as pa

    microseconds = [None if s is None else round(1e6 * s) for s in table['time_s'].to_pylist()]
    return table.append_column('time', pa.array(microseconds, pa.timestamp('us', 'UTC')))
