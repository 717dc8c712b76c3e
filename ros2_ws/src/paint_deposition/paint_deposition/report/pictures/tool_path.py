"""The gun's way over a part: passes with their numbers and direction."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.markers import MarkerStyle
from matplotlib.patheffects import Normal, Stroke
from matplotlib.transforms import Affine2D

from paint_deposition.motion.path import SprayPath
from paint_deposition.report.pictures.view import View
from paint_deposition.report.style import INK

ARROWS_A_WIDTH = 3.0
WAY_OFF = '#3a4048'
HALO = [Stroke(linewidth=3.4, foreground=INK), Normal()]


def draw_tool_path(
    axes: Axes, spray: SprayPath, view: View, low: np.ndarray, high: np.ndarray
) -> None:
    """Draw each pass as a line with its number and arrows, and the way between them dashed.

    Args:
        axes: on which one unit is 1 m.
        spray: the motion.
        view: the directions of the picture.
        low, high: (2,) corners of the picture [m].
    """
    on = spray.flow > 0.0
    apart_s = np.diff(spray.stamp_ns) * 1e-9 - 0.5 * (spray.dwell_s[1:] + spray.dwell_s[:-1])
    breaks = 1 + np.flatnonzero((on[1:] != on[:-1]) | (apart_s > 1e-3))
    number = 0
    for rows in np.split(np.arange(len(spray)), breaks):
        line = view.flat(spray.position_m[rows])
        if not on[rows].any():
            axes.plot(*line.T, color=WAY_OFF, linewidth=0.9, linestyle=(0, (3, 3)), alpha=0.8)
            continue
        number += 1
        axes.plot(*line.T, color='white', linewidth=1.7, path_effects=HALO)
        room = 0.02 * (high - low).max()
        shown = line[np.all((line > low + room) & (line < high - room), axis=1)]
        if len(shown) > 1:
            _draw_arrows(axes, shown, (high - low).max() / ARROWS_A_WIDTH)
            axes.annotate(
                str(number), shown[0], fontsize=8.5, color='white', ha='center', va='center',
                bbox={'boxstyle': 'circle,pad=0.25', 'facecolor': INK, 'edgecolor': 'white'},
            )  # fmt: skip


def _draw_arrows(axes: Axes, line: np.ndarray, every_m: float) -> None:
    """Arrow heads along a line, in its direction."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    count = max(1, round(along[-1] / every_m))
    for middle in along[-1] * (np.arange(count) + 0.5) / count:
        row = max(1, int(np.searchsorted(along, middle)))
        right, up = line[row] - line[row - 1]
        turn = Affine2D().rotate(float(np.arctan2(up, right)) - 0.5 * np.pi)
        axes.plot(
            *line[row], marker=MarkerStyle('^', transform=turn), markersize=9,
            markerfacecolor='white', markeredgecolor=INK, markeredgewidth=0.9,
        )  # fmt: skip
