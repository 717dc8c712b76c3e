"""A recommended index, the gun over its part, a programme before and after, places of the part."""

import math
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface
from paint_deposition.planning.improvement import Improvement
from paint_deposition.planning.part_places import PartPlaces
from paint_deposition.planning.programme import STANDING_M
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.report.colour_scales import (
    ACCENT,
    BEFORE,
    GRID,
    INK,
    MUTED,
    OVER_RGB,
    UNDER_RGB,
    ColourScale,
    film_scale,
)
from paint_deposition.report.drawing import (
    HALO,
    MM,
    PartPicture,
    View,
    colour_bar,
    draw_triangles,
    legend,
    new_figure,
    quiet,
    save_picture,
)
from paint_deposition.report.film_pictures import draw_tool_path, page_film

CHOSEN = '#c0392b'
PART_COLOUR = '#b8c2cc'


def write_uniformity(path: str | Path, recommendation: Recommendation) -> Path:
    """Draw a recommendation: sigma_n over the index, and the film at the recommended one."""
    figure = new_figure(11.0, 4.4)
    left, right = figure.subplots(1, 2, width_ratios=[1.15, 1.0])
    draw_curve(left, recommendation)
    index_m, mean_um = recommendation.index_m, recommendation.mean_um
    quiet(
        right, 'across the passes [mm]', 'film [µm]',
        f'Passes at {MM * index_m:.0f} mm and {recommendation.speed_m_per_s:.3g} m/s, eq. (4)',
    )  # fmt: skip
    parallel = recommendation.curve.parallel
    x = np.linspace(-1.5 * index_m, 1.5 * index_m, 600)
    for number in range(-4, 5):
        one = parallel.second if number % 2 else parallel.first
        film = one.thickness_um(x - number * index_m)
        if film.max() > 1e-3 * mean_um:
            label = None if number else 'single pass'
            right.plot(MM * x, film, color=MUTED, linewidth=1.0, alpha=0.8, label=label)
    total, mean = parallel.thickness_um(index_m, x), f'mean {mean_um:.1f} µm'
    right.plot(MM * x, total, color=ACCENT, linewidth=1.8, label='sum of passes')
    right.axhline(mean_um, color=INK, linewidth=0.9, linestyle='--', label=mean)
    right.set_xlim(MM * x[0], MM * x[-1])
    right.set_ylim(0.0, 1.25 * float(total.max()))
    legend(right, loc='upper right', ncols=3)
    return save_picture(figure, path)


def draw_curve(axes: Axes, answer: Recommendation) -> None:
    """Draw sigma_n over the index with its minima, the tolerance and the recommended index."""
    quiet(axes, 'index [mm]', r'$\sigma_N$ [%]', 'Evenness over the index, eq. (5)')
    top = 1.08 * 100.0 * float(answer.curve.sigma_n.max())
    if answer.request.tolerance is not None:
        tolerance = 100.0 * answer.request.tolerance
        if tolerance < top:
            axes.axhline(tolerance, color=MUTED, linewidth=0.9, linestyle='--')
            # At the end where the curve stays away from it.
            away = np.abs(100.0 * answer.curve.sigma_n - tolerance)
            right = away[-(len(away) // 5) :].min() > away[: len(away) // 5].min()
            axes.annotate(
                f'tolerance {tolerance:g} %', (0.99 if right else 0.01, tolerance),
                xycoords=axes.get_yaxis_transform(), ha='right' if right else 'left',
                va='bottom', fontsize=9, color=MUTED,
            )  # fmt: skip
        for low, high in answer.windows_m:
            axes.axvspan(MM * low, MM * high, color='#d9ecf0', linewidth=0.0, zorder=0)
    axes.plot(MM * answer.curve.index_m, 100.0 * answer.curve.sigma_n, color=ACCENT, linewidth=1.8)
    for index_m, sigma_n in answer.curve.minima:
        axes.plot(
            MM * index_m, 100.0 * sigma_n, 'o', markersize=5,
            markerfacecolor='white', markeredgecolor=ACCENT, markeredgewidth=1.5,
        )  # fmt: skip
    chosen = MM * answer.index_m, 100.0 * answer.sigma_n
    axes.plot(*chosen, 'o', color=CHOSEN, markersize=7)
    axes.annotate(
        f'{chosen[0]:.0f} mm\n{chosen[1]:.2g} %', chosen, (chosen[0], chosen[1] + 0.2 * top),
        ha='center', va='bottom', color=CHOSEN, fontsize=10, fontweight='bold',
        arrowprops={'arrowstyle': '-', 'color': CHOSEN, 'linewidth': 0.9, 'shrinkB': 5},
    )  # fmt: skip
    axes.set_xlim(MM * answer.index_range_m[0], MM * answer.index_range_m[1])
    axes.set_ylim(0.0, top)


def write_geometry_picture(
    path: str | Path, surface: Surface, spray: SprayPath, geometry: SprayGeometry, title: str
) -> Path:
    """Draw part and motion from the gun, and from the right and the top of that picture."""
    front = View.of_front(surface.outward, surface.down)
    views = (front, *front.others())
    corners = np.concatenate([surface.vertices_m, spray.position_m])
    sizes = [np.maximum(np.ptp(view.flat(corners), axis=0), 1e-3) for view in views]
    figure = new_figure(11.5, 8.0)
    # Shares of the first view of width and height; none of the others becomes a sliver.
    front_m, beside_m = sizes[0], np.array([sizes[1][0], sizes[2][1]])
    across, upward = np.clip(front_m / (front_m + beside_m), 0.3, 0.7)
    ratios = {'width_ratios': (across, 1.0 - across), 'height_ratios': (upward, 1.0 - upward)}
    grid = figure.add_gridspec(2, 2, **ratios)
    size_m = float(np.linalg.norm(np.ptp(corners, axis=0)))
    places, names = ((0, 0), (0, 1), (1, 0)), ('from the gun', 'from its right', 'from its top')
    for place, view, name in zip(places, views, names, strict=True):
        axes = figure.add_subplot(grid[place])
        _draw_gun(axes, view, surface, spray, size_m)
        axes.set_title(name, loc='left', fontsize=10, color=MUTED)
    key = figure.add_subplot(grid[1, 1])
    key.set_axis_off()
    lines = [
        Line2D([], [], color='white', linewidth=1.7, path_effects=HALO,
               label='gun on, with the number of the pass'),
        Line2D([], [], color=INK, linewidth=0.9, linestyle=(0, (3, 3)), label='gun off'),
        Line2D([], [], color=ACCENT, linewidth=0.9, marker='.', markersize=4, markerfacecolor=INK,
               label='tool z from the TCP (the dot is its tip)'),
        Line2D([], [], color=PART_COLOUR, linewidth=6, label='the part'),
    ]  # fmt: skip
    key.legend(handles=lines, loc='upper left', frameon=False, fontsize=9, labelcolor=INK)
    text = '\n'.join(fill(f'warning: {line}', 48) for line in geometry.warnings)
    key.text(0.0, 0.0, text, fontsize=9, color=CHOSEN, transform=key.transAxes)
    words = f'{title}\n{fill(geometry.sentence, 105)}'
    figure.suptitle(words, x=0.02, ha='left', fontsize=11, color=INK)
    return save_picture(figure, path)


def _draw_gun(axes: Axes, view: View, surface: Surface, spray: SprayPath, size_m: float) -> None:
    toward = face_normals(surface.vertices_m, surface.faces) @ view.toward
    order = np.argsort(surface.vertices_m[surface.faces].mean(axis=1) @ view.toward)
    # The back of a sheet is seen from some sides: it is darker.
    light = np.where(toward >= 0.0, 0.75 + 0.25 * toward, 0.6)[order]
    colours = np.array(to_rgba(PART_COLOUR)) * np.column_stack([light] * 3 + [np.ones(len(light))])
    flat = view.flat(surface.vertices_m)
    draw_triangles(axes, flat[surface.faces[order]], np.repeat(colours[:, np.newaxis], 3, axis=1))
    axes.add_collection(LineCollection(list(view.flat(surface.rim_m)), colors=INK, linewidths=0.7))
    # Smaller parts of a picture are marked: they would not be seen.
    if np.ptp(flat, axis=0).max() < 0.02 * size_m:
        axes.plot(*flat.mean(axis=0), marker='s', markersize=5, color=INK)
        axes.annotate(
            'the part', flat.mean(axis=0), xytext=(8, 4), textcoords='offset points', fontsize=9,
            color=INK,
        )  # fmt: skip
    axes.update_datalim(flat)
    # Tool axes are drawn this long, and so far apart along the way, as shares of the picture.
    travel, apart_m = np.cumsum(spray.dwell_s * spray.speed_m_per_s), 0.04 * size_m
    evenly_m = np.arange(0.5 * apart_m, travel[-1], apart_m)
    shown = np.unique(np.searchsorted(travel, evenly_m))
    start = spray.position_m[shown]
    ends = start + 0.09 * size_m * spray.rotation[shown, :, 2]
    lines = np.stack([view.flat(start), view.flat(ends)], axis=1)
    colours = np.where(spray.flow[shown] > 0.0, ACCENT, '#c5ccd3')
    axes.add_collection(LineCollection(list(lines), linewidths=0.9, colors=colours))
    axes.plot(*view.flat(ends).T, linestyle='', marker='.', markersize=2.5, color=INK)
    places = view.flat(spray.position_m)
    low, high = places.min(axis=0) - 0.1 * size_m, places.max(axis=0) + 0.1 * size_m
    draw_tool_path(axes, spray, view, low, high)
    axes.margins(0.06)
    axes.grid(True, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    view.dress(axes)


def write_improvement_picture(path: str | Path, result: Improvement) -> Path:
    """Draw the film before and after in one scale; below, the speeds along the passes."""
    part = PartPicture.of(result.surface)
    low, high = _window(part, result)
    passes = result.changes[:12]
    columns = min(len(passes), 4)
    rows = math.ceil(len(passes) / columns)
    # Of each film, with the room around it, and of the charts below [in].
    width, height = (high - low) * min(np.array([6.2, 6.0]) / (high - low))
    above, below = height + 2.4, rows * 1.9
    figure = new_figure(max(2.0 * width + 1.8, 10.0), above + below)
    top, bottom = figure.subfigures(2, 1, height_ratios=[above, below])
    axes = top.subplots(1, 2, sharex=True, sharey=True)
    scale = _scale(result)
    films = zip(('before', 'after'), axes, (result.before, result.after), strict=True)
    for name, one, laid in films:
        part.view.dress(one, low, high)
        part.draw(one, scale.rgba(laid.film_um, laid.film_um > 1.0))
        part.draw_zones(one, result.wanted.zones, laid.path)
        draw_tool_path(one, laid.path, part.view, low, high)
        s, first = laid.statistics, result.before.paint
        more = laid.paint.emitted_cm3 / first.emitted_cm3 - 1.0
        paint = 'paint sprayed ' + (f'{100 * more:+.0f} %' if abs(more) >= 5e-3 else 'as before')
        title = (
            f'{name}: $\\sigma_N$ {100 * laid.sigma_n:.1f} %, mean {laid.mean_um:.1f} µm\n'
            f'{s.min_um:.1f} to {s.max_um:.1f} µm, {paint}, {laid.cycle_time_s:.1f} s'
        )
        one.set_title(title, loc='left', fontsize=11, color=INK)
    axes[1].set_ylabel('')
    colour_bar(top, axes, 'film [µm]', scale)
    top.legend(
        handles=[
            Patch(color='#{:02x}{:02x}{:02x}'.format(*rgb), label=f'{side} {end:.3g} µm')
            for rgb, side, end in (
                (OVER_RGB, 'above', scale.high), (UNDER_RGB, 'below', scale.low)
            )
        ],
        loc='outside lower right', frameon=False, fontsize=8.5, ncols=2,
    )  # fmt: skip
    charts = bottom.subplots(rows, columns, squeeze=False, sharey=True)
    for chart in charts.ravel()[len(passes) :]:
        chart.set_axis_off()
    programmes = ('before', result.original, BEFORE), ('after', result.programme, ACCENT)
    for chart, change in zip(charts.ravel(), passes, strict=False):
        begin, end = change.place_m
        places = np.linspace(begin + STANDING_M, end - STANDING_M, 121)
        middle = 0.5 * (places[1:] + places[:-1]) - begin
        for name, programme, colour in programmes:
            speed = programme.speed_between(places[:-1], places[1:])
            chart.plot(middle, speed, color=colour, linewidth=1.6, label=name)
        quiet(chart, 'along the pass [m]', '', f'pass {change.number}', size=9.0)
    for chart in charts[:, 0]:
        chart.set_ylabel('speed [m/s]', color=MUTED, fontsize=9.0)
    charts[0, 0].set_ylim(0.0, 1.08 * charts[0, 0].get_ylim()[1])
    legend(charts[0, 0], loc='best')
    return save_picture(figure, path)


def improved_figures(result: Improvement) -> list[Figure]:
    """The film before and after for a page, in one scale."""
    part, scale = PartPicture.of(result.surface), _scale(result)
    films = {'before': result.before, 'after': result.after}
    return [
        page_film(part, of.film_um, of.path, name, scale, _window(part, result))[0]
        for name, of in films.items()
    ]


def _window(part: PartPicture, result: Improvement) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a picture that holds the passes of both programmes [m]."""
    lows, highs = zip(*(part.window(of.path) for of in (result.before, result.after)), strict=True)
    return np.minimum(*lows), np.maximum(*highs)


def _scale(result: Improvement) -> ColourScale:
    """Colours for all but the most extreme film of both, between round figures."""
    films = np.concatenate(
        [one.film_um[result.wanted.region] for one in (result.before, result.after)]
    )
    return film_scale(np.quantile(films, [0.01, 0.99]))


def write_places(path: str | Path, places: PartPlaces) -> Path:
    """Draw the share of the planned speed at each place, or how much of the motion is reached."""
    axes_m = places.x_m, places.y_m
    steps = [float(np.ptp(at)) / max(len(at) - 1, 1) for at in axes_m]
    # A single column is as wide as the rows are high, and a single place this wide [m].
    steps = [step or max(steps) or 0.2 for step in steps]
    edges = [np.append(at, at[-1] + s) - 0.5 * s for at, s in zip(axes_m, steps, strict=True)]
    low, high = (np.array([one[end] for one in edges]) for end in (0, -1))
    width, height = (high - low) * min(5.2 / (high - low))
    figure = new_figure(max(width + 2.4, 4.8), height + 1.4)  # as wide as its words
    axes = figure.subplots()
    quiet(axes, "x of the part in the robot's base [m]", 'y [m]')
    figure.suptitle(
        'Circle: the place to choose. Figures: how much of the motion is reached.\n'
        'The robot stands at x = 0, y = 0.',
        x=0.02, ha='left', fontsize=9, color=INK,
    )  # fmt: skip
    axes.grid(False)
    whole = places.reached == 1.0
    shown = np.where(whole, places.speed, np.nan)
    drawn = axes.pcolormesh(*edges, 100.0 * shown, cmap='viridis', vmin=0.0, vmax=100.0)
    bar = figure.colorbar(drawn, ax=axes)
    bar.set_label('planned speed that the joints allow [%]', color=MUTED)
    bar.ax.spines['outline'].set_visible(False)
    for row, column in np.argwhere(~whole):
        words = f'{100.0 * places.reached[row, column]:.0f} %'
        at = places.x_m[column], places.y_m[row]
        axes.annotate(words, at, ha='center', va='center', fontsize=8, color=MUTED)
    if whole.any():
        row, column = places.best
        axes.plot(places.x_m[column], places.y_m[row], 'o', markersize=9, markerfacecolor='white',
                  markeredgecolor=INK, markeredgewidth=1.6)  # fmt: skip
    if (low <= 0.0).all() and (high >= 0.0).all():
        axes.plot(0.0, 0.0, '^', color=ACCENT, markersize=12)
        axes.annotate('robot', (0.0, 0.0), (6, 6), textcoords='offset points', color=ACCENT)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect('equal')
    return save_picture(figure, path)
