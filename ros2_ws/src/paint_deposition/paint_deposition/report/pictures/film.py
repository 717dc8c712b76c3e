"""The painted part from the front: film as colour on the shaded surface, and the tool path."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.markers import MarkerStyle
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Affine2D
from matplotlib.tri import Triangulation

from paint_deposition.film.colour_scales import BARE_RGB, TABLE, ColourScale, film_scale
from paint_deposition.film.statistics import FilmStatistics
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface
from paint_deposition.report.pictures.chart import new_figure, save_png
from paint_deposition.report.pictures.view import SNAP_COSINE, View
from paint_deposition.report.style import INK, MUTED

# The part's share of the picture, and the room around it for axes, title and legend [in].
PART_IN = (7.6, 7.6)
LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN = 0.75, 2.45, 0.6, 0.75
LEGEND_GAP_IN, BAR_WIDTH_IN, LEAST_HEIGHT_IN = 0.25, 0.24, 3.2
# Tool path around the part that is still shown [m].
MARGIN_M = 0.18
# Light from above left; how much a lean of the surface brightens or darkens it.
LIGHT, CONTRAST = (-0.45, 0.75), 0.5
DARKEST, BRIGHTEST = 0.55, 1.18
ARROW_EVERY_M = 0.45
HALO = [Stroke(linewidth=3.4, foreground=INK), Normal()]
PALE_HALO = [Stroke(linewidth=2.2, foreground='white', alpha=0.7), Normal()]


def write_door_picture(
    path: str | Path,
    surface: Surface,
    film_um: np.ndarray,
    spray: SprayPath,
    statistics: FilmStatistics,
    title: str,
    subtitle: str,
) -> Path:
    """Draw a painted part with the figures of its film, replacing an older picture at once.

    Args:
        path: PNG to write.
        film_um: (V,) film at the vertices of the surface [um].
        spray: the tool path.
        statistics: of the film.
        title, subtitle: what to write above.
    """
    low, high = _window(surface, spray, View.of_front(surface.outward, surface.down))
    figure, axes = _canvas(high - low)
    scale = draw_film(axes, surface, film_um, spray, statistics.painted_above_um)
    axes.set_title(title, loc='left', fontsize=13, color=INK, pad=24)
    axes.annotate(
        subtitle, (0.0, 1.0), xytext=(0, 9), xycoords='axes fraction',
        textcoords='offset points', fontsize=9, color=MUTED,
    )  # fmt: skip
    bare = bool(np.any(film_um <= statistics.painted_above_um))
    _draw_legend(figure, scale, statistics, bare)
    return save_png(figure, path)


def draw_film(
    axes: Axes,
    surface: Surface,
    film_um: np.ndarray,
    spray: SprayPath,
    painted_above_um: float,
) -> ColourScale:
    """Draw a painted part on axes of your own, seen from the gun's side.

    Args:
        axes: their limits, aspect and labels are set.
        film_um: (V,) film at the vertices of the surface [um].
        spray: the tool path, drawn over the part.
        painted_above_um: film that counts as painted; less is shown as bare metal.

    Returns:
        The scale of the colours.
    """
    view = View.of_front(surface.outward, surface.down)
    scale = film_scale(film_um)
    low, high = _window(surface, spray, view)
    _dress(axes, view, low, high)
    _draw_surface(axes, surface, film_um, view, scale, painted_above_um)
    _draw_gun(axes, spray, view, low, high)
    return scale


def _canvas(extent_m: np.ndarray) -> tuple[Figure, Axes]:
    """A figure around axes that are as large as the part needs them."""
    width, height = extent_m * min(PART_IN / extent_m)
    height_in = max(height, LEAST_HEIGHT_IN)
    size = np.array([LEFT_IN + width + RIGHT_IN, BOTTOM_IN + height_in + TOP_IN])
    figure = new_figure(*size)
    figure.set_layout_engine('none')
    corner = np.array([LEFT_IN, BOTTOM_IN + 0.5 * (height_in - height)])
    return figure, figure.add_axes((*(corner / size), width / size[0], height / size[1]))


def _window(surface: Surface, spray: SprayPath, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the picture: the part, and the gun not far from it."""
    corners = view.flat(surface.vertices_m)
    gun = view.flat(spray.position_m[spray.flow > 0.0])
    low, high = corners.min(axis=0), corners.max(axis=0)
    if len(gun):
        low = np.maximum(np.minimum(low, gun.min(axis=0)), low - MARGIN_M)
        high = np.minimum(np.maximum(high, gun.max(axis=0)), high + MARGIN_M)
    room = 0.03 * (high - low).max()
    return low - room, high + room


def _draw_surface(
    axes: Axes,
    surface: Surface,
    film_um: np.ndarray,
    view: View,
    scale: ColourScale,
    painted_above_um: float,
) -> None:
    normals = face_normals(surface.vertices_m, surface.faces)
    front = np.flatnonzero(normals @ view.toward > 0.0)
    depth = surface.vertices_m[surface.faces[front]].mean(axis=1) @ view.toward
    right_m, up_m = view.flat(surface.vertices_m).T
    triangles = Triangulation(right_m, up_m, surface.faces[front[np.argsort(depth)]])
    colours = scale.rgba(film_um, film_um > painted_above_um) / 255.0
    lean = surface.normals @ (LIGHT[0] * view.right + LIGHT[1] * view.up)
    shade = np.clip(1.0 + CONTRAST * lean, DARKEST, BRIGHTEST)[:, np.newaxis]
    colours[:, :3] = np.clip(colours[:, :3] * shade, 0.0, 1.0)
    axes.add_collection(TriMesh(triangles, facecolor=colours), autolim=False)
    _draw_contours(axes, triangles, film_um, scale)
    axes.add_collection(LineCollection(list(view.flat(surface.rim_m)), colors=INK, linewidths=0.8))


def _draw_contours(
    axes: Axes, triangles: Triangulation, film_um: np.ndarray, scale: ColourScale
) -> None:
    """Lines of equal film at round figures: shading darkens colours, but moves no line."""
    levels = MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]).tick_values(scale.low, scale.high)
    levels = levels[(levels > film_um.min()) & (levels < film_um.max())]
    if not len(levels):
        return
    lines = axes.tricontour(triangles, film_um, levels, colors=INK, linewidths=0.6, alpha=0.55)
    for label in axes.clabel(lines, fontsize=7.5, fmt='%g', inline_spacing=3):
        # Level, or labels on upright lines would read upward here and downward there.
        label.set(path_effects=PALE_HALO, rotation=0.0, transform_rotates_text=False)


def _draw_gun(axes: Axes, spray: SprayPath, view: View, low: np.ndarray, high: np.ndarray) -> None:
    on = spray.flow > 0.0
    apart_s = np.diff(spray.stamp_ns) * 1e-9 - 0.5 * (spray.dwell_s[1:] + spray.dwell_s[:-1])
    breaks = 1 + np.flatnonzero((on[1:] != on[:-1]) | (apart_s > 1e-3))
    number = 0
    for rows in np.split(np.arange(len(spray)), breaks):
        line = view.flat(spray.position_m[rows])
        if not on[rows].any():
            axes.plot(*line.T, color='#3a4048', linewidth=0.9, linestyle=(0, (3, 3)), alpha=0.8)
            continue
        number += 1
        axes.plot(*line.T, color='white', linewidth=1.7, path_effects=HALO)
        room = 0.02 * (high - low).max()
        shown = line[np.all((line > low + room) & (line < high - room), axis=1)]
        if len(shown) > 1:
            _draw_arrows(axes, shown)
            axes.annotate(
                str(number), shown[0], fontsize=8.5, color='white', ha='center', va='center',
                bbox={'boxstyle': 'circle,pad=0.25', 'facecolor': INK, 'edgecolor': 'white'},
            )  # fmt: skip


def _draw_arrows(axes: Axes, line: np.ndarray) -> None:
    """Arrow heads along a line, in its direction."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    count = max(1, round(along[-1] / ARROW_EVERY_M))
    for middle in along[-1] * (np.arange(count) + 0.5) / count:
        row = max(1, int(np.searchsorted(along, middle)))
        right, up = line[row] - line[row - 1]
        turn = Affine2D().rotate(float(np.arctan2(up, right)) - 0.5 * np.pi)
        axes.plot(
            *line[row], marker=MarkerStyle('^', transform=turn), markersize=9,
            markerfacecolor='white', markeredgecolor=INK, markeredgewidth=0.9,
        )  # fmt: skip


def _dress(axes: Axes, view: View, low: np.ndarray, high: np.ndarray) -> None:
    axes.set_aspect('equal')
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_facecolor('white')
    axes.spines[['top', 'right']].set_visible(False)
    axes.tick_params(colors=MUTED, labelsize=9)
    axes.set_xlabel(view.labels[0], color=MUTED)
    axes.set_ylabel(view.labels[1], color=MUTED)
    # Axes of the mesh that point the other way are labelled with the mesh's own sign.
    if view.right.min() < -SNAP_COSINE:
        axes.xaxis.set_major_formatter(lambda value, _: f'{-value:g}')
    if view.up.min() < -SNAP_COSINE:
        axes.yaxis.set_major_formatter(lambda value, _: f'{-value:g}')


def _draw_legend(
    figure: Figure, scale: ColourScale, statistics: FilmStatistics, bare: bool
) -> None:
    width, height = figure.get_size_inches()
    left = width - RIGHT_IN + LEGEND_GAP_IN
    lines = _figures(statistics)
    text_in = 0.24 * len(lines) + (0.35 if bare else 0.0)
    bar_in = height - BOTTOM_IN - TOP_IN - text_in - 0.25
    bar = figure.colorbar(
        ScalarMappable(
            Normalize(scale.low, scale.high), ListedColormap(scale.palette[:TABLE] / 255.0)
        ),
        cax=figure.add_axes(
            (left / width, 1.0 - (TOP_IN + bar_in) / height, BAR_WIDTH_IN / width, bar_in / height)
        ),
    )
    bar.set_label('film thickness [µm]', color=MUTED)
    bar.ax.tick_params(colors=MUTED, labelsize=9)
    bar.ax.spines['outline'].set_visible(False)
    top = (BOTTOM_IN + text_in) / height
    if bare:
        figure.legend(
            handles=[Patch(color='#{:02x}{:02x}{:02x}'.format(*BARE_RGB))],
            labels=[f'below {statistics.painted_above_um:g} µm'],
            loc='upper left', bbox_to_anchor=((left - 0.1) / width, top), frameon=False,
            fontsize=9, labelcolor=MUTED, handlelength=1.2, handleheight=1.0, borderpad=0.2,
        )  # fmt: skip
        top -= 0.35 / height
    figure.text(
        left / width, top, '\n'.join(lines), va='top', fontsize=9.5, color=INK, linespacing=1.6
    )


def _figures(s: FilmStatistics) -> list[str]:
    lines = [
        f'mean {s.mean_um:.1f} ± {s.std_dev_um:.1f} µm',
        f'{s.min_um:.1f} to {s.max_um:.1f} µm',
        f'painted {100 * s.coverage:.1f} % of {s.area_m2:.2f} m²',
        f'{s.painted_volume_cm3:.1f} of {s.emitted_volume_cm3:.1f} cm³ on the part',
    ]
    if s.target_um > 0.0:
        lines.append(
            f'{100 * s.within_target:.0f} % within {s.target_um:g} ± {s.target_tolerance_um:g} µm'
        )
    return lines
