"""Colours that pictures and page share, quiet axes, and how a figure reaches a file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure, FigureBase

from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import replacing
from paint_deposition.report.colour_scales import TABLE, ColourScale

INK = '#1f2933'
MUTED = '#616e7c'
GRID = '#e4e7eb'
BEFORE = '#9aa5b1'
ACCENT = '#00708c'
# Film below, within and above the target band, and bare metal; distinct to the colour-blind too.
BELOW, WITHIN, HIGH, BARE = '#3f6fb0', '#b9dcae', '#e07b1f', '#9e9e9e'
COMPONENTS = ('#d1701f', '#7a5195', '#4c9a2a')
# Models side by side; as many as can be distinguished.
MODELS = (ACCENT, *COMPONENTS, '#b5485f', '#8a7a2b')
# 95 % of normally distributed readings lie within so many standard deviations.
TWO_SIDED_95 = 1.96
DOTS_PER_INCH = 150
# Pictures of a page are as wide as a phone or half a sheet of paper [in], so that their lettering
# is that of the page.
PAGE_IN, TEXT_PT = 3.8, 8.0
MM = 1e3


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that draws into memory, without pyplot's global state."""
    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout='constrained')
    FigureCanvasAgg(figure)
    return figure


def quiet(axes: Axes, x_label: str, y_label: str, title: str = '', size: float = 10.0) -> None:
    """Thin grid, no box, labels in the muted colour and this size [pt]."""
    axes.grid(True, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)
    axes.spines[['left', 'bottom']].set_color(BEFORE)
    axes.tick_params(colors=MUTED, labelsize=size - 1.0)
    axes.set_xlabel(x_label, color=MUTED, fontsize=size)
    axes.set_ylabel(y_label, color=MUTED, fontsize=size)
    # A title that looks for its own height costs a third of the drawing.
    axes.set_title(title, loc='left', fontsize=size + 1.0, color=INK, y=1.0)


def legend(axes: Axes, **options: Any) -> None:
    """A legend without a frame."""
    axes.legend(frameon=False, fontsize=9, labelcolor=INK, **options)


def colour_bar(figure: FigureBase, axes: Sequence[Axes], label: str, scale: ColourScale) -> None:
    """A level bar of the colours below all these axes."""
    bar = figure.colorbar(
        colours_of(scale), ax=list(axes), location='bottom', shrink=0.6, aspect=30, pad=0.04
    )
    bar.set_label(label, color=MUTED)
    bar.ax.spines['outline'].set_visible(False)


def colours_of(scale: ColourScale) -> ScalarMappable:
    """What matplotlib makes a bar of colours from."""
    palette = ListedColormap(scale.palette[:TABLE] / 255.0)
    return ScalarMappable(Normalize(scale.low, scale.high), palette)


def save_picture(figure: Figure, path: str | Path) -> Path:
    """Write the figure as PNG, SVG or PDF, by the suffix, replacing an older file at once."""
    path = Path(path)
    if path.suffix not in ('.png', '.svg', '.pdf'):
        raise PaintError(f'{path}: give a picture a name that ends in .png, .svg or .pdf')
    with replacing(path) as temporary:
        figure.savefig(
            temporary, format=path.suffix.removeprefix('.'), dpi=DOTS_PER_INCH, facecolor='white'
        )
    return path
