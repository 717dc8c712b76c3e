"""Profiles by column, measured, before and after, as a picture for paper and web."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from paint_deposition.report.pictures.chart import MM, new_figure, quiet, save_picture
from paint_deposition.report.profile_charts import ProfileChart
from paint_deposition.report.style import BEFORE, INK, MUTED, charts_a_row

TEXT_PT = 8.0
# As many letters of a title fit over a chart; one that is longer is written smaller.
TITLE_LETTERS = 48
# A profile's charts, and the room around all of them and between [in].
CHARTS_IN, GAP_IN = (3.2, 2.4), (0.16, 0.6)
LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN = 0.6, 0.15, 0.5, 0.6


def write_comparison_picture(path: str | Path, charts: Sequence[ProfileChart]) -> Path:
    """Write the film along each column or row, and the residual below it, as PNG."""
    columns = charts_a_row(len(charts))
    rows = -(-len(charts) // columns)
    width_in = LEFT_IN + columns * CHARTS_IN[0] + (columns - 1) * GAP_IN[0] + RIGHT_IN
    height_in = TOP_IN + rows * CHARTS_IN[1] + (rows - 1) * GAP_IN[1] + BOTTOM_IN
    figure = new_figure(width_in, height_in, layout=None)
    cells = figure.add_gridspec(
        rows, columns, left=LEFT_IN / width_in, right=1.0 - RIGHT_IN / width_in,
        bottom=BOTTOM_IN / height_in, top=1.0 - TOP_IN / height_in,
        wspace=GAP_IN[0] / CHARTS_IN[0], hspace=GAP_IN[1] / CHARTS_IN[1],
    )  # fmt: skip
    film, residual = None, None
    for k, chart in enumerate(charts):
        place = cells[k // columns, k % columns]
        cell = place.subgridspec(2, 1, height_ratios=(3, 1), hspace=0.12)
        film = figure.add_subplot(cell[0], sharey=film)
        residual = figure.add_subplot(cell[1], sharex=film, sharey=residual)
        draw_profile(film, chart)
        draw_residual(residual, chart)
        film.set_xlabel('')
        film.tick_params(labelbottom=False)
        if k % columns:
            for axes in (film, residual):
                axes.set_ylabel('')
                axes.tick_params(labelleft=False)
    if film is not None:
        film.set_ylim(bottom=0.0)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='upper left', ncols=len(labels), fontsize=9, frameon=False)
    return save_picture(figure, path)


def draw_profile(axes: Axes, chart: ProfileChart) -> None:
    """Draw readings with the gauge's noise, and the models' film."""
    quiet(axes, f'{chart.axis} [mm]', 'film [µm]', size=TEXT_PT)
    title_pt = (TEXT_PT + 1.0) * min(1.0, TITLE_LETTERS / len(chart.title))
    axes.set_title(chart.title, loc='left', fontsize=title_pt, color=INK, y=1.0)
    at_mm, line_mm = MM * chart.position_m, MM * chart.line_m
    axes.errorbar(
        at_mm, chart.measured_um, chart.bars_um, fmt='o', ms=3, color=INK, elinewidth=0.8,
        label='measured, bars: 95 % gauge and texture', zorder=5,
    )  # fmt: skip
    for k, model in enumerate(chart.models):
        # The thin line lies over the bold one, so that both are seen where they agree.
        style: dict[str, Any] = {
            'color': model.colour, 'label': model.name, 'zorder': 3 - 0.1 * k,
        }  # fmt: skip
        if len(line_mm):
            axes.plot(line_mm, model.film_um, lw=0.85 * model.width, **style)
        else:
            filled = 'full' if model is chart.models[-1] else 'none'
            axes.plot(at_mm, model.film_um, 'o', ms=4, fillstyle=filled, **style)
    for number, single in enumerate(chart.passes_um):
        label = '' if number else 'each pass alone'
        axes.plot(line_mm, single, ':', color=BEFORE, lw=1.0, label=label)
    axes.set_ylim(bottom=0.0, auto=None)  # Axes that share the scale may need more of it.


def draw_residual(axes: Axes, chart: ProfileChart) -> None:
    """Draw measured minus predicted, of the last model with the gauge's noise."""
    quiet(axes, f'{chart.axis} [mm]', 'residual [µm]', size=TEXT_PT)
    at_mm = MM * chart.position_m
    for model in chart.models:
        last = model is chart.models[-1]
        axes.errorbar(
            at_mm, model.residual_um, chart.bars_um if last else np.zeros(len(at_mm)),
            fmt='o-', ms=2.5, lw=0.8, elinewidth=0.7, color=model.residual_colour,
        )  # fmt: skip
    axes.axhline(0.0, color=MUTED, lw=0.8)
