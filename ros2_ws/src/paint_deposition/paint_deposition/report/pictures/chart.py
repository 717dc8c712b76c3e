"""What charts drawn with matplotlib share: colours, quiet axes, and how they reach a file."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from paint_deposition.files.atomic import replacing
from paint_deposition.report.page.style import ACCENT, BEFORE, GRID, INK, MUTED

DOTS_PER_INCH = 150
MEASURED = INK
MODEL = ACCENT
COMPONENTS = ('#d1701f', '#7a5195', '#4c9a2a')
MARK = '#c0392b'
BAND = '#d9ecf0'
__all__ = ('ACCENT', 'BAND', 'BEFORE', 'COMPONENTS', 'INK', 'MARK', 'MEASURED', 'MODEL', 'MUTED')


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that draws into memory, without pyplot's global state."""
    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout='constrained')
    FigureCanvasAgg(figure)
    return figure


def quiet(axes: Axes, x_label: str, y_label: str, title: str = '') -> None:
    """Thin grid, no box, labels in the muted colour."""
    axes.grid(True, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)
    for side in ('left', 'bottom'):
        axes.spines[side].set_color(BEFORE)
    axes.tick_params(colors=MUTED, labelsize=9)
    axes.set_xlabel(x_label, color=MUTED, fontsize=10)
    axes.set_ylabel(y_label, color=MUTED, fontsize=10)
    axes.set_title(title, loc='left', fontsize=11, color=INK)


def legend(axes: Axes, **options: object) -> None:
    """A legend without a frame."""
    axes.legend(frameon=False, fontsize=9, labelcolor=INK, **options)


def save_png(figure: Figure, path: str | Path) -> Path:
    """Write the figure, replacing an older file at once."""
    with replacing(path) as temporary:
        figure.savefig(temporary, format='png', dpi=DOTS_PER_INCH)
    return Path(path)
