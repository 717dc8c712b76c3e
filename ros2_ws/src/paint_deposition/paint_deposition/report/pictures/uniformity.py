"""Pictures of evenness: sigma_n over the index, one pass and its parts, measured profiles."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from paint_deposition.model.collapse import Collapse, ThreeGaussianCollapse
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.report.pictures.chart import (
    BAND,
    COMPONENTS,
    INK,
    MARK,
    MEASURED,
    MODEL,
    MUTED,
    legend,
    new_figure,
    quiet,
    save_png,
)

MM = 1e3
PERCENT = 100.0
POINTS = 600


def write_uniformity(path: str | Path, recommendation: Recommendation) -> Path:
    """Draw a recommendation: sigma_n over the index, and the film at the recommended one."""
    figure = new_figure(11.0, 4.4)
    left, right = figure.subplots(1, 2, width_ratios=[1.15, 1.0])
    _draw_curve(left, recommendation)
    _draw_raster(right, recommendation)
    return save_png(figure, path)


def _draw_curve(axes: Axes, answer: Recommendation) -> None:
    quiet(axes, 'index [mm]', r'$\sigma_N$ [%]', 'Evenness over the index, eq. (5)')
    if answer.tolerance is not None:
        axes.axhline(PERCENT * answer.tolerance, color=MUTED, linewidth=0.9, linestyle='--')
        axes.annotate(
            f'tolerance {PERCENT * answer.tolerance:g} %',
            (1.0, PERCENT * answer.tolerance),
            xycoords=axes.get_yaxis_transform(), ha='right', va='bottom', fontsize=9, color=MUTED,
        )  # fmt: skip
        for low, high in answer.windows_m:
            axes.axvspan(MM * low, MM * high, color=BAND, linewidth=0.0, zorder=0)
    axes.plot(
        MM * answer.curve.index_m, PERCENT * answer.curve.sigma_n, color=MODEL, linewidth=1.8
    )
    for minimum in answer.minima:
        axes.plot(
            MM * minimum.index_m, PERCENT * minimum.sigma_n, 'o', markersize=5,
            markerfacecolor='white', markeredgecolor=MODEL, markeredgewidth=1.5,
        )  # fmt: skip
    axes.plot(MM * answer.index_m, PERCENT * answer.sigma_n, 'o', color=MARK, markersize=7)
    axes.set_xlim(MM * answer.index_range_m[0], MM * answer.index_range_m[1])
    top = PERCENT * float(answer.curve.sigma_n.max()) * 1.08
    axes.set_ylim(0.0, top)
    axes.annotate(
        f'{MM * answer.index_m:.0f} mm\n{PERCENT * answer.sigma_n:.2g} %',
        (MM * answer.index_m, PERCENT * answer.sigma_n),
        (MM * answer.index_m, PERCENT * answer.sigma_n + 0.2 * top),
        ha='center', va='bottom', color=MARK, fontsize=10, fontweight='bold',
        arrowprops={'arrowstyle': '-', 'color': MARK, 'linewidth': 0.9, 'shrinkB': 5},
    )  # fmt: skip


def _draw_raster(axes: Axes, answer: Recommendation) -> None:
    quiet(
        axes, 'across the passes [mm]', 'film [um]',
        f'Passes at {MM * answer.index_m:.0f} mm and {answer.speed_m_per_s:.3g} m/s, eq. (4)',
    )  # fmt: skip
    raster, index = answer.curve.raster, answer.index_m
    x = np.linspace(-1.5 * index, 1.5 * index, POINTS)
    for number in range(-4, 5):
        one = raster.second if number % 2 else raster.first
        film = one.thickness_um(x - number * index)
        if film.max() > 1e-3 * answer.mean_um:
            axes.plot(
                MM * x, film, color=MUTED, linewidth=1.0, alpha=0.8,
                label='single pass' if number == 0 else None,
            )  # fmt: skip
    total = raster.thickness_um(index, x)
    axes.plot(MM * x, total, color=MODEL, linewidth=1.8, label='sum of passes')
    axes.axhline(
        answer.mean_um, color=INK, linewidth=0.9, linestyle='--',
        label=f'mean {answer.mean_um:.1f} um',
    )  # fmt: skip
    axes.set_xlim(MM * x[0], MM * x[-1])
    axes.set_ylim(0.0, 1.25 * float(total.max()))
    legend(axes, loc='upper right', ncols=3)


def write_collapse(
    path: str | Path, fitted: ThreeGaussianCollapse, model: Collapse | None = None
) -> Path:
    """Draw eq. (3) with its three Gaussians, and the 2D model's own collapse if given."""
    figure = new_figure(6.4, 4.2)
    axes = figure.subplots()
    quiet(axes, 'across the pass [mm]', 'film [um]', 'One pass, eq. (3)')
    reach = 0.6 * fitted.reach_m
    x = np.linspace(-reach, reach, POINTS)
    names = (r'at $+r_1$', r'at $-r_2$', 'centred')
    for part, name, colour in zip(fitted.components_um(x), names, COMPONENTS, strict=True):
        axes.plot(MM * x, part, color=colour, linewidth=1.3, linestyle='--', label=name)
    axes.plot(MM * x, fitted.thickness_um(x), color=INK, linewidth=2.0, label='sum of the three')
    if model is not None:
        axes.plot(
            MM * x, model.thickness_um(x), color=MODEL, linewidth=1.6, label='2D model, collapsed'
        )
    axes.set_xlim(MM * x[0], MM * x[-1])
    axes.set_ylim(bottom=0.0)
    legend(axes, loc='upper right')
    return save_png(figure, path)


@dataclass(frozen=True)
class Profile:
    """Measured film across a panel, with what a model says.

    Attributes:
        title: of the panel.
        across_m: (P,) places of the points. measured_um, sigma_um: (P,).
        predicted_um: (P,) of the model at the points.
        passes_m: (n,) lines of the passes.
        line: (places (L,) [m], film (L,) [um]) of the model between the points, or None.
    """

    title: str
    across_m: np.ndarray
    measured_um: np.ndarray
    sigma_um: np.ndarray
    predicted_um: np.ndarray
    passes_m: np.ndarray
    line: tuple[np.ndarray, np.ndarray] | None = None


def write_profiles(path: str | Path, profiles: Sequence[Profile]) -> Path:
    """Draw panels above each other on one scale, residual figures in their titles."""
    figure = new_figure(8.0, 2.6 * len(profiles) + 0.4)
    rows = figure.subplots(len(profiles), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, profile in zip(rows, profiles, strict=True):
        residual = profile.measured_um - profile.predicted_um
        quiet(
            axes, '', 'film [um]',
            f'{profile.title}: mean {profile.measured_um.mean():.2f} um measured, '
            f'{profile.predicted_um.mean():.2f} predicted; residual SD {residual.std():.2f} um',
        )  # fmt: skip
        middle = profile.passes_m.mean()
        for line in profile.passes_m - middle:
            axes.axvline(MM * line, color=MUTED, linewidth=0.8, linestyle=':')
        if profile.line is None:
            order = np.argsort(profile.across_m)
            x, film = profile.across_m[order], profile.predicted_um[order]
        else:
            x, film = profile.line
        axes.plot(MM * (x - middle), film, color=MODEL, linewidth=1.8, label='model')
        axes.errorbar(
            MM * (profile.across_m - middle), profile.measured_um, profile.sigma_um,
            fmt='o', color=MEASURED, markersize=3.5, linewidth=0.8, label='measured',
        )  # fmt: skip
    rows[0].set_ylim(bottom=0.0)
    rows[-1].set_xlabel('across the passes [mm]; dotted: lines of the gun', color=MUTED)
    legend(rows[0], loc='lower center', ncols=2)
    return save_png(figure, path)
