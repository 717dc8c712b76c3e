"""The files of a line: tables, figures, picture, and a report that needs no network."""

from __future__ import annotations

import json
from collections import Counter
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

from paint_deposition import __version__
from paint_deposition.batch.line.changes import (
    FEWEST,
    RUN_LENGTH,
    SECONDS_A_DAY,
    Series,
    date,
)
from paint_deposition.batch.line.result import DERIVATIVES, Line
from paint_deposition.files.atomic import write_text
from paint_deposition.files.json_files import write_json
from paint_deposition.files.parquet import write_parquet
from paint_deposition.files.provenance import model_digest
from paint_deposition.report.page.layout import axis, base_layout
from paint_deposition.report.page.report import TEMPLATES as SHARED
from paint_deposition.report.pictures.chart import legend, new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, BEFORE, COMPONENTS, INK
from paint_deposition.report.words import unit_words

if TYPE_CHECKING:
    import pyarrow as pa

MOST_SHOWN = 6
TEMPLATES = Path(__file__).parent / 'templates'
HEIGHT = 240
MARGIN = 0.03
# Words, colour and kind of what the charts of a series show.
LEGEND = (
    ('part', ACCENT, 'dot'), ('centre', INK, 'line'), ("Shewhart's limits", BEFORE, 'dots'),
    ('change', COMPONENTS[0], 'bold'), ('EWMA', ACCENT, 'line'), ('its limits', ACCENT, 'dots'),
    ('CUSUM upwards', COMPONENTS[0], 'line'), ('CUSUM downwards', COMPONENTS[1], 'line'),
    ('their limits', BEFORE, 'dashes'),
)  # fmt: skip


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
        files.append(folder / f'line.{pictures}')
        _write_picture(files[-1], line)
    files.append(folder / 'report.html')
    write_text(files[-1], line_html(line))
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


def _write_picture(path: Path, line: Line) -> None:
    """Draw the charts of values; line has at least one series."""
    causes = line.pooled.causes if line.pooled else ()
    names = {f'{cause.effect}.{cause.parameter}' for cause in causes}
    names |= {'level', 'misfit'} | {change.series for change in line.changes}
    shown = [one for one in line.series if one.name in names][:MOST_SHOWN]
    figure = new_figure(9.0, 2.4 * len(shown) + 0.4)
    rows = figure.subplots(len(shown), 1, squeeze=False, sharex=True)[:, 0]
    for axes, series in zip(rows, shown, strict=True):
        unit = unit_words(series.unit)
        quiet(axes, '', series.name.replace('.', '\n') + (f' [{unit}]' if unit else ''), size=9.0)
        _draw_series(axes, line, series)
    legend(rows[0], loc='upper left', bbox_to_anchor=(0.0, 1.16), ncols=4)
    figure.suptitle(line.sentence, x=0.01, ha='left', fontsize=10, color=INK)
    save_picture(figure, path)


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


def title_of(line: Line) -> str:
    """The result in a line."""
    if line.changes:
        strongest = max(line.changes, key=lambda change: change.strength).sentence
        return strongest[0].upper() + strongest[1:]
    return 'Nothing changed' if line.series else 'Too few measured parts for charts'


def line_html(line: Line) -> str:
    """The page as text."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {'date': date, 'unit': unit_words}
    charts = {'films': _films(line)}
    for number, one in enumerate(line.series):
        charts[f'values-{number}'] = _values(line, one)
        charts[f'sums-{number}'] = _sums(line, one)
    made = datetime.now().astimezone().strftime('%Y-%m-%d %H:%M %Z')
    return environment.get_template('line.html.j2').render(
        line=line,
        title=title_of(line),
        made=f'{made}, paint_deposition {__version__}',
        model=model_digest(line.model)[:12],
        fewest=FEWEST,
        run_length=RUN_LENGTH,
        legend=LEGEND,
        style=(SHARED / 'report.css').read_text(encoding='utf-8'),
        charts=json.dumps(charts, allow_nan=False).replace('<', '\\u003c'),
        plotly=get_plotlyjs(),
    )


def _values(line: Line, series: Series) -> dict[str, Any]:
    """Each part with its readings' deviation, centre, limits and changes."""
    times = _times(line.times_s)
    limit = series.charts.shewhart_limit * series.deviation
    names = [part.name for part in line.parts]
    part = {
        'x': times, 'y': _numbers(series.values), 'text': names, 'mode': 'markers',
        'marker': {'color': ACCENT, 'size': 5}, 'name': 'part',
        'hovertemplate': '%{text}: %{y:.3g}<extra></extra>',
    }  # fmt: skip
    data = [
        *(_level(times, edge, BEFORE, 'dot', 'limit')
          for edge in (series.centre - limit, series.centre + limit)),
        _level(times, np.full(len(times), series.centre), INK, 'solid', 'centre'),
    ]  # fmt: skip
    for change in (one for one in line.changes if one.series == series.name):
        level = [change.before, change.after]
        x = _times(np.array([change.time_s, line.times_s[-1]]))
        y = level if change.kind == 'drift' else [change.after] * 2
        data.append({'x': x, 'y': y, 'mode': 'lines', 'name': change.kind,
                     'line': {'color': COMPONENTS[0], 'width': 3}})  # fmt: skip
    return {'data': [*data, part], 'layout': base_layout(
        height=HEIGHT, xaxis=axis(range=_span(line.times_s)), yaxis=axis(unit_words(series.unit))
    )}  # fmt: skip


def _sums(line: Line, series: Series) -> dict[str, Any]:
    times, drawn = _times(line.times_s), series.charts
    count = len(times)
    data = [
        _level(times, drawn.ewma, ACCENT, 'solid', 'EWMA'),
        _level(times, drawn.ewma_limit, ACCENT, 'dot', 'limit of the EWMA'),
        _level(times, -drawn.ewma_limit, ACCENT, 'dot', 'limit of the EWMA'),
        _level(times, drawn.high, COMPONENTS[0], 'solid', 'CUSUM, upwards'),
        _level(times, -drawn.low, COMPONENTS[1], 'solid', 'CUSUM, downwards'),
        _level(times, np.full(count, drawn.cusum_limit), BEFORE, 'dash', 'limit of the CUSUM'),
        _level(times, np.full(count, -drawn.cusum_limit), BEFORE, 'dash', 'limit of the CUSUM'),
    ]
    return {'data': data, 'layout': base_layout(
        height=HEIGHT, xaxis=axis(range=_span(line.times_s)), yaxis=axis('standard deviations')
    )}  # fmt: skip


def _span(times_s: np.ndarray) -> list[str]:
    """Ends of the time axis, a little wider than the parts."""
    return _times(times_s[[0, -1]] + np.array([-MARGIN, MARGIN]) * np.ptp(times_s))


def _films(line: Line) -> dict[str, Any]:
    """Mean film as computed from each recording: what the motion alone changes."""
    runs = [run for run in line.runs if run.get('film_mean_um') is not None]
    data = [{
        'x': _times(np.array([run['time_s'] for run in runs])),
        'y': [run['film_mean_um'] for run in runs], 'text': [run['part'] for run in runs],
        'mode': 'markers', 'marker': {'color': ACCENT, 'size': 5},
        'hovertemplate': '%{text}: %{y:.2f} µm<extra></extra>',
    }]  # fmt: skip
    layout = base_layout(height=HEIGHT, xaxis=axis(), yaxis=axis('mean film as computed [µm]'))
    return {'data': data, 'layout': layout}


def _level(
    times: list[str], values: np.ndarray, colour: str, dash: str, name: str
) -> dict[str, Any]:
    line = {'color': colour, 'width': 1.4, 'dash': dash}
    return {'x': times, 'y': _numbers(values), 'mode': 'lines', 'line': line, 'name': name}


def _numbers(values: np.ndarray) -> list[float]:
    return [float(f'{value:.6g}') for value in values]


def _times(times_s: np.ndarray) -> list[str]:
    return [
        datetime.fromtimestamp(time_s, timezone.utc).strftime('%Y-%m-%d %H:%M:%S')
        for time_s in times_s
    ]
