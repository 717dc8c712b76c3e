"""Pictures of a recommended index: sigma_n over the index, and the film of the passes."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.report.pictures.chart import MM, legend, new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, INK, MUTED

PERCENT = 100.0
POINTS = 600
CHOSEN = '#c0392b'
WITHIN_TOLERANCE = '#d9ecf0'


def write_uniformity(path: str | Path, recommendation: Recommendation) -> Path:
    """Draw a recommendation: sigma_n over the index, and the film at the recommended one."""
    figure = new_figure(11.0, 4.4)
    left, right = figure.subplots(1, 2, width_ratios=[1.15, 1.0])
    draw_curve(left, recommendation)
    draw_passes(right, recommendation)
    return save_picture(figure, path)


def draw_curve(axes: Axes, answer: Recommendation) -> None:
    """Draw sigma_n over the index with its minima, the tolerance and the recommended index."""
    quiet(axes, 'index [mm]', r'$\sigma_N$ [%]', 'Evenness over the index, eq. (5)')
    top = 1.08 * PERCENT * float(answer.curve.sigma_n.max())
    if answer.tolerance is not None:
        tolerance = PERCENT * answer.tolerance
        if tolerance < top:
            axes.axhline(tolerance, color=MUTED, linewidth=0.9, linestyle='--')
            axes.annotate(
                f'tolerance {tolerance:g} %', (1.0, tolerance),
                xycoords=axes.get_yaxis_transform(), ha='right', va='bottom', fontsize=9,
                color=MUTED,
            )  # fmt: skip
        for low, high in answer.windows_m:
            axes.axvspan(MM * low, MM * high, color=WITHIN_TOLERANCE, linewidth=0.0, zorder=0)
    axes.plot(
        MM * answer.curve.index_m, PERCENT * answer.curve.sigma_n, color=ACCENT, linewidth=1.8
    )
    for minimum in answer.minima:
        axes.plot(
            MM * minimum.index_m, PERCENT * minimum.sigma_n, 'o', markersize=5,
            markerfacecolor='white', markeredgecolor=ACCENT, markeredgewidth=1.5,
        )  # fmt: skip
    chosen = MM * answer.index_m, PERCENT * answer.sigma_n
    axes.plot(*chosen, 'o', color=CHOSEN, markersize=7)
    axes.annotate(
        f'{chosen[0]:.0f} mm\n{chosen[1]:.2g} %', chosen, (chosen[0], chosen[1] + 0.2 * top),
        ha='center', va='bottom', color=CHOSEN, fontsize=10, fontweight='bold',
        arrowprops={'arrowstyle': '-', 'color': CHOSEN, 'linewidth': 0.9, 'shrinkB': 5},
    )  # fmt: skip
    axes.set_xlim(MM * answer.index_range_m[0], MM * answer.index_range_m[1])
    axes.set_ylim(0.0, top)


def draw_passes(axes: Axes, answer: Recommendation) -> None:
    """Draw the film of passes at the recommended index, each alone and all together."""
    quiet(
        axes, 'across the passes [mm]', 'film [µm]',
        f'Passes at {MM * answer.index_m:.0f} mm and {answer.speed_m_per_s:.3g} m/s, eq. (4)',
    )  # fmt: skip
    parallel, index = answer.curve.parallel, answer.index_m
    x = np.linspace(-1.5 * index, 1.5 * index, POINTS)
    for number in range(-4, 5):
        one = parallel.second if number % 2 else parallel.first
        film = one.thickness_um(x - number * index)
        if film.max() > 1e-3 * answer.mean_um:
            axes.plot(
                MM * x, film, color=MUTED, linewidth=1.0, alpha=0.8,
                label='single pass' if number == 0 else None,
            )  # fmt: skip
    total = parallel.thickness_um(index, x)
    axes.plot(MM * x, total, color=ACCENT, linewidth=1.8, label='sum of passes')
    axes.axhline(
        answer.mean_um, color=INK, linewidth=0.9, linestyle='--',
        label=f'mean {answer.mean_um:.1f} µm',
    )  # fmt: skip
    axes.set_xlim(MM * x[0], MM * x[-1])
    axes.set_ylim(0.0, 1.25 * float(total.max()))
    legend(axes, loc='upper right', ncols=3)
