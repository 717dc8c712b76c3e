"""A calibration, a model beside readings, and where to put the gauge."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.gridspec import GridSpec
from matplotlib.patheffects import Normal, Stroke

from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.inference.comparison.profiles import Profile
from paint_deposition.inference.diagnosis.reading_choice import ChosenReadings
from paint_deposition.inference.fitting.calibration import Calibration, PanelFit
from paint_deposition.report.data import ReportData
from paint_deposition.report.pictures.chart import MM, legend, new_figure, quiet, save_picture
from paint_deposition.report.pictures.part import PartPicture
from paint_deposition.report.style import (
    ACCENT,
    BEFORE,
    COMPONENTS,
    INK,
    MUTED,
    TWO_SIDED_95,
    charts_a_row,
)

LINE_POINTS = 600
PART_IN, BARS_IN, ROW_IN = 9.0, 4.3, 0.26
HALO = [Stroke(linewidth=2.4, foreground='white'), Normal()]
TEXT_PT = 8.0
# As many letters of a title fit over a chart; one that is longer is written smaller.
TITLE_LETTERS = 48
# A profile's charts, and the room around all of them and between [in].
CHARTS_IN, GAP_IN = (3.2, 2.4), (0.16, 0.6)
LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN = 0.6, 0.15, 0.5, 0.6


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


def write_comparison_picture(path: Path, data: ReportData) -> Path:
    """Write the film along each column or row, and the residual below it."""
    profiles = data.profiles
    columns = charts_a_row(len(profiles))
    rows = -(-len(profiles) // columns)
    width_in = LEFT_IN + columns * CHARTS_IN[0] + (columns - 1) * GAP_IN[0] + RIGHT_IN
    height_in = TOP_IN + rows * CHARTS_IN[1] + (rows - 1) * GAP_IN[1] + BOTTOM_IN
    figure = new_figure(width_in, height_in, layout=None)
    cells = figure.add_gridspec(
        rows, columns, left=LEFT_IN / width_in, right=1.0 - RIGHT_IN / width_in,
        bottom=BOTTOM_IN / height_in, top=1.0 - TOP_IN / height_in,
        wspace=GAP_IN[0] / CHARTS_IN[0], hspace=GAP_IN[1] / CHARTS_IN[1],
    )  # fmt: skip
    film, residual = None, None
    for k, profile in enumerate(profiles):
        place = cells[k // columns, k % columns]
        cell = place.subgridspec(2, 1, height_ratios=(3, 1), hspace=0.12)
        film = figure.add_subplot(cell[0], sharey=film)
        residual = figure.add_subplot(cell[1], sharex=film, sharey=residual)
        draw_profile(film, data, profile)
        draw_residual(residual, data, profile)
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


def draw_profile(axes: Axes, data: ReportData, profile: Profile) -> None:
    """Draw readings with the gauge's noise, and the models' film."""
    quiet(axes, f'{profile.axis} [mm]', 'film [µm]', size=TEXT_PT)
    of = f'{profile.experiment}, ' if len(data.experiments) > 1 else ''
    title = f'{of}{profile.label}:  {data.errors_in_words(profile.rows)}'
    title_pt = (TEXT_PT + 1.0) * min(1.0, TITLE_LETTERS / len(title))
    axes.set_title(title, loc='left', fontsize=title_pt, color=INK, y=1.0)
    at_mm, line_mm = MM * profile.position_m, MM * profile.line_m
    measured_um = data.study.measured_um[profile.rows]
    axes.errorbar(
        at_mm, measured_um, TWO_SIDED_95 * data.study.sigma_um[profile.rows], fmt='o', ms=3,
        color=INK, elinewidth=0.8, label='measured, bars: 95 % gauge and texture', zorder=5,
    )  # fmt: skip
    for k, (name, line) in enumerate(zip(data.model_names, data.lines, strict=True)):
        # The thin line lies over the bold one, so that both are seen where they agree.
        style: dict[str, Any] = {'color': line['color'], 'label': name, 'zorder': 3 - 0.1 * k}
        if len(line_mm):
            axes.plot(line_mm, profile.lines_um[k], lw=0.85 * line['width'], **style)
        else:
            filled = 'full' if k == len(data.models) - 1 else 'none'
            predicted_um = measured_um - data.residuals_um[k][profile.rows]
            axes.plot(at_mm, predicted_um, 'o', ms=4, fillstyle=filled, **style)
    for number, single in enumerate(profile.passes_um):
        label = '' if number else 'each pass alone'
        axes.plot(line_mm, single, ':', color=BEFORE, lw=1.0, label=label)
    axes.set_ylim(bottom=0.0, auto=None)  # Axes that share the scale may need more of it.


def draw_residual(axes: Axes, data: ReportData, profile: Profile) -> None:
    """Draw measured minus predicted, of the last model with the gauge's noise."""
    quiet(axes, f'{profile.axis} [mm]', 'residual [µm]', size=TEXT_PT)
    at_mm, last = MM * profile.position_m, len(data.models) - 1
    bars_um = TWO_SIDED_95 * data.study.sigma_um[profile.rows]
    for k, colour in enumerate(data.colours):
        axes.errorbar(
            at_mm, data.residuals_um[k][profile.rows],
            bars_um if k == last else np.zeros(len(at_mm)),
            fmt='o-', ms=2.5, lw=0.8, elinewidth=0.7, color=colour,
        )  # fmt: skip
    axes.axhline(0.0, color=MUTED, lw=0.8)


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
    scale, seen_um = film_scale(chosen.film_um), part.spread(chosen.film_um)
    room = 0.03 * (part.high_m - part.low_m).max()
    part.dress(axes, part.low_m - room, part.high_m + room)
    part.draw_pixels(axes, scale.rgba(seen_um, seen_um > NO_PAINT_UM))
    part.draw_contours(axes, chosen.film_um, scale.low, scale.high)
    places = part.view.flat(chosen.positions_m)
    twice = np.isin(np.arange(len(chosen)), chosen.read_twice)
    for which, marker, label in ((~twice, 'o', 'read once'), (twice, 's', 'read twice')):
        axes.plot(
            *places[which].T, marker, markersize=6, color='white', markeredgecolor=INK,
            linestyle='', label=label,
        )  # fmt: skip
    for name, place in zip(chosen.names, places, strict=True):
        axes.annotate(
            name.removeprefix('P').lstrip('0'), place, xytext=(4, 4), textcoords='offset points',
            fontsize=8.5, color=INK, path_effects=HALO,
        )  # fmt: skip
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
