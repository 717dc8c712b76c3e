"""A programme before and after: the film in one scale of colours, and the speeds of its passes."""

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from paint_deposition.film.colour_scales import OVER_RGB, TABLE, UNDER_RGB, ColourScale, film_scale
from paint_deposition.motion.path import SprayPath
from paint_deposition.planning.improvement.improvement import Improvement, LaidFilm
from paint_deposition.planning.improvement.programme import Opening, Programme, speed_along
from paint_deposition.report.pictures.chart import legend, new_figure, quiet, save_picture
from paint_deposition.report.pictures.part import PartPicture
from paint_deposition.report.pictures.tool_path import draw_tool_path
from paint_deposition.report.style import ACCENT, BEFORE, INK, MUTED

# The colours span this share of both films about the target, to the next 5 %.
SHOWN, STEP = 0.98, 0.05
MOST_CHARTS, SAMPLES = 12, 120
FILM_IN, CHART_IN, AROUND_IN = (6.2, 6.0), (3.0, 1.9), (1.8, 2.4)


def write_improvement_picture(path: str | Path, result: Improvement) -> Path:
    """Write the picture as PNG, SVG or PDF, by the suffix, in place of an older file."""
    return save_picture(improvement_picture(result), path)


def improvement_picture(result: Improvement) -> Figure:
    """Film before and after side by side in one scale; below, the speeds along the passes."""
    part = PartPicture.of(result.surface)
    windows = [part.window(path) for path in result.paths]
    low = np.minimum(windows[0][0], windows[1][0])
    high = np.maximum(windows[0][1], windows[1][1])
    openings = result.retiming.programme.openings[:MOST_CHARTS]
    columns = min(len(openings), 4)
    rows = math.ceil(len(openings) / columns)
    width, height = (high - low) * min(np.array(FILM_IN) / (high - low))
    above, below = height + AROUND_IN[1], rows * CHART_IN[1]
    figure = new_figure(max(2.0 * width + AROUND_IN[0], 10.0), above + below)
    top, bottom = figure.subfigures(2, 1, height_ratios=[above, below])
    axes = top.subplots(1, 2, sharex=True, sharey=True)
    scale = _scale(result)
    films = zip(axes, result.paths, (result.before, result.after), strict=True)
    for name, (one, path, laid) in zip(('before', 'after'), films, strict=True):
        part.dress(one, low, high)
        _draw_film(one, part, scale, path, laid)
        one.set_title(_title(name, laid), loc='left', fontsize=11, color=INK)
    axes[1].set_ylabel('')
    bar = top.colorbar(
        ScalarMappable(
            Normalize(scale.low, scale.high), ListedColormap(scale.palette[:TABLE] / 255.0)
        ),
        ax=axes, location='bottom', shrink=0.4, aspect=40, pad=0.04,
    )  # fmt: skip
    bar.set_label('film [µm]', color=MUTED)
    bar.outline.set_visible(False)
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
    for chart in charts.ravel()[len(openings) :]:
        chart.set_axis_off()
    programmes = result.retiming.given, result.retiming.programme
    for number, chart in enumerate(charts.ravel()[: len(openings)]):
        _draw_speeds(chart, number, programmes)
    charts[0, 0].set_ylim(0.0, 1.08 * charts[0, 0].get_ylim()[1])
    legend(charts[0, 0], loc='best')
    return figure


def _scale(result: Improvement) -> ColourScale:
    target = result.target_um
    off = [
        np.abs(one.film_um[result.target_region] / target - 1.0)
        for one in (result.before, result.after)
    ]
    reach = float(np.quantile(np.concatenate(off), SHOWN))
    reach = min(max(math.ceil(reach / STEP) * STEP, 2.0 * STEP), 0.95)
    film = np.concatenate([result.before.film_um, result.after.film_um])
    return film_scale(film, target * (1.0 - reach), target * (1.0 + reach))


def _draw_film(
    axes: Axes, part: PartPicture, scale: ColourScale, path: SprayPath, laid: LaidFilm
) -> None:
    seen = part.spread(laid.film_um)
    part.draw_pixels(axes, scale.rgba(seen, seen > 1.0))
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    draw_tool_path(axes, path, part.view, low, high)


def _title(name: str, laid: LaidFilm) -> str:
    return (
        f'{name}: $\\sigma_N$ {100 * laid.sigma_n:.1f} %, mean {laid.mean_um:.1f} µm\n'
        f'{laid.min_um:.1f} to {laid.max_um:.1f} µm, paint {laid.paint_cm3:.1f} cm³, '
        f'{laid.cycle_s:.1f} s'
    )


def _draw_speeds(axes: Axes, number: int, programmes: tuple[Programme, Programme]) -> None:
    """The speeds along an opening of the gun, over the path from where it first opened."""
    openings: list[Opening] = [programme.openings[number] for programme in programmes]
    origin = openings[0].on_m
    for programme, opening, colour, name in zip(
        programmes, openings, (BEFORE, ACCENT), ('before', 'after'), strict=True
    ):
        places = np.linspace(opening.on_m, opening.off_m, SAMPLES + 1)
        middle = 0.5 * (places[1:] + places[:-1]) - origin
        axes.plot(middle, speed_along(programme, places), color=colour, linewidth=1.6, label=name)
    quiet(axes, 'along the pass [m]', 'speed [m/s]' if number % 4 == 0 else '',
          f'pass {number + 1}', size=9.0)  # fmt: skip
