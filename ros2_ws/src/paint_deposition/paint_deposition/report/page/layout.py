"""Layout that all charts of the report page share."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from paint_deposition.film.colour_scales import COOLWARM, VIRIDIS
from paint_deposition.report.style import ACCENT, BEFORE, GRID, INK, MUTED

CLEAR = 'rgba(0,0,0,0)'
FONT = 'Inter, "Segoe UI", "Helvetica Neue", Arial, sans-serif'


def plotly_scale(colours: np.ndarray) -> list[list[Any]]:
    """A table of 256 RGB colours (256, 3) as plotly's colour scale."""
    places = np.linspace(0.0, 1.0, len(colours)).round(4).tolist()
    return [[place, f'rgb({r},{g},{b})'] for place, (r, g, b) in zip(places, colours, strict=True)]


FILM_COLOURS = plotly_scale(VIRIDIS)
RESIDUAL_COLOURS = plotly_scale(COOLWARM)


def base_layout(**more: Any) -> dict[str, Any]:
    """Quiet, on the page's own background, with the report's font."""
    layout = {
        'font': {'family': FONT, 'size': 12, 'color': INK},
        'paper_bgcolor': CLEAR,
        'plot_bgcolor': CLEAR,
        'margin': {'l': 48, 'r': 12, 't': 8, 'b': 44},
        'showlegend': False,
        'modebar': {'bgcolor': CLEAR, 'color': BEFORE, 'activecolor': ACCENT},
        'hoverlabel': {'font': {'family': FONT, 'size': 12}},
    }
    return layout | more


def axis(title: str = '', **more: Any) -> dict[str, Any]:
    """An axis with a thin grid and an outward tick."""
    return {
        'title': {'text': title, 'font': {'size': 12, 'color': MUTED}, 'standoff': 6},
        'gridcolor': GRID,
        'zeroline': False,
        'linecolor': BEFORE,
        'showline': True,
        'ticks': 'outside',
        'ticklen': 4,
        'tickcolor': BEFORE,
        'tickfont': {'size': 11, 'color': MUTED},
        'automargin': True,
    } | more


def zero_axis(title: str, **more: Any) -> dict[str, Any]:
    """An axis with a line at zero."""
    return axis(title, zeroline=True, zerolinecolor=MUTED, zerolinewidth=1, **more)


def scatter(x: np.ndarray, y: np.ndarray, mode: str, **more: Any) -> dict[str, Any]:
    """A trace of lines or markers, or both; named in what a reader points at."""
    return {'type': 'scatter', 'x': x, 'y': y, 'mode': mode} | more


def chart(title: str, traces: list[dict], layout: dict, height: int) -> dict[str, Any]:
    """A chart with its title, which the page sets as text so that it wraps on a narrow one."""
    return {'title': title, 'data': traces, 'layout': layout | {'height': height}}


def figure(
    name: str, charts: Sequence[dict], legend: Sequence[tuple[str, str, str]] = ()
) -> dict[str, Any]:
    """Charts that the page lays out beside and below each other, as its width allows.

    Args:
        name: of the element that shows them.
        charts: of ``chart``.
        legend: of all of them: (words, colour, 'line', 'bold', 'dots', 'dashes', 'dot' or 'ring').
    """
    keys = ('words', 'colour', 'kind')
    entries = [dict(zip(keys, entry, strict=True)) for entry in legend]
    return {'name': name, 'charts': list(charts), 'legend': entries}
