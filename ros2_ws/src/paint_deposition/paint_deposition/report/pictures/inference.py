"""A calibration, and where to put the gauge."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.gridspec import GridSpec

from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.inference.design.reading_choice import ChosenReadings
from paint_deposition.inference.fitting.calibration import Calibration, PanelFit
from paint_deposition.report.pictures.part import PALE_HALO, PartPicture, label_points
from paint_deposition.report.style import (
    ACCENT,
    BEFORE,
    COMPONENTS,
    INK,
    MM,
    MUTED,
    legend,
    new_figure,
    quiet,
    save_picture,
)

LINE_POINTS = 600
PART_IN, BARS_IN, ROW_IN = 9.0, 4.3, 0.26


def write_calibration_pictures(
    folder: str | Path, calibration: Calibration, suffix: str = 'png'
) -> list[Path]:
    """Write what the campaign allows: ``collapse.png``, ``profiles.png``, ``agreement.png``."""
    folder = Path(folder)
    written = []
    panels = [(k, panel) for k, panel in enumerate(calibration.panels) if panel is not None]
    if panels:
        figure = new_figure(6.4, 4.2)
        draw_collapse(figure.subplots(), calibration, panels[0][1])
        written.append(save_picture(figure, folder / f'collapse.{suffix}'))
        figure = new_figure(8.0, 2.6 * len(panels) + 0.4)
        rows = figure.subplots(len(panels), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for axes, (number, panel) in zip(rows, panels, strict=True):
            draw_panel(axes, calibration, number, panel)
        for axes in rows[:-1]:
            axes.set_xlabel('')
        legend(rows[0], loc='lower center', ncols=2)
        written.append(save_picture(figure, folder / f'profiles.{suffix}'))
    figure = new_figure(5.2, 5.0)
    study, predicted_um = calibration.study, calibration.fit.predicted_um
    draw_agreement(figure.subplots(), study.measured_um, predicted_um, study.sigma_um)
    return [*written, save_picture(figure, folder / f'agreement.{suffix}')]


def draw_collapse(axes: Axes, calibration: Calibration, one: PanelFit) -> None:
    """Draw eq. (3) of a panel with its three Gaussians, and the 2D model's own collapse."""
    quiet(axes, 'across the pass [mm]', 'film [µm]', 'One pass, eq. (3)')
    fitted, panel = one.collapse.collapse, one.panel
    x = np.linspace(-0.6, 0.6, LINE_POINTS) * fitted.reach_m
    names = (r'at $+r_1$', r'at $-r_2$', 'centred')
    for part, name, colour in zip(fitted.components_um(x), names, COMPONENTS, strict=True):
        axes.plot(MM * x, part, color=colour, linewidth=1.3, linestyle='--', label=name)
    axes.plot(MM * x, fitted.thickness_um(x), color=INK, linewidth=2.0, label='sum of the three')
    own = sampled_collapse(
        calibration.model.painting_with(panel.brush),
        float(panel.speed_m_per_s[0]),
        standoff_m=panel.distance_m,
        travel_rad=panel.travel_rad,
    )
    axes.plot(
        MM * x, own.thickness_um(x), color=ACCENT, linewidth=1.6, label='2D model, collapsed'
    )
    axes.set_xlim(MM * x[0], MM * x[-1])
    axes.set_ylim(bottom=0.0)
    legend(axes, loc='upper right')


def draw_panel(axes: Axes, calibration: Calibration, number: int, one: PanelFit) -> None:
    """Draw the film across a panel, an experiment of this number, as measured and as predicted."""
    study, panel = calibration.study, one.panel
    rows = study.campaign.experiment_of == number
    measured, predicted = study.measured_um[rows], calibration.fit.predicted_um[rows]
    quiet(
        axes, 'across the passes [mm]; dotted: tool path', 'film [µm]',
        f'{study.campaign.experiments[number].name}: mean {measured.mean():.2f} µm measured, '
        f'{predicted.mean():.2f} µm predicted; SD of residual '
        f'{(measured - predicted).std():.2f} µm',
    )  # fmt: skip
    middle = panel.passes_m.mean()
    for line in panel.passes_m - middle:
        axes.axvline(MM * line, color=MUTED, linewidth=0.8, linestyle=':')
    across = np.linspace(panel.across_m.min(), panel.across_m.max(), LINE_POINTS)
    axes.plot(
        MM * (across - middle), panel.film_um(calibration.model, across), color=ACCENT,
        linewidth=1.8, label='model',
    )  # fmt: skip
    axes.errorbar(
        MM * (panel.across_m - middle), measured, study.sigma_um[rows],
        fmt='o', color=INK, markersize=3.5, linewidth=0.8, label='measured',
    )  # fmt: skip
    axes.set_ylim(bottom=0.0)


def draw_agreement(
    axes: Axes, measured_um: np.ndarray, predicted_um: np.ndarray, sigma_um: np.ndarray
) -> None:
    """Draw measured over predicted film, (P,) each with the gauge's standard deviation [um]."""
    quiet(axes, 'predicted [µm]', 'measured [µm]', 'All points')
    top = 1.08 * float(max(predicted_um.max(), measured_um.max()))
    axes.plot([0.0, top], [0.0, top], color=MUTED, linewidth=0.9, linestyle='--')
    axes.errorbar(
        predicted_um, measured_um, sigma_um, fmt='o', color=ACCENT, markersize=3.5, linewidth=0.8
    )
    axes.set_xlim(0.0, top)
    axes.set_ylim(0.0, top)
    axes.set_aspect('equal')


def write_measuring_picture(path: str | Path, chosen: ChosenReadings) -> Path:
    """Draw the part with its numbered points, and how surely each effect would be found."""
    part = PartPicture.of(chosen.surface)
    width, height = PART_IN * (part.high_m - part.low_m) / (part.high_m - part.low_m).max()
    rows = ROW_IN * len(chosen.power) + 1.2
    figure = new_figure(width + BARS_IN + 0.8, max(height + 1.2, rows, 4.0))
    grid = GridSpec(1, 2, figure, width_ratios=[width, BARS_IN])
    draw_points(figure.add_subplot(grid[0]), chosen, part)
    _draw_power(figure.add_subplot(grid[1]), chosen)
    return save_picture(figure, path)


def draw_points(axes: Axes, chosen: ChosenReadings, part: PartPicture | None = None) -> None:
    """Draw the part, its film and its points on axes of your own, seen from the gun's side."""
    part = part or PartPicture.of(chosen.surface)
    scale = film_scale(chosen.film_um)
    room = 0.03 * (part.high_m - part.low_m).max()
    part.dress(axes, part.low_m - room, part.high_m + room)
    part.draw(axes, scale.rgba(chosen.film_um, chosen.film_um > NO_PAINT_UM))
    part.draw_contours(axes, chosen.film_um, scale.low, scale.high)
    places = part.view.flat(chosen.positions_m)
    twice = np.isin(np.arange(len(chosen)), chosen.read_twice)
    for which, marker, label in ((~twice, 'o', 'read once'), (twice, 's', 'read twice')):
        axes.plot(
            *places[which].T, marker, markersize=6, color='white', markeredgecolor=INK,
            linestyle='', label=label,
        )  # fmt: skip
    names = [name.removeprefix('P').lstrip('0') for name in chosen.names]
    per_m = 72.0 * PART_IN / (part.high_m - part.low_m).max()
    label_points(axes, places, names, per_m, fontsize=8.5, color=INK, path_effects=PALE_HALO)
    axes.set_title(
        f'{len(chosen)} points for the gauge; lines: expected film [µm]', loc='left', fontsize=12,
        color=INK, pad=24,
    )  # fmt: skip
    legend(axes, loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.1)


def _draw_power(axes: Axes, chosen: ChosenReadings) -> None:
    """A bar an effect, and what a grid of as many points would give."""
    names = sorted(chosen.power, key=lambda name: chosen.power[name])
    quiet(axes, 'probability of detection at the typical size [%]', '', size=9.0)
    rows = np.arange(len(names))
    axes.barh(rows, [100 * chosen.power[n] for n in names], 0.6, color=ACCENT, label='these')
    axes.plot(
        [100 * chosen.grid_power[n] for n in names], rows, '|', color=INK, markersize=11,
        markeredgewidth=2, label=f'{len(chosen)} on a grid',
    )  # fmt: skip
    axes.axvline(5.0, color=BEFORE, linewidth=0.9, linestyle='--')
    axes.set_yticks(rows, names, fontsize=8.5, color=MUTED)
    axes.set(xlim=(0, 101), ylim=(-0.7, len(names) - 0.3))
    legend(axes, loc='lower right')
