"""Heat maps of learned laws that are no curves: maps over a part, and footprints."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paint_deposition.effects.learned.footprint import LearnedFootprint
from paint_deposition.effects.learned.law import LEAST_FACTOR
from paint_deposition.effects.learned.place import LearnedMap, places_m
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.layout import (
    FILM_COLOURS,
    RESIDUAL_COLOURS,
    axis,
    base_layout,
    chart,
    figure,
    scatter,
)
from paint_deposition.report.style import INK, MUTED
from paint_deposition.report.words import joined

HEIGHT_PX = 340
# Cells of a footprint from one side to the other, and how far out the pattern matters: where it
# is above this share of its peak.
CELLS, FAINT = 81, 0.02
# Contours of the pattern of eq. (1), as shares of its peak.
CONTOURS = (0.1, 0.5, 0.9)


@dataclass(frozen=True)
class _Panel:
    """One heat map.

    Attributes:
        title, across, up: of the chart and its axes.
        x, y: (X,) and (Y,) places. values: (Y, X) there.
        scale: colours. low, high: their range.
        above: further traces over it.
    """

    title: str
    across: str
    up: str
    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    scale: list[list[Any]]
    low: float
    high: float
    above: Sequence[dict] = ()


def map_figure(data: ReportData) -> dict[str, Any] | None:
    """Each map over a part that the best model has learned, the part as the gun sees it."""
    law = data.model.effect(LearnedMap.id)
    if not isinstance(law, LearnedMap):
        return None
    panels = []
    for grid, values in law.on_parts():
        parts = [e for e in data.experiments if grid.is_of(e.measured_points)]
        neutral = 0.0
        if law.kind == 'factor':
            values, neutral = np.maximum(1.0 + values, LEAST_FACTOR), 1.0
        x = np.linspace(grid.low_m[0], grid.high_m[0], grid.columns)
        y = np.linspace(grid.low_m[1], grid.high_m[1], grid.rows)
        title = 'factor' if law.kind == 'factor' else 'addition [µm]'
        title += ' on ' + (joined([e.name for e in parts]) or 'a part that was not measured here')
        places = [places_m(part.measured_points) for part in parts]
        dots = [
            scatter(place[:, 0], place[:, 1], 'markers', marker={'size': 3, 'color': INK},
                    hoverinfo='skip')
            for place in places
        ]  # fmt: skip
        panel = _about(neutral, values, title, 'right of the centre [m]', 'above it [m]', x, y)
        panels.append(replace(panel, above=dots))
    return _figure('maps', panels)


def footprint_figure(data: ReportData) -> dict[str, Any] | None:
    """The patterns of eq. (1), the patterns as learned, and the factor between the two."""
    laws = [effect for effect in data.model.effects if isinstance(effect, LearnedFootprint)]
    if not laws:
        return None
    patterns, brushes = data.model.patterns, data.model.brushes
    reach = max(planar.radius_of_flux_m(FAINT) for planar in patterns)
    along = np.linspace(-reach, reach, CELLS)
    x, y = np.meshgrid(along, along)
    plain = [planar.flux_um_per_s(x, y) for planar in patterns]
    factor = np.maximum(1.0 + laws[0].h(x, y), LEAST_FACTOR)
    of = [f' of brush {brush.number}' for brush in brushes] if len(brushes) > 1 else ['']
    panels = []
    for flux, whose in zip(plain, of, strict=True):
        top = float(max(flux.max(), (flux * factor).max()))
        for title, values in (
            (f'pattern of eq. (1){whose} [µm/s]', flux),
            (f'pattern as learned{whose} [µm/s]', flux * factor),
        ):
            panels.append(
                _Panel(
                    title, 'tool x [m]', 'tool y [m]', along, along, values, FILM_COLOURS, 0.0, top
                )
            )
    title = f'factor, with contours of eq. (1){of[0]}'
    contours = [
        {
            'type': 'contour', 'x': along, 'y': along, 'z': plain[0], 'showscale': False,
            'autocontour': False, 'hoverinfo': 'skip', 'line': {'color': MUTED, 'width': 1},
            'contours': {'type': 'constraint', 'operation': '=', 'value': share * plain[0].max()},
            'showlegend': False,
        }
        for share in CONTOURS
    ]  # fmt: skip
    panel = _about(1.0, factor, title, 'tool x [m]', 'tool y [m]', along, along)
    return _figure('footprint', [*panels, replace(panel, above=contours)])


def _about(neutral: float, values: np.ndarray, *where: Any) -> _Panel:
    """A panel coloured by how far values are from the neutral one."""
    title, across, up, x, y = where
    away = max(float(np.abs(values - neutral).max()), 1e-3)
    return _Panel(
        title, across, up, x, y, values, RESIDUAL_COLOURS, neutral - away, neutral + away
    )


def _figure(name: str, panels: Sequence[_Panel]) -> dict[str, Any] | None:
    """The panels as heat maps; None without any."""
    charts = []
    for panel in panels:
        shared = {'showgrid': False, 'nticks': 6, 'constrain': 'domain'}
        layout = base_layout(
            xaxis=axis(panel.across, range=[panel.x[0], panel.x[-1]], **shared),
            yaxis=axis(panel.up, range=[panel.y[0], panel.y[-1]], scaleanchor='x', **shared),
        )
        heat = {
            'type': 'heatmap', 'x': panel.x, 'y': panel.y, 'z': panel.values,
            'zmin': panel.low, 'zmax': panel.high, 'colorscale': panel.scale, 'zsmooth': 'best',
            'hovertemplate': '%{z:.3g} at %{x:.2f}, %{y:.2f} m<extra></extra>',
            'colorbar': {'thickness': 10, 'outlinewidth': 0,
                         'tickfont': {'size': 11, 'color': MUTED}},
        }  # fmt: skip
        charts.append(chart(panel.title, [heat, *panel.above], layout, HEIGHT_PX))
    return figure(name, charts) if charts else None
