"""What evenness costs in paint: results for several weights of the paint, as a curve."""

from collections.abc import Sequence
from pathlib import Path

from paint_deposition.planning.plan import TradeOffPoint
from paint_deposition.report.pictures.chart import new_figure, quiet, save_picture
from paint_deposition.report.style import ACCENT, BEFORE, INK, MUTED


def write_trade_off(
    path: str | Path, given: TradeOffPoint, points: Sequence[TradeOffPoint]
) -> Path:
    """Draw unevenness over paint for a programme as given and for each weight."""
    figure = new_figure(7.0, 4.6)
    axes = figure.subplots()
    quiet(axes, 'paint sprayed [cm³]', r'$\sigma_N$ [%]', 'What evenness costs in paint')
    order = sorted(points, key=lambda point: point.paint_cm3)
    axes.plot(
        [p.paint_cm3 for p in order], [100.0 * p.sigma_n for p in order], 'o-', color=ACCENT,
        linewidth=1.6, markersize=6,
    )  # fmt: skip
    axes.plot(given.paint_cm3, 100.0 * given.sigma_n, 's', color=BEFORE, markersize=8)
    axes.annotate(
        f'as given, {given.cycle_time_s:.1f} s', (given.paint_cm3, 100.0 * given.sigma_n),
        xytext=(8, 6), textcoords='offset points', fontsize=9, color=INK,
    )  # fmt: skip
    for point in order:
        axes.annotate(
            f'{point.paint_weight:g}: {point.passes} passes, {point.cycle_time_s:.1f} s',
            (point.paint_cm3, 100.0 * point.sigma_n), xytext=(8, -3),
            textcoords='offset points', fontsize=8, color=MUTED,
        )  # fmt: skip
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.2)
    return save_picture(figure, path)
