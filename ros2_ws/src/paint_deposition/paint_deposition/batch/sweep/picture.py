"""The results of a sweep over each thing that varied."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from paint_deposition.batch.sweep.variations import DRAW
from paint_deposition.report.pictures.chart import new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, INK

# Values that are few enough for a line through their medians.
FEW_VALUES = 12
MOST_COLUMNS = 6
# Narrowest range of a chart, as a share of its values.
LEAST_SPAN = 0.01


def write_sweep_picture(
    path: Path, varied: Mapping[str, np.ndarray], results: Mapping[str, np.ndarray], title: str
) -> Path:
    """Draw each result (a row of charts) over each number that varied (a column).

    Args:
        path: PNG, SVG or PDF.
        varied: (n,) of the cases by name: numbers, NaN is left out, or texts.
        results: (n,) of the cases by label; NaN is left out.
        title: above all.
    """
    names = list(varied)[:MOST_COLUMNS]
    figure = new_figure(max(5.5, 3.4 * len(names)), 2.9 * len(results) + 0.4)
    charts = figure.subplots(len(results), len(names), squeeze=False, sharex='col', sharey='row')
    for axes, name in zip(charts[-1], names, strict=True):
        axes.set_xlabel(name)
    for row, (label, result) in zip(charts, results.items(), strict=True):
        for axes, name in zip(row, names, strict=True):
            quiet(axes, axes.get_xlabel(), label if axes is row[0] else '')
            _draw(axes, varied[name], result, in_order=name != DRAW)
    figure.suptitle(title, x=0.01, ha='left', fontsize=11, color=INK)
    return save_picture(figure, path)


def _draw(axes: Axes, values: np.ndarray, result: np.ndarray, in_order: bool) -> None:
    is_text = values.dtype.kind == 'U'
    there = np.isfinite(result) & (True if is_text else np.isfinite(values))
    if not there.any():
        return
    values, result = values[there], result[there]
    axes.scatter(values, result, s=14, color=ACCENT, alpha=0.55, linewidths=0)
    places = np.unique(values)
    if in_order and not is_text and 1 < len(places) <= FEW_VALUES and len(values) > len(places):
        medians = [np.median(result[values == place]) for place in places]
        axes.plot(places, medians, color=ACCENT, linewidth=1.4)
    # Rounding alone is no result: the chart does not magnify it.
    middle, span = np.median(result), LEAST_SPAN * np.abs(np.median(result))
    if np.ptp(result) < span:
        axes.set_ylim(middle - span, middle + span)
