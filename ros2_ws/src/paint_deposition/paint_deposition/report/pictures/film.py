"""The painted part with the figures of its film; first what is in the target band, if any."""

from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from paint_deposition.film.colour_scales import BARE_RGB, ColourScale, film_scale
from paint_deposition.film.statistics import CPK_MEANS, FilmStatistics
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.surface import Surface
from paint_deposition.report.pictures.chart import colours_of, new_figure, quiet, save_picture
from paint_deposition.report.pictures.part import PartPicture, draw_tool_path
from paint_deposition.report.style import BARE, BELOW, HIGH, INK, MUTED, WITHIN

# The part's share of the picture, and the room around it for axes, title and legend [in].
PART_IN = (7.6, 7.6)
LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN = 0.9, 2.95, 0.6, 0.75
LEGEND_GAP_IN, BAR_WIDTH_IN, LEAST_HEIGHT_IN = 0.3, 0.24, 4.0
LINE_IN, INSET_IN = 0.24, (2.1, 1.35)
BINS = 40


def write_film_picture(path: str | Path, *drawn: Any) -> Path:
    """Write ``film_picture`` as PNG, SVG or PDF, by the suffix, in place of an older file."""
    return save_picture(film_picture(*drawn), path)


def film_picture(
    surface: Surface,
    film_um: np.ndarray,
    spray: SprayPath,
    statistics: FilmStatistics,
    title: str,
    subtitle: str,
) -> Figure:
    """A painted part with the figures of its film.

    With a target the part is drawn twice: too thin, right and too thick first, then the film.

    Args:
        surface: the part.
        film_um: (V,) film at the vertices of the surface [um].
        spray: the tool path.
        statistics: of the film.
        title, subtitle: what to write above.
    """
    part = PartPicture.of(surface)
    low, high = part.window(spray)
    wanted = statistics.target_um > 0.0
    figure, rows = _canvas(high - low, 2 if wanted else 1)
    if wanted:
        _draw_band(rows[0], part, film_um, spray, statistics)
        _draw_band_legend(rows[0], surface, film_um, statistics)
    scale = draw_film(rows[-1].axes, surface, film_um, spray, statistics.painted_above_um, part)
    _draw_legend(rows[-1], part, scale, film_um, statistics)
    rows[0].axes.set_title(title, loc='left', fontsize=13, color=INK, pad=24)
    rows[0].axes.annotate(
        fill(subtitle, 110), (0.0, 1.0), xytext=(0, 9), xycoords='axes fraction',
        textcoords='offset points', fontsize=9, color=MUTED,
    )  # fmt: skip
    return figure


def draw_film(
    axes: Axes,
    surface: Surface,
    film_um: np.ndarray,
    spray: SprayPath,
    painted_above_um: float,
    part: PartPicture | None = None,
) -> ColourScale:
    """Draw a painted part on axes of your own, seen from the gun's side.

    Args:
        axes: their limits, aspect and labels are set.
        surface: the part.
        film_um: (V,) film at the vertices of the surface [um].
        spray: the tool path, drawn over the part.
        painted_above_um: film that counts as painted; less is shown as bare metal.
        part: the picture of the surface, where it is at hand.

    Returns:
        The scale of the colours. They are the film: relief is shown by lines alone.
    """
    part = part or PartPicture.of(surface)
    scale = film_scale(film_um)
    low, high = part.window(spray)
    part.dress(axes, low, high)
    part.draw(axes, scale.rgba(film_um, film_um > painted_above_um))
    part.draw_contours(axes, film_um, scale.low, scale.high)
    draw_tool_path(axes, spray, part.view, low, high)
    return scale


class _Row:
    """Axes for the part, and a column beside them that is filled from above [in]."""

    def __init__(self, figure: Figure, box: tuple[float, float, float, float]) -> None:
        self.figure = figure
        self.size = figure.get_size_inches()
        left, bottom, width, height = box
        self.axes = self._axes(left, bottom, width, height)
        self.left, self.top, self.bottom = left + width + LEGEND_GAP_IN, bottom + height, bottom

    def _axes(self, left: float, bottom: float, width: float, height: float) -> Axes:
        across, up = self.size
        return self.figure.add_axes((left / across, bottom / up, width / across, height / up))

    def axes_below(self, width_in: float, height_in: float, indent_in: float = 0.0) -> Axes:
        """Axes below what the column holds already."""
        self.top -= height_in
        return self._axes(self.left + indent_in, self.top, width_in, height_in)

    def write(self, lines: list[str], size: float = 9.5, colour: str = INK) -> None:
        """Lines of text below what the column holds already."""
        across, up = self.size
        self.figure.text(
            self.left / across, self.top / up, '\n'.join(lines), va='top', fontsize=size,
            linespacing=1.6, color=colour,
        )  # fmt: skip
        self.top -= LINE_IN * len(lines) * size / 9.5

    def patches(self, entries: list[tuple[str, str]]) -> None:
        """A coloured patch with a label in each line."""
        across, up = self.size
        self.figure.legend(
            handles=[Patch(color=colour) for colour, _ in entries],
            labels=[label for _, label in entries], loc='upper left', frameon=False, fontsize=9.5,
            bbox_to_anchor=((self.left - 0.1) / across, (self.top + 0.08) / up),
            labelcolor=INK, handlelength=1.2, handleheight=1.0, borderpad=0.2,
        )  # fmt: skip
        self.top -= 0.25 * len(entries) + 0.05


def _canvas(extent_m: np.ndarray, count: int) -> tuple[Figure, list[_Row]]:
    """A figure of rows, each with axes as large as the part needs them, the first on top."""
    width, height = extent_m * min(PART_IN / extent_m)
    row_in = max(height, LEAST_HEIGHT_IN)
    pitch = row_in + BOTTOM_IN + 0.3
    total = TOP_IN + BOTTOM_IN + row_in + (count - 1) * pitch
    figure = new_figure(LEFT_IN + width + RIGHT_IN, total, layout=None)
    bottoms = [BOTTOM_IN + k * pitch + 0.5 * (row_in - height) for k in reversed(range(count))]
    rows = [_Row(figure, (LEFT_IN, bottom, width, height)) for bottom in bottoms]
    for row in rows:
        row.top += 0.5 * (row_in - height)
        row.bottom -= 0.5 * (row_in - height)
    return figure, rows


def _draw_band(
    row: _Row, part: PartPicture, film_um: np.ndarray, spray: SprayPath, s: FilmStatistics
) -> None:
    low, high = part.window(spray)
    part.dress(row.axes, low, high)
    ends, colours = [s.painted_above_um], [BARE]
    for end, colour in zip(s.band_um, (BELOW, WITHIN), strict=True):
        if end > ends[-1]:
            ends.append(end)
            colours.append(colour)
    part.draw_bands(row.axes, film_um, ends, [*colours, HIGH])
    draw_tool_path(row.axes, spray, part.view, low, high)


def _draw_band_legend(row: _Row, surface: Surface, film_um: np.ndarray, s: FilmStatistics) -> None:
    """Shares, histogram and Cpk."""
    low, high = s.band_um
    row.write([f'target {s.target_um:g} ± {s.target_tolerance_um:g} µm'], 11.0)
    row.write([f'share of the painted {100 * s.coverage:.1f} % of {s.area_m2:.2f} m²'], 8.0,
              colour=MUTED)  # fmt: skip
    row.top -= 0.08
    row.patches(
        [
            (HIGH, f'{_share(s.above_target)} high, above {high:g} µm'),
            (WITHIN, f'{_share(s.within_target)} in the band'),
            (BELOW, f'{_share(s.below_target)} low, below {low:g} µm'),
        ]
        + [(BARE, f'bare, up to {s.painted_above_um:g} µm')] * (s.coverage < 1.0)
    )
    row.top -= 0.3
    text_in = 5 * LINE_IN
    height = np.clip(row.top - row.bottom - text_in - 0.5, 0.9, 2.2)
    _draw_histogram(row.axes_below(2.1, height, 0.4), surface, film_um, s)
    row.top -= 0.6
    row.write([f'Cpk {s.cpk:.2f}'.replace('-', '−')], 11.0)
    row.write(fill(CPK_MEANS, 44).split('\n'), 8.0, MUTED)


def _share(share: float) -> str:
    return f'{100 * share:.1f} %'


def _draw_histogram(axes: Axes, surface: Surface, film_um: np.ndarray, s: FilmStatistics) -> None:
    """Area over film, with the target band behind it."""
    painted = film_um > s.painted_above_um
    film, area = film_um[painted], surface.vertex_areas_m2[painted]
    low, high = s.band_um
    quiet(axes, 'film [µm]', '', size=8.0)
    axes.set_title('% of the painted area', loc='left', fontsize=8, color=MUTED)
    axes.axvspan(low, high, color=WITHIN, alpha=0.35, linewidth=0.0)
    if len(film):
        axes.hist(film, BINS, weights=100.0 * area / area.sum(), color=INK, alpha=0.75)
    for limit in (low, s.target_um, high):
        axes.axvline(limit, color=MUTED, linewidth=0.9, linestyle='--')


def _draw_legend(
    row: _Row, part: PartPicture, scale: ColourScale, film_um: np.ndarray, s: FilmStatistics
) -> None:
    lines = [
        f'mean {s.mean_um:.1f} ± {s.std_dev_um:.1f} µm',
        f'{s.min_um:.1f} to {s.max_um:.1f} µm',
        f'painted {100 * s.coverage:.1f} % of {s.area_m2:.2f} m²',
        f'{s.painted_volume_cm3:.1f} of {s.emitted_volume_cm3:.1f} cm³ on the part',
    ]
    bare = bool(np.any(film_um <= s.painted_above_um))
    extent = part.high_m - part.low_m
    inset = extent * min(INSET_IN / extent)
    below = LINE_IN * len(lines) + 0.3 * bare + inset[1] + 0.75
    row.write(['film [µm]'], colour=MUTED)
    bar = row.figure.colorbar(
        colours_of(scale), cax=row.axes_below(BAR_WIDTH_IN, row.top - row.bottom - below)
    )
    bar.ax.tick_params(colors=MUTED, labelsize=9)
    bar.ax.spines['outline'].set_visible(False)
    row.top -= 0.2
    if bare:
        row.patches(
            [('#{:02x}{:02x}{:02x}'.format(*BARE_RGB), f'up to {s.painted_above_um:g} µm')]
        )
    row.write(lines)
    row.top -= 0.1
    row.write(['shape'], 8.0, MUTED)
    row.top -= 0.05
    relief = row.axes_below(*inset)
    relief.set_axis_off()
    relief.set(xlim=(part.low_m[0], part.high_m[0]), ylim=(part.low_m[1], part.high_m[1]))
    part.draw_relief(relief)
