"""The level, the misfit and what changed most, part after part."""

from pathlib import Path

from matplotlib.axes import Axes

from paint_deposition.line.change_points import SECONDS_A_DAY
from paint_deposition.line.result import Line
from paint_deposition.line.series import Series
from paint_deposition.report.pictures.chart import new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, BEFORE, COMPONENTS, INK

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
        quiet(axes, '', f'{series.name.replace(".", chr(10))} [{series.unit}]', size=9.0)
        _draw(axes, line, series)
    figure.suptitle(line.sentence, x=0.01, ha='left', fontsize=10, color=INK)
    return save_picture(figure, path)


def _draw(axes: Axes, line: Line, series: Series) -> None:
    times = line.times_s / SECONDS_A_DAY  # as matplotlib counts dates
    axes.xaxis_date()
    limit = series.charts.shewhart_limit * series.deviation
    axes.fill_between(
        times, series.centre - limit, series.centre + limit, color=BEFORE, alpha=0.2, linewidth=0
    )
    axes.axhline(series.centre, color=BEFORE, linewidth=1.0)
    axes.plot(times, series.values, '.', color=ACCENT, markersize=4)
    for change in (one for one in line.changes if one.series == series.name):
        begin = change.time_s / SECONDS_A_DAY
        first = change.before if change.kind == 'drift' else change.after
        axes.plot([begin, times[-1]], [first, change.after], color=COMPONENTS[0], linewidth=2.0)
        axes.axvline(begin, color=COMPONENTS[0], linewidth=1.0, linestyle=':')
