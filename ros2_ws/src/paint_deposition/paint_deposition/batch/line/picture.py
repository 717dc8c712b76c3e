"""The level, the misfit and what changed most, part after part."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

from paint_deposition.batch.line.change_points import SECONDS_A_DAY
from paint_deposition.batch.line.result import Line
from paint_deposition.batch.line.series import Series
from paint_deposition.report.pictures.chart import legend, new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, BEFORE, COMPONENTS, INK
from paint_deposition.report.words import unit_words

MOST_SHOWN = 6


def write_line_picture(path: Path, line: Line) -> Path:
    """Draw the charts of values; line has at least one series."""
    causes = line.pooled.causes if line.pooled else ()
    told = {f'{cause.effect}.{cause.parameter}' for cause in causes}
    told |= {'level', 'misfit'} | {change.series for change in line.changes}
    shown = [one for one in line.series if one.name in told][:MOST_SHOWN]
    figure = new_figure(9.0, 2.4 * len(shown) + 0.4)
    rows = figure.subplots(len(shown), 1, squeeze=False, sharex=True)[:, 0]
    for axes, series in zip(rows, shown, strict=True):
        unit = unit_words(series.unit)
        quiet(axes, '', series.name.replace('.', '\n') + (f' [{unit}]' if unit else ''), size=9.0)
        _draw(axes, line, series)
    legend(rows[0], loc='upper left', bbox_to_anchor=(0.0, 1.16), ncols=4)
    figure.suptitle(line.sentence, x=0.01, ha='left', fontsize=10, color=INK)
    return save_picture(figure, path)


def _draw(axes: Axes, line: Line, series: Series) -> None:
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
