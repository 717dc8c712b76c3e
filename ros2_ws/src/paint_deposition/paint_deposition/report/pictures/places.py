"""Where a part may stand for a robot, as a map."""

from pathlib import Path

import numpy as np

from paint_deposition.planning.part_place import PartPlaces
from paint_deposition.report.pictures.chart import new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, INK, MUTED


def write_places(path: str | Path, places: PartPlaces) -> Path:
    """Draw the share of the planned speed at each place, or how much of the motion is reached."""
    figure = new_figure(7.6, 5.2)
    axes = figure.subplots()
    quiet(
        axes,
        "x of the part in the robot's base [m]",
        'y [m]',
        'Circle: the place to choose. Figures: how much of the motion is reached',
    )
    axes.grid(False)
    step = max(np.ptp(places.x_m) / max(len(places.x_m) - 1, 1), 1e-3)
    edges = [np.append(at, at[-1] + step) - 0.5 * step for at in (places.x_m, places.y_m)]
    whole = places.reached == 1.0
    shown = np.where(whole, places.speed, np.nan)
    drawn = axes.pcolormesh(*edges, 100.0 * shown, cmap='viridis', vmin=0.0, vmax=100.0)
    bar = figure.colorbar(drawn, ax=axes, shrink=0.8)
    bar.set_label('planned speed that the joints allow [%]', color=MUTED)
    bar.ax.spines['outline'].set_visible(False)
    for row, column in np.ndindex(whole.shape):
        at = places.x_m[column], places.y_m[row]
        if not whole[row, column]:
            words = f'{100.0 * places.reached[row, column]:.0f} %'
            axes.annotate(words, at, ha='center', va='center', fontsize=8, color=MUTED)
    if whole.any():
        row, column = places.best
        axes.plot(places.x_m[column], places.y_m[row], 'o', markersize=9, markerfacecolor='white',
                  markeredgecolor=INK, markeredgewidth=1.6)  # fmt: skip
    axes.plot(0.0, 0.0, '^', color=ACCENT, markersize=12, clip_on=False)
    axes.annotate('robot', (0.0, 0.0), (6, 6), textcoords='offset points', color=ACCENT)
    axes.set_xlim(min(edges[0][0], -0.1), edges[0][-1])
    axes.set_ylim(min(edges[1][0], -0.1), max(edges[1][-1], 0.1))
    axes.set_aspect('equal')
    return save_picture(figure, path)
