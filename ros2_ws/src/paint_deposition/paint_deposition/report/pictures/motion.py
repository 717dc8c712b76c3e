"""The gun's motion over its part, from three sides."""

from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D

from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import box_extent_m
from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface
from paint_deposition.report.pictures.part import View, draw_triangles, dress
from paint_deposition.report.style import (
    ACCENT,
    COMPONENTS,
    GRID,
    INK,
    MUTED,
    new_figure,
    save_picture,
)

PART_COLOUR = '#b8c2cc'
PASS_COLOURS = (ACCENT, *COMPONENTS, '#c0392b', '#2c5aa0')


def write_geometry_picture(
    path: str | Path, surface: Surface, spray: SprayPath, geometry: SprayGeometry, title: str
) -> Path:
    """Draw part and motion from the gun, and from the right and the top of that picture."""
    front = View.of_front(surface.outward, surface.down)
    views = (front, *front.others())
    corners = np.concatenate([surface.vertices_m, spray.position_m])
    sizes = [np.maximum(np.ptp(view.flat(corners), axis=0), 1e-3) for view in views]
    figure = new_figure(11.5, 8.0)
    grid = figure.add_gridspec(
        2, 2, width_ratios=_ratios(sizes[0][0], sizes[1][0]),
        height_ratios=_ratios(sizes[0][1], sizes[2][1]),
    )  # fmt: skip
    size_m = float(np.linalg.norm(box_extent_m(corners)))
    places, names = ((0, 0), (0, 1), (1, 0)), ('from the gun', 'from its right', 'from its top')
    for place, view, name in zip(places, views, names, strict=True):
        axes = figure.add_subplot(grid[place])
        _draw(axes, view, surface, spray, size_m)
        axes.set_title(name, loc='left', fontsize=10, color=MUTED)
    key = figure.add_subplot(grid[1, 1])
    key.set_axis_off()
    lines = [
        Line2D([], [], color=PASS_COLOURS[0], linewidth=1.8, label='gun on, a colour a pass'),
        Line2D([], [], color=MUTED, linewidth=0.8, linestyle=(0, (3, 3)), label='gun off'),
        Line2D(
            [], [], color=PASS_COLOURS[0], linewidth=0.9, marker='.', markersize=4,
            markerfacecolor=INK, label='tool z from the TCP (the dot is its tip)',
        ),
        Line2D([], [], color=PART_COLOUR, linewidth=6, label='the part'),
    ]  # fmt: skip
    key.legend(handles=lines, loc='upper left', frameon=False, fontsize=9, labelcolor=INK)
    text = '\n'.join(fill(f'warning: {line}', 48) for line in geometry.warnings)
    key.text(0.0, 0.0, text, fontsize=9, color='#c0392b', transform=key.transAxes)
    figure.suptitle(f'{title}\n{geometry.sentence}', x=0.02, ha='left', fontsize=11, color=INK)
    return save_picture(figure, path)


def _ratios(one: float, other: float) -> tuple[float, float]:
    """Shares of a side for two views, neither of which becomes a sliver."""
    share = float(np.clip(one / (one + other), 0.3, 0.7))
    return share, 1.0 - share


def _draw(axes: Axes, view: View, surface: Surface, spray: SprayPath, size_m: float) -> None:
    _draw_part(axes, view, surface, size_m)
    on = spray.flow > 0.0
    colours = [PASS_COLOURS[n % len(PASS_COLOURS)] for n in np.maximum(spray.spray_pass, 0)]
    breaks = 1 + np.flatnonzero((on[1:] != on[:-1]) | (np.diff(spray.spray_pass) != 0))
    numbered = set()
    for rows in np.split(np.arange(len(spray)), breaks):
        line = view.flat(spray.position_m[rows])
        if not on[rows[0]]:
            axes.plot(*line.T, color=MUTED, linewidth=0.8, linestyle=(0, (3, 3)))
            continue
        axes.plot(*line.T, color=colours[rows[0]], linewidth=1.8)
        number = int(spray.spray_pass[rows[0]])
        if number not in numbered and len(rows) > 1:
            numbered.add(number)
            axes.annotate(
                str(number + 1), line[0], fontsize=7.5, color='white', ha='center', va='center',
                bbox={'boxstyle': 'circle,pad=0.2', 'facecolor': colours[rows[0]], 'linewidth': 0},
            )  # fmt: skip
    # Tool axes are drawn this long, and so far apart along the way, as shares of the picture.
    travel, apart_m = np.cumsum(spray.dwell_s * spray.speed_m_per_s), 0.04 * size_m
    evenly_m = np.arange(0.5 * apart_m, travel[-1], apart_m)
    shown = np.unique(np.searchsorted(travel, evenly_m))
    start = spray.position_m[shown]
    ends = start + 0.09 * size_m * spray.rotation[shown, :, 2]
    axes.add_collection(
        LineCollection(
            list(np.stack([view.flat(start), view.flat(ends)], axis=1)), linewidths=0.9,
            colors=[colours[row] if on[row] else '#c5ccd3' for row in shown],
        )
    )  # fmt: skip
    axes.plot(*view.flat(ends).T, linestyle='', marker='.', markersize=2.5, color=INK)
    axes.set_aspect('equal', adjustable='datalim')
    axes.margins(0.06)
    axes.grid(True, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    dress(axes, view)


def _draw_part(axes: Axes, view: View, surface: Surface, size_m: float) -> None:
    normals = face_normals(surface.vertices_m, surface.faces)
    toward = normals @ view.toward
    depth = surface.vertices_m[surface.faces].mean(axis=1) @ view.toward
    order = np.argsort(depth)
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
