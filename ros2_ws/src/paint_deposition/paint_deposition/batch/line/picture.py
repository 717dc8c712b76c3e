"""The charts of a line that have news, part after part."""

from collections.abc import Sequence
from datetime import datetime, timezone

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from paint_deposition.batch.line.changes import SECONDS_A_DAY, Change, Series
from paint_deposition.report.pictures.chart import legend, new_figure, quiet
from paint_deposition.report.style import ACCENT, ALARM, BEFORE, COMPONENTS, INK
from paint_deposition.report.words import unit_words

MOST_SHOWN = 6


def line_figure(
    title: str, series: Sequence[Series], changes: Sequence[Change], times_s: np.ndarray,
    causes: set[str],
) -> Figure:  # fmt: skip
    """Draw level and misfit, and what else is in alarm, changed or is among the causes."""
    news = {'level', 'misfit'} | causes | {change.series for change in changes}
    shown = [one for one in series if one.name in news or one.charts.in_alarm.any()][:MOST_SHOWN]
    figure = new_figure(13.0, 2.4 * len(shown) + 0.6)
    rows = figure.subplots(len(shown), 2, squeeze=False, sharex=True, width_ratios=(2, 1))
    for (axes, beside), one in zip(rows, shown, strict=True):
        unit = unit_words(one.unit)
        label = one.words.replace(', ', '\n') + (f'\n[{unit}]' if unit else '')
        quiet(axes, '', label, size=9.0)
        quiet(beside, '', 'EWMA [σ]', size=9.0)
        mine = [change for change in changes if change.series == one.name]
        _draw_values(axes, one, mine, times_s)
        _draw_ewma(beside, one)
    for axes in rows[-1]:
        _date_parts(axes, times_s)
    legend(rows[0, 0], loc='upper left', bbox_to_anchor=(0.0, 1.2), ncols=5)
    figure.suptitle(title, x=0.01, ha='left', fontsize=10, color=INK)
    return figure


def _draw_values(
    axes: Axes, series: Series, changes: Sequence[Change], times_s: np.ndarray
) -> None:
    part = np.arange(len(times_s))
    limit = series.charts.shewhart_limit * series.deviation
    axes.fill_between(
        part, series.centre - limit, series.centre + limit, color=BEFORE, alpha=0.2, linewidth=0,
        label="Shewhart's limits",
    )  # fmt: skip
    axes.axhline(series.centre, color=BEFORE, linewidth=1.0, label='centre')
    _draw_parts(axes, series.values, series.charts.in_alarm)
    for change in changes:
        row = change.part
        since_days = (times_s[row:] - times_s[row]) / SECONDS_A_DAY
        grown = since_days * (change.per_day or 0.0)
        first = change.before if change.kind == 'drift' else change.after
        axes.plot(part[row:], first + grown, color=COMPONENTS[0], linewidth=2.0, label='change')
        begun = np.searchsorted(times_s, (change.earliest_s, change.latest_s))
        axes.axvspan(begun[0] - 0.5, begun[1] + 0.5, color=COMPONENTS[0], alpha=0.15, linewidth=0)


def _draw_ewma(axes: Axes, series: Series) -> None:
    charts = series.charts
    part = np.arange(len(charts.ewma))
    axes.plot(part, charts.ewma, color=ACCENT, linewidth=1.2)
    for side in (-1.0, 1.0):
        axes.plot(part, side * charts.ewma_limit, color=BEFORE, linestyle=':')
    beyond = np.abs(charts.ewma) > charts.ewma_limit
    axes.plot(part[beyond], charts.ewma[beyond], '.', color=ALARM, markersize=5)


def _draw_parts(axes: Axes, values: np.ndarray, alarmed: np.ndarray) -> None:
    for which, colour, size, label in (
        (~alarmed, ACCENT, 4, 'part'), (alarmed, ALARM, 8, 'part in alarm')
    ):  # fmt: skip
        axes.plot(
            np.flatnonzero(which), values[which], '.', color=colour, markersize=size, label=label,
            zorder=3,
        )  # fmt: skip


def _date_parts(axes: Axes, times_s: np.ndarray) -> None:
    """One place for each part, whatever the time between: nights take none."""

    def when(part: float, _: object) -> str:
        if not 0 <= part < len(times_s):
            return ''
        return datetime.fromtimestamp(times_s[round(part)], timezone.utc).strftime('%b %d\n%H:%M')

    axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    axes.xaxis.set_major_formatter(FuncFormatter(when))
    days = np.flatnonzero(np.diff(times_s // SECONDS_A_DAY))
    if len(days) < len(times_s) // 2:
        for other in axes.figure.axes:
            gaps = other.get_xaxis_transform()
            other.vlines(days + 0.5, 0.0, 1.0, BEFORE, lw=0.8, zorder=0, transform=gaps)
