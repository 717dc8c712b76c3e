"""The painted part with the gun's way over it, the target band, and the figures of its film."""

import math
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.markers import MarkerStyle
from matplotlib.patches import Patch
from matplotlib.transforms import Affine2D

from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.film.statistics import CPK_MEANS, FilmStatistics, wanted_at
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.report.colour_scales import (
    BARE,
    BELOW,
    GRID,
    HIGH,
    INK,
    MUTED,
    WITHIN,
    ColourScale,
    film_scale,
)
from paint_deposition.report.drawing import (
    HALO,
    PartPicture,
    View,
    colour_bar,
    new_figure,
    quiet,
)


def film_picture(
    surface: Surface,
    film_um: np.ndarray,
    spray: SprayPath,
    statistics: FilmStatistics,
    title: str,
    subtitle: str,
    zones: Zones | None = None,
) -> Figure:
    """A painted part with the figures of its film (V,) [um].

    With a target the part is drawn twice: too thin, right and too thick first, each zone by its
    own target, then the film.
    """
    part = PartPicture.of(surface)
    low, high = part.window(spray)
    # The part's share of the picture, the column beside it, and the room around both [in].
    width, height = (high - low) * min(7.6 / (high - low))
    beside, around = 3.1, 1.0
    rows = 1 if math.isnan(statistics.within_target) else 2
    figure = new_figure(width + beside + around, rows * (max(height, 3.4) + around))
    grid = figure.add_gridspec(rows, 2, width_ratios=[width, beside])
    axes = [figure.add_subplot(grid[row, 0]) for row in range(rows)]
    scale = draw_film(axes[-1], part, film_um, spray, statistics.painted_above_um)
    bar = colour_bar(figure, axes[-1:], 'film [µm]', scale, aspect=25, pad=0.02)
    bar.ax.tick_params(colors=MUTED, labelsize=9)
    s, figures = statistics, figure.add_subplot(grid[rows - 1, 1])
    figures.set_axis_off()
    if np.any(film_um <= s.painted_above_um):
        _draw_patches(figures, [(BARE, f'up to {s.painted_above_um:g} µm')])
    _write(
        figures,
        f'mean {s.mean_um:.1f} µm, standard deviation {s.std_dev_um:.1f} µm\n'
        f'{s.min_um:.1f} to {s.max_um:.1f} µm\n'
        f'painted {100 * s.coverage:.1f} % of {s.area_m2:.2f} m²\n'
        f'{s.painted_volume_cm3:.1f} of {s.emitted_volume_cm3:.1f} cm³ on the part',
    )
    if rows == 2:
        _draw_band(axes[0], part, film_um, spray, statistics, zones)
        _draw_band_legend(figure, grid[0, 1], surface, film_um, statistics, zones)
    figure.suptitle(f'{title}, seen from the gun', x=0.02, ha='left', fontsize=13, color=INK)
    axes[0].set_title(fill(subtitle, 110), loc='left', fontsize=9, color=MUTED)
    return figure


def page_film(
    part: PartPicture,
    film_um: np.ndarray,
    spray: SprayPath,
    title: str,
    scale: ColourScale,
    corners: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[Figure, Axes]:
    """A painted part as wide as a page has room for, with its bar of colours, and its axes.

    The picture is of the part with its passes, or up to ``corners`` [m].
    """
    low, high = corners or part.window(spray)
    figure, axes = part.on_page(low, high, title)
    part.draw(axes, scale.rgba(film_um, film_um > NO_PAINT_UM))
    draw_tool_path(axes, spray, part.view, low, high)
    colour_bar(figure, [axes], 'film [µm]', scale)
    return figure, axes


def draw_film(
    axes: Axes,
    part: PartPicture,
    film_um: np.ndarray,
    spray: SprayPath,
    painted_above_um: float,
) -> ColourScale:
    """Draw a painted part on axes of your own, seen from the gun's side.

    The colours, whose scale is returned, are the film (V,) [um] and relief is shown by lines
    alone; up to ``painted_above_um`` it is shown as bare metal.
    """
    scale = film_scale(film_um)
    low, high = part.window(spray)
    part.view.dress(axes, low, high)
    part.draw(axes, scale.rgba(film_um, film_um > painted_above_um))
    part.draw_contours(axes, film_um, scale.low, scale.high)
    draw_tool_path(axes, spray, part.view, low, high)
    return scale


def _draw_band(
    axes: Axes,
    part: PartPicture,
    film_um: np.ndarray,
    spray: SprayPath,
    s: FilmStatistics,
    zones: Zones | None,
) -> None:
    low, high = part.window(spray)
    part.view.dress(axes, low, high)
    shares = part.zone_shares(zones) if zones else {}
    # The first lies below all others, so that no gap is left between smoothed borders.
    for below, number in enumerate(sorted(shares) or [-1]):
        zone = zones.zones[number].name if zones and number >= 0 else ''
        wanted = s.zones[zone] if zone else s
        ends, colours = [s.painted_above_um], [BARE]
        for end, colour in zip(wanted.band_um, (BELOW, WITHIN), strict=True):
            if end > ends[-1]:
                ends.append(end)
                colours.append(colour)
        colours.append(HIGH if wanted.target_um else GRID)
        least, most = min(film_um.min(), ends[0]) - 1.0, max(film_um.max(), ends[-1]) + 1.0
        levels = [least, *ends, most]
        bands = axes.tricontourf(part.triangles(), film_um, levels, colors=colours)
        if below:
            outline = axes.tricontourf(part.triangles(), shares[number], [0.5, 2.0], alpha=0.0)
            bands.set_clip_path(outline.get_paths()[0], axes.transData)
        part.draw_edges(axes)
    part.draw_zones(axes, zones, spray)
    draw_tool_path(axes, spray, part.view, low, high)


def _draw_band_legend(
    figure: Figure,
    place: SubplotSpec,
    surface: Surface,
    film_um: np.ndarray,
    s: FilmStatistics,
    zones: Zones | None,
) -> None:
    """Shares, histogram, and Cpk or the figures of the zones."""
    low, high = s.band_um
    column = place.subgridspec(3, 1, height_ratios=[1.3, 1.2, 0.6 + 0.2 * len(s.zones)])
    shares = figure.add_subplot(column[0])
    limits = ('its limit',) * 2 if s.zones else (f'{low:g} µm', f'{high:g} µm')
    entries = [
        (HIGH, f'{100 * s.above_target:.1f} % high, above {limits[1]}'),
        (WITHIN, f'{100 * s.within_target:.1f} % in the band'),
        (BELOW, f'{100 * s.below_target:.1f} % low, below {limits[0]}'),
    ] + [(BARE, f'bare, up to {s.painted_above_um:g} µm')] * (s.coverage < 1.0)
    if zones and not s.target_um and (zones.number < 0).any():
        entries.append((GRID, 'no target'))
    title = (
        f'target {s.target_um:g} ± {s.target_tolerance_um:g} µm\n'
        f'of the painted {100 * s.coverage:.1f} % of {s.area_m2:.2f} m²'
    )
    if s.zones:
        title = 'each zone by its own target,\nof the painted area with a target'
    _draw_patches(shares, entries, title)
    # Area over film, of zones in tolerances from their targets, with the band behind it.
    painted, shown, middle, axis = film_um > s.painted_above_um, film_um, s.target_um, 'film [µm]'
    if zones:
        target, tolerance = wanted_at(film_um, s.target_um, s.target_tolerance_um, zones)
        painted &= tolerance > 0.0
        shown = np.divide(film_um - target, tolerance, where=painted, out=np.zeros(len(film_um)))
        (low, high), middle, axis = (-1.0, 1.0), 0.0, '(film − target) / tolerance'
    film, area = shown[painted], surface.vertex_areas_m2[painted]
    chart = figure.add_subplot(column[1])
    quiet(chart, axis, '', size=8.0)
    chart.set_title('% of the painted area', loc='left', fontsize=8, color=MUTED)
    chart.axvspan(low, high, color=WITHIN, alpha=0.35, linewidth=0.0)
    if len(film):
        chart.hist(film, 40, weights=100.0 * area / area.sum(), color=INK, alpha=0.75)
    for limit in (low, middle, high):
        chart.axvline(limit, color=MUTED, linewidth=0.9, linestyle='--')
    below = figure.add_subplot(column[2])
    below.set_axis_off()
    text = f'Cpk {s.cpk:.2f}\n{fill(CPK_MEANS, 40)}'.replace('-', '−')
    of_zones = [
        f'{name}: {zone.target_um:g} ± {zone.target_tolerance_um:g} µm\n'
        f'    mean {zone.mean_um:.1f} µm, {100 * zone.within_target:.1f} % in the band'
        for name, zone in s.zones.items()
    ]
    _write(below, '\n'.join(of_zones) or text, 8.0)


def _draw_patches(axes: Axes, entries: list[tuple[str, str]], title: str = '') -> None:
    """A coloured patch with a label in each line, and nothing else."""
    axes.set_axis_off()
    axes.legend(
        handles=[Patch(color=colour, label=label) for colour, label in entries],
        loc='upper left', frameon=False, fontsize=9.5, labelcolor=INK, title=title,
        alignment='left', handlelength=1.2, handleheight=1.0, borderpad=0.0,
    )  # fmt: skip


def _write(axes: Axes, text: str, size: float = 9.5) -> None:
    axes.text(
        0.0, 0.0, text, transform=axes.transAxes, va='bottom', fontsize=size, color=INK,
        linespacing=1.6,
    )  # fmt: skip


def draw_tool_path(
    axes: Axes, spray: SprayPath, view: View, low: np.ndarray, high: np.ndarray
) -> None:
    """Draw passes as lines with number and arrows, the way between them dashed, within corners."""
    on = spray.flow > 0.0
    apart_s = np.diff(spray.stamp_ns) * 1e-9 - 0.5 * (spray.dwell_s[1:] + spray.dwell_s[:-1])
    # Coats follow each other in one path: their clocks begin anew.
    breaks = 1 + np.flatnonzero(
        (on[1:] != on[:-1]) | (np.diff(spray.spray_pass) != 0) | (np.abs(apart_s) > 1e-3)
    )
    drawn: set[int] = set()
    for rows in np.split(np.arange(len(spray)), breaks):
        line = view.flat(spray.position_m[rows])
        if not on[rows].any():
            axes.plot(*line.T, color='#3a4048', linewidth=0.9, linestyle=(0, (3, 3)), alpha=0.8)
            continue
        number = int(spray.spray_pass[rows[0]]) + 1
        axes.plot(*line.T, color='white', linewidth=1.7, path_effects=HALO)
        room = 0.02 * (high - low).max()
        shown = line[np.all((line > low + room) & (line < high - room), axis=1)]
        if len(shown) < 2:
            continue
        # Arrow heads along the pass, in its direction.
        along = np.cumsum(np.linalg.norm(np.diff(shown, axis=0), axis=1))
        count = max(1, round(along[-1] / ((high - low).max() / 3.0)))
        for middle in along[-1] * (np.arange(count) + 0.5) / count:
            row = 1 + int(np.searchsorted(along, middle))
            right, up = shown[row] - shown[row - 1]
            turn = Affine2D().rotate(float(np.arctan2(up, right)) - 0.5 * np.pi)
            axes.plot(
                *shown[row], marker=MarkerStyle('^', transform=turn), markersize=9,
                markerfacecolor='white', markeredgecolor=INK, markeredgewidth=0.9,
            )  # fmt: skip
        if number not in drawn:
            drawn.add(number)
            axes.annotate(
                str(number), shown[0], fontsize=8.5, color='white', ha='center', va='center',
                bbox={'boxstyle': 'circle,pad=0.25', 'facecolor': INK, 'edgecolor': 'white'},
            )  # fmt: skip
