"""Layout that all charts of the report page share."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from paint_deposition.film.colour_tables import COOLWARM, VIRIDIS
from paint_deposition.report.style import BEFORE, GRID, INK, MUTED

FONT = 'Inter, "Segoe UI", "Helvetica Neue", Arial, sans-serif'


def plotly_scale(table: bytes) -> list[list[Any]]:
    """A table of 256 RGB colours as plotly's colour scale."""
    colours = np.frombuffer(table, dtype=np.uint8).reshape(-1, 3)
    places = np.linspace(0.0, 1.0, len(colours)).round(4).tolist()
    return [[place, f'rgb({r},{g},{b})'] for place, (r, g, b) in zip(places, colours, strict=True)]


FILM_COLOURS = plotly_scale(VIRIDIS)
RESIDUAL_COLOURS = plotly_scale(COOLWARM)


def base_layout(**more: Any) -> dict[str, Any]:
    """White, quiet, with the report's font."""
    layout = {
        'font': {'family': FONT, 'size': 12, 'color': INK},
        'paper_bgcolor': 'white',
        'plot_bgcolor': 'white',
        'margin': {'l': 56, 'r': 16, 't': 48, 'b': 48},
        'hoverlabel': {'font': {'family': FONT, 'size': 12}},
        'legend': {
            'orientation': 'h', 'x': 0, 'y': 1.0, 'yanchor': 'bottom', 'xanchor': 'left',
            'font': {'size': 12},
        },
    }  # fmt: skip
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
    """A trace of lines or markers, or both; without a name it is not in the legend."""
    return {'type': 'scatter', 'x': x, 'y': y, 'mode': mode, 'showlegend': 'name' in more} | more


def figure(name: str, traces: list[dict], layout: dict, height: int) -> dict[str, Any]:
    """What the page's script draws into the element that asks for ``name``."""
    return {'name': name, 'data': traces, 'layout': layout | {'height': height}}


def chart_title(text: str, number: int, size: int = 12) -> dict[str, Any]:
    """A line of text over the upper left corner of a small chart, the one with these axes."""
    return {
        'text': text, 'x': 0, 'y': 1, 'xref': f'x{number} domain', 'yref': f'y{number} domain',
        'xanchor': 'left', 'yanchor': 'bottom', 'showarrow': False,
        'font': {'size': size, 'color': INK},
    }  # fmt: skip


def grid_domains(
    count: int, columns: int, height_px: int, gap_px: tuple[int, int]
) -> Iterator[tuple[list[float], list[float]]]:
    """Domains (x, y) of small charts in rows from the top.

    Args:
        count, columns: how many charts, and in a row.
        height_px: of the plot without its margins.
        gap_px: between charts, across on a page 1100 px wide, and down.
    """
    columns = min(columns, count)
    rows = -(-count // columns)
    gap_x, gap_y = gap_px[0] / 1100.0, gap_px[1] / height_px
    width = (1.0 - gap_x * (columns - 1)) / columns
    height = (1.0 - gap_y * (rows - 1)) / rows
    for k in range(count):
        left = (k % columns) * (width + gap_x)
        top = 1.0 - (k // columns) * (height + gap_y)
        yield [left, min(left + width, 1.0)], [max(top - height, 0.0), min(top, 1.0)]
