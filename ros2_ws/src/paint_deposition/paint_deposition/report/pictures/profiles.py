"""Profiles by column, measured, before and after, as a picture for paper and web."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from paint_deposition.comparison.comparison import Comparison
from paint_deposition.comparison.profiles import Profile
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.atomic import replacing
from paint_deposition.fitting.study import Study
from paint_deposition.report.page.data import ReportData
from paint_deposition.report.page.profiles import charts_a_row, errors_in_words
from paint_deposition.report.page.style import ACCENT, BEFORE, GRID, INK, MUTED, TWO_SIDED_95

DOTS_PER_INCH = 150


def write_comparison_picture(
    path: str | Path, study: Study, models: Sequence[tuple[DepositionModel, Comparison]]
) -> None:
    """Write the film along each column or row, and the residual below it, as PNG.

    Args:
        path: where to; replaced whole or not at all.
        study: the readings.
        models: with their comparisons, base first, best last.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    data = ReportData.of(study, models)
    profiles = data.profiles
    columns = charts_a_row(len(profiles))
    rows = -(-len(profiles) // columns)
    figure = Figure(figsize=(3.4 * columns + 0.4, 2.9 * rows + 0.9), dpi=DOTS_PER_INCH)
    FigureCanvasAgg(figure)
    cells = figure.add_gridspec(
        rows, columns, hspace=0.42, wspace=0.16, left=0.62 / figure.get_figwidth(), right=0.99,
        bottom=0.5 / figure.get_figheight(), top=1.0 - 0.85 / figure.get_figheight(),
    )  # fmt: skip
    film_axes, residual_axes = [], []
    for k, profile in enumerate(profiles):
        cell = cells[k // columns, k % columns].subgridspec(2, 1, height_ratios=(3, 1), hspace=0.1)
        film = figure.add_subplot(cell[0], sharey=film_axes[0] if film_axes else None)
        residual = figure.add_subplot(
            cell[1], sharex=film, sharey=residual_axes[0] if residual_axes else None
        )
        film_axes.append(film)
        residual_axes.append(residual)
        _draw_film(film, data, profile)
        _draw_residual(residual, data, profile)
        for axes, title in ((film, 'film [µm]'), (residual, 'residual')):
            axes.tick_params(labelleft=k % columns == 0)
            axes.set_ylabel(title if k % columns == 0 else '', color=MUTED, fontsize=8)
        name = f'{profile.experiment}, ' if len(data.experiments) > 1 else ''
        film.set_title(
            f'{name}{profile.label}:  {errors_in_words(data, profile.rows)}', fontsize=8.5,
            loc='left', color=INK,
        )  # fmt: skip
    film_axes[0].set_ylim(bottom=0.0)
    handles, labels = film_axes[0].get_legend_handles_labels()
    ranked = sorted(zip(labels, handles, strict=True), key=lambda item: _rank(item[0]))
    labels, handles = (list(part) for part in zip(*ranked, strict=True))
    figure.legend(
        handles, labels, loc='upper left', ncols=len(labels), fontsize=9, frameon=False,
        bbox_to_anchor=(0.02, 1.0),
    )  # fmt: skip
    with replacing(path) as temporary:
        figure.savefig(temporary, format='png', facecolor='white')


def _rank(label: str) -> int:
    """Measured first, then the models in their order, single passes last."""
    starts = ('measured', 'model before', 'model', 'each')
    return next(k for k, start in enumerate(starts) if label.startswith(start))


def _draw_film(axes, data: ReportData, profile: Profile) -> None:
    line_mm, at_mm = 1e3 * profile.line_m, 1e3 * profile.position_m
    measured = data.study.measured_um[profile.rows]
    for number, single in enumerate(profile.passes_um):
        label = None if number else 'each pass alone'
        axes.plot(line_mm, single, ':', color=BEFORE, lw=1.0, label=label)
    for k in reversed(range(len(data.models))):
        last = k == len(data.models) - 1
        label = 'model' if not data.improved else 'model after' if last else 'model before'
        colour = ACCENT if last else INK
        if len(line_mm):
            axes.plot(line_mm, profile.lines_um[k], color=colour, lw=3 if last else 1, label=label)
        else:
            predicted = measured - data.residuals_um[k][profile.rows]
            face = ACCENT if last else 'none'
            axes.plot(at_mm, predicted, 'o', ms=4, mfc=face, mec=colour, label=label)
    axes.errorbar(
        at_mm, measured, TWO_SIDED_95 * data.study.sigma_um[profile.rows], fmt='o', ms=3,
        color=INK, elinewidth=0.8, label='measured, bars: 95 % gauge noise', zorder=5,
    )  # fmt: skip
    _style(axes)
    axes.tick_params(labelbottom=False)


def _draw_residual(axes, data: ReportData, profile: Profile) -> None:
    at_mm = 1e3 * profile.position_m
    for k, residual in enumerate(data.residuals_um):
        last = k == len(data.models) - 1
        bars = TWO_SIDED_95 * data.study.sigma_um[profile.rows] if last else np.zeros(len(at_mm))
        axes.errorbar(
            at_mm, residual[profile.rows], bars, fmt='o-', ms=2.5, lw=0.8, elinewidth=0.7,
            color=ACCENT if last else BEFORE,
        )  # fmt: skip
    axes.axhline(0.0, color=MUTED, lw=0.8)
    axes.set_xlabel(f'{profile.axis} [mm]', color=MUTED, fontsize=8)
    _style(axes)


def _style(axes) -> None:
    axes.grid(color=GRID, lw=0.7)
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)
    axes.spines[['left', 'bottom']].set_color(BEFORE)
    axes.tick_params(labelsize=7.5, colors=MUTED)
