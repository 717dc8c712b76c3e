"""Driven and programmed speed along the way sprayed."""

from pathlib import Path

import numpy as np

from paint_deposition.motion.driven_speed import TOLERANCE, DrivenSpeed
from paint_deposition.report.pictures.chart import legend, new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, GRID, MUTED

SLOWER_COLOUR = '#c0392b'


def write_speed_picture(path: str | Path, speed: DrivenSpeed, title: str) -> Path:
    """Draw both speeds over the way, pass behind pass, and mark where the robot is slower.

    Args:
        path: PNG to write.
        speed: what to draw.
        title: what to write on top.
    """
    figure = new_figure(11.5, 4.2)
    axes = figure.add_subplot()
    driven, programmed = speed.driven_m_per_s, speed.programmed_m_per_s
    for number in range(1, len(speed.passes) + 1):
        rows = np.flatnonzero(speed.spray_pass == number)
        way_m = speed.way_m[rows]
        if number % 2 == 0:
            axes.axvspan(way_m[0], way_m[-1], color=GRID, alpha=0.6, linewidth=0)
        first = number == 1
        axes.plot(
            way_m, programmed[rows], color=MUTED, linewidth=1.2, linestyle=(0, (4, 2)),
            label='programmed' if first else None,
        )  # fmt: skip
        axes.plot(
            way_m, driven[rows], color=ACCENT, linewidth=1.4, label='driven' if first else None
        )
        axes.fill_between(
            way_m, driven[rows], programmed[rows], color=SLOWER_COLOUR, alpha=0.35, linewidth=0,
            where=(driven[rows] < (1.0 - TOLERANCE) * programmed[rows]).tolist(),
            label=f'more than {100 * TOLERANCE:.0f} % slower' if first else None,
        )  # fmt: skip
        axes.annotate(
            str(number), (0.5 * (way_m[0] + way_m[-1]), 0.0), xytext=(0, 3),
            textcoords='offset points', ha='center', fontsize=8, color=MUTED,
        )  # fmt: skip
    axes.set_xlim(0.0, speed.way_m[-1])
    axes.set_ylim(0.0, 1.15 * max(driven.max(), programmed.max()))
    quiet(axes, 'way sprayed, pass behind pass [m]', 'speed of the TCP [m/s]', title)
    legend(axes, loc='lower right', ncols=3, bbox_to_anchor=(1.0, 1.0))
    return save_picture(figure, path)
