"""Where to put the gauge: numbered points on the part over the film to expect."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.patheffects import Normal, Stroke

from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.inference.diagnosis.reading_choice import ChosenReadings
from paint_deposition.report.pictures.chart import legend, new_figure, quiet, save_picture
from paint_deposition.report.pictures.part import PartPicture
from paint_deposition.report.style import ACCENT, BEFORE, INK, MUTED

PART_IN, BARS_IN, ROW_IN = 9.0, 4.3, 0.26
HALO = [Stroke(linewidth=2.4, foreground='white'), Normal()]


def write_measuring_picture(path: str | Path, chosen: ChosenReadings) -> Path:
    """Write ``measuring_picture`` as PNG, SVG or PDF, by the suffix, in place of an older file."""
    return save_picture(measuring_picture(chosen), path)


def measuring_picture(chosen: ChosenReadings) -> Figure:
    """The part with its numbered points, and how surely each effect would be found."""
    part = PartPicture.of(chosen.surface)
    width, height = PART_IN * (part.high_m - part.low_m) / (part.high_m - part.low_m).max()
    rows = ROW_IN * len(chosen.power) + 1.2
    figure = new_figure(width + BARS_IN + 0.8, max(height + 1.2, rows, 4.0))
    grid = GridSpec(1, 2, figure, width_ratios=[width, BARS_IN])
    draw_points(figure.add_subplot(grid[0]), chosen, part)
    _draw_power(figure.add_subplot(grid[1]), chosen)
    return figure


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
