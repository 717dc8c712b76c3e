"""The files of a line: tables, figures and the picture of its charts."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

from paint_deposition.batch.line.changes import SECONDS_A_DAY, Series
from paint_deposition.batch.line.result import DERIVATIVES, Line
from paint_deposition.files.json_files import write_json
from paint_deposition.files.parquet import write_parquet
from paint_deposition.report.pictures.chart import legend, new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, BEFORE, COMPONENTS, INK
from paint_deposition.report.words import unit_words

if TYPE_CHECKING:
    import pyarrow as pa

MOST_SHOWN = 6


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
        files.append(_write_picture(folder / f'line.{pictures}', line))
    return files


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
        readings: dict[str, Any] = {'readings': measured[run['part']]}
        for series in line.series:
            name = {'level': 'level_percent'}.get(series.name, series.name)
            readings[name] = None if row is None else float(series.values[row])
            readings[f'{name}_sd'] = None if row is None else float(series.sd[row])
        rows.append(run | readings)
    return pa.Table.from_pylist(rows)


def _with_time(table: pa.Table) -> pa.Table:
    """With the column ``time_s``, seconds since 1970, also as date and time."""
    import pyarrow as pa

    microseconds = [None if s is None else round(1e6 * s) for s in table['time_s'].to_pylist()]
    return table.append_column('time', pa.array(microseconds, pa.timestamp('us', 'UTC')))


def _write_picture(path: Path, line: Line) -> Path:
    """Draw the charts of values, beside each its EWMA; line has at least one series."""
    causes = line.pooled.causes if line.pooled else ()
    names = {f'{cause.effect}.{cause.parameter}' for cause in causes}
    names |= {'level', 'misfit'} | {change.series for change in line.changes}
    shown = [one for one in line.series if one.name in names][:MOST_SHOWN]
    figure = new_figure(13.0, 2.4 * len(shown) + 0.4)
    rows = figure.subplots(len(shown), 2, squeeze=False, sharex=True, width_ratios=(2, 1))
    for (axes, beside), series in zip(rows, shown, strict=True):
        unit = unit_words(series.unit)
        quiet(axes, '', series.name.replace('.', '\n') + (f' [{unit}]' if unit else ''), size=9.0)
        _draw_series(axes, line, series)
        quiet(beside, '', 'EWMA [σ]', size=9.0)
        times, charts = line.times_s / SECONDS_A_DAY, series.charts
        beside.plot(times, charts.ewma, color=ACCENT, linewidth=1.2)
        for side in (-1.0, 1.0):
            beside.plot(times, side * charts.ewma_limit, color=BEFORE, linestyle=':')
    legend(rows[0, 0], loc='upper left', bbox_to_anchor=(0.0, 1.16), ncols=4)
    figure.suptitle(line.sentence, x=0.01, ha='left', fontsize=10, color=INK)
    return save_picture(figure, path)


def _draw_series(axes: Axes, line: Line, series: Series) -> None:
    times = line.times_s / SECONDS_A_DAY  # as matplotlib counts dates
    axes.xaxis.set_major_locator(dates := AutoDateLocator())
    axes.xaxis.set_major_formatter(ConciseDateFormatter(dates, show_offset=False))
    limit = series.charts.shewhart_limit * series.deviation
    axes.fill_between(
        times, series.centre - limit, series.centre + limit, color=BEFORE, alpha=0.2, linewidth=0,
        label="Shewhart's limits",
    )  # fmt: skip
    axes.axhline(series.centre, color=BEFORE, linewidth=1.0, label='centre')
    axes.plot(times, series.values, '.', color=ACCENT, markersize=4, label='part', zorder=3)
    for change in (one for one in line.changes if one.series == series.name):
        begin = change.time_s / SECONDS_A_DAY
        first = change.before if change.kind == 'drift' else change.after
        axes.plot([begin, times[-1]], [first, change.after], color=COMPONENTS[0], linewidth=2.0,
                  label='change')  # fmt: skip
        axes.axvline(begin, color=COMPONENTS[0], linewidth=1.0, linestyle=':')
