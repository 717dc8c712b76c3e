"""A model beside readings, along columns and rows and over each part, and where to take them."""

from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.gridspec import GridSpec

from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.inference.comparison.comparison import compare
from paint_deposition.inference.comparison.profiles import Profile
from paint_deposition.inference.comparison.regions import interpolation_matrix
from paint_deposition.inference.design.reading_choice import ChosenReadings
from paint_deposition.inference.fitting.calibration import Calibration
from paint_deposition.report.colour_scales import (
    ACCENT,
    BEFORE,
    COMPONENTS,
    INK,
    MUTED,
    TWO_SIDED_95,
    film_scale,
    residual_scale,
)
from paint_deposition.report.data import ReportData
from paint_deposition.report.drawing import (
    HALO,
    MM,
    PAGE_IN,
    PALE_HALO,
    TEXT_PT,
    PartPicture,
    colour_bar,
    label_points,
    legend,
    new_figure,
    quiet,
    save_picture,
)
from paint_deposition.report.film_pictures import page_film

AnyFigure = TypeVar('AnyFigure', bound=FigureBase)
# A profile's two charts with the room around them [in].
PROFILE_IN = PAGE_IN, 3.0
# The longer side of a part with its points [in].
PART_IN = 9.0


def part_figures(data: ReportData, index: int) -> list[Figure]:
    """A part with the residuals of each model, and one with the film that the last one predicts.

    Readings are dots; the film has the passes and the numbered places to measure next.
    """
    experiment, part = data.experiments[index], PartPicture.of(data.experiments[index].surface)
    film_um, _ = data.painted[index][-1]
    title = f'film predicted, {data.model_names[-1]}'
    film, axes = page_film(part, film_um, experiment.path, title, film_scale(film_um))
    places = {
        str(number): part.view.flat(place.position_m)
        for number, place in enumerate(data.proposals[0], start=1)
        if place.experiment == experiment.name
    }
    if places:
        flat_m = np.array(list(places.values()))
        axes.plot(*flat_m.T, 'D', color='white', markeredgecolor=INK, markersize=6, zorder=5)
        per_m = 72.0 * PAGE_IN / np.ptp(axes.get_xlim())
        label_points(axes, flat_m, list(places), 0.7 * per_m, fontsize=10, color='white',
                     path_effects=HALO, zorder=6)  # fmt: skip
    return [*residual_figures(data, index, part), film]


def residual_figures(data: ReportData, index: int, part: PartPicture) -> list[Figure]:
    """A part with the residuals of each model, all on one scale; readings are dots."""
    experiment, rows = data.experiments[index], data.rows_of(index)
    surface, count = experiment.surface, len(experiment)
    points = experiment.points
    positions, normals = points.positions_m[:count], points.normals[:count]
    # Few readings beyond the end of the colours do not take the contrast from all others.
    largest = float(np.quantile(np.abs(np.concatenate(data.residuals_um)), 0.98))
    scale = residual_scale(largest)
    places = part.view.flat(positions)
    spreading, coloured = interpolation_matrix(surface, positions, normals)
    figures = []
    for name, residual_um in zip(data.model_names, data.residuals_um, strict=True):
        field = np.where(coloured, spreading @ residual_um[rows], np.nan)
        figure, axes = part.on_page(*part.window(), f'residual, {name}')
        part.draw(axes, scale.rgba(np.clip(field, -largest, largest), np.isfinite(field)))
        shown_um = np.clip(residual_um[rows], -largest, largest)
        colours = scale.rgba(shown_um, np.ones(count, dtype=bool)) / 255.0
        x, y = places.T
        axes.scatter(x, y, s=14, c=colours, edgecolors=INK, linewidths=0.6, zorder=4)
        colour_bar(figure, [axes], 'measured minus predicted [µm]', scale)
        figures.append(figure)
    return figures


def comparison_figure(data: ReportData) -> Figure:
    """The film along each column or row, and the residual below it."""
    # Two to four in a row, so that few places stay empty.
    count = len(data.profiles)
    columns = min((3, 4), key=lambda columns: -count % columns)
    if count < 5:
        columns = count if count < 4 else 2
    rows = -(-count // columns)
    heights_in = (0.4, rows * PROFILE_IN[1])
    figure = new_figure(columns * PROFILE_IN[0], sum(heights_in), None)
    above, below = figure.subfigures(2, 1, height_ratios=heights_in)
    places = below.subfigures(rows, columns, squeeze=False).ravel()
    for place, profile in zip(places, data.profiles, strict=False):
        _draw_profile(place, data, profile)
    handles, labels = places[0].axes[0].get_legend_handles_labels()
    above.legend(handles, labels, loc='upper left', ncols=len(labels), fontsize=9, frameon=False)
    return figure


def profile_figures(data: ReportData) -> tuple[list[Figure], list[tuple[str, str, str]]]:
    """A picture of each column or row; and words, colour and kind of mark of their legend."""
    drawn = [_draw_profile(new_figure(*PROFILE_IN, None), data, p) for p in data.profiles]
    kinds = ('bold' if line['width'] > 2.0 else 'line' for line in data.lines)
    models = zip(data.model_names, (line['color'] for line in data.lines), kinds, strict=True)
    measured = ('measured, bars: 95 % gauge and texture', INK, 'dot')
    return drawn, [measured, *models, ('each pass alone', BEFORE, 'dots')]


def _draw_profile(place: AnyFigure, data: ReportData, profile: Profile) -> AnyFigure:
    """Draw the film along a column or row, readings with the gauge's noise, and the residual."""
    room = {'left': 0.15, 'right': 0.98, 'bottom': 0.15, 'top': 0.92, 'hspace': 0.1}
    film, residual = place.subplots(2, 1, sharex=True, height_ratios=(3, 1), gridspec_kw=room)
    of = f'{profile.experiment}, ' if len(data.experiments) > 1 else ''
    errors = [f'{c.points.select(profile.rows).rmse_um:.2f}' for c in data.comparisons]
    title = f'{of}{profile.label}:  RMSE {" → ".join(errors)} µm'
    quiet(film, '', 'film [µm]', size=TEXT_PT)
    # As many letters of a title fit over a chart; one that is longer is written smaller.
    title_pt = (TEXT_PT + 1.0) * min(1.0, 41 / len(title))
    film.set_title(title, loc='left', fontsize=title_pt, color=INK, y=1.0)
    quiet(residual, f'{profile.axis} [mm]', 'residual [µm]', size=TEXT_PT)
    at_mm, line_mm = MM * profile.position_m, MM * profile.line_m
    all_bars_um = TWO_SIDED_95 * data.study.sigma_um
    measured_um, bars_um = data.study.measured_um[profile.rows], all_bars_um[profile.rows]
    film.errorbar(
        at_mm, measured_um, bars_um, fmt='o', ms=3, color=INK, elinewidth=0.8,
        label='measured, bars: 95 % gauge and texture', zorder=5,
    )  # fmt: skip
    for k, (name, line) in enumerate(zip(data.model_names, data.lines, strict=True)):
        last, residual_um = k == len(data.models) - 1, data.residuals_um[k][profile.rows]
        # The thin line lies over the bold one, so that both are seen where they agree.
        style: dict[str, Any] = {'color': line['color'], 'label': name, 'zorder': 3 - 0.1 * k}
        if len(line_mm):
            film.plot(line_mm, profile.lines_um[k], lw=0.85 * line['width'], **style)
        else:
            filled = 'full' if last else 'none'
            film.plot(at_mm, measured_um - residual_um, 'o', ms=4, fillstyle=filled, **style)
        # Of the last model with the gauge's noise.
        residual.errorbar(
            at_mm, residual_um, bars_um if last else np.zeros(len(at_mm)), fmt='o-', ms=2.5,
            lw=0.8, elinewidth=0.7, color=data.colours[k],
        )  # fmt: skip
    for number, single in enumerate(profile.passes_um):
        label = '' if number else 'each pass alone'
        film.plot(line_mm, single, ':', color=BEFORE, lw=1.0, label=label)
    residual.axhline(0.0, color=MUTED, lw=0.8)
    # On the scale of all.
    tops_um = [(data.study.measured_um + all_bars_um).max()]
    tops_um += [np.nanmax(one.lines_um) for one in data.profiles if one.lines_um.size]
    film.set_ylim(0.0, 1.05 * max(tops_um))
    reach_um = 1.05 * max((np.abs(one) + all_bars_um).max() for one in data.residuals_um)
    residual.set_ylim(-reach_um, reach_um)
    return place


def write_calibration_pictures(
    folder: str | Path, calibration: Calibration, suffix: str = 'png'
) -> list[Path]:
    """Write ``profiles.png``, ``agreement.png`` and, with a panel, ``collapse.png``."""
    folder, study = Path(folder), calibration.study
    data = ReportData(compare(study, calibration.model))
    written = [save_picture(comparison_figure(data), folder / f'profiles.{suffix}')]
    panels = [panel for panel in calibration.panels if panel is not None]
    if panels:
        # Eq. (3) of a panel with its three Gaussians, and the 2D model's own collapse.
        figure, (panel, fitted) = new_figure(6.4, 4.2), panels[0]
        axes = figure.subplots()
        quiet(axes, 'across the pass [mm]', 'film [µm]', 'One pass, eq. (3)')
        x = np.linspace(-0.6, 0.6, 600) * fitted.reach_m
        names = (r'at $+r_1$', r'at $-r_2$', 'centred')
        for part, name, colour in zip(fitted.components_um(x), names, COMPONENTS, strict=True):
            axes.plot(MM * x, part, color=colour, linewidth=1.3, linestyle='--', label=name)
        total_um = fitted.thickness_um(x)
        axes.plot(MM * x, total_um, color=INK, linewidth=2.0, label='sum of the three')
        own = sampled_collapse(
            calibration.model.painting_with(panel.brush), float(panel.speed_m_per_s[0]),
            standoff_m=panel.distance_m, travel_rad=panel.travel_rad,
        )  # fmt: skip
        own_um = own.thickness_um(x)
        axes.plot(MM * x, own_um, color=ACCENT, linewidth=1.6, label='2D model, collapsed')
        axes.set_xlim(MM * x[0], MM * x[-1])
        axes.set_ylim(bottom=0.0)
        legend(axes, loc='upper right')
        written.append(save_picture(figure, folder / f'collapse.{suffix}'))
    figure = new_figure(5.2, 5.0)
    predicted_um = calibration.fit.predicted_um
    draw_agreement(figure.subplots(), study.measured_um, predicted_um, study.sigma_um)
    return [*written, save_picture(figure, folder / f'agreement.{suffix}')]


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
    size_m = np.ptp(part.flat_m, axis=0)
    width, height = PART_IN * size_m / size_m.max()
    bars = 4.3, 0.26 * len(chosen.power) + 1.2
    figure = new_figure(width + bars[0] + 0.8, max(height + 1.2, bars[1], 4.0))
    grid = GridSpec(1, 2, figure, width_ratios=[width, bars[0]])
    draw_points(figure.add_subplot(grid[0]), chosen, part)
    # A bar an effect, and what a grid of as many points would give.
    axes, names = figure.add_subplot(grid[1]), sorted(chosen.power, key=chosen.power.__getitem__)
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
    return save_picture(figure, path)


def draw_points(axes: Axes, chosen: ChosenReadings, part: PartPicture) -> None:
    """Draw the part, its film and its points on axes of your own, seen from the gun's side."""
    scale = film_scale(chosen.film_um)
    part.view.dress(axes, *part.window())
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
    per_m = 72.0 * PART_IN / np.ptp(part.flat_m, axis=0).max()
    label_points(axes, places, names, per_m, fontsize=8.5, color=INK, path_effects=PALE_HALO)
    axes.set_title(
        f'{len(chosen)} points for the gauge; lines: expected film [µm]', loc='left', fontsize=12,
        color=INK, pad=24,
    )  # fmt: skip
    legend(axes, loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.1)
