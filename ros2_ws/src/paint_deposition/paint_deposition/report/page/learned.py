"""Charts of the learned laws: curves with their closed forms, maps, footprints."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from paint_deposition.effects.learned.curves import LearnedCurve
from paint_deposition.effects.learned.law import (
    LEAST_FACTOR,
    LearnedFootprint,
    LearnedMap,
    places_m,
)
from paint_deposition.inference.diagnosis.closed_forms import forms_of, variable_at
from paint_deposition.inference.diagnosis.verdict import percent
from paint_deposition.report.data import ReportData
from paint_deposition.report.page import charts as layout
from paint_deposition.report.style import ACCENT, INK, MUTED, TWO_SIDED_95
from paint_deposition.report.words import capital, covariate_label, effect_name, joined

CURVE_POINTS = 201
# The accent, so pale that grid and curves show through.
BAND = 'rgba(0,112,140,0.18)'


def learned_figure(data: ReportData) -> dict[str, Any] | None:
    """Each learned law of the best model over its covariate."""
    laws = [effect for effect in data.model.effects if isinstance(effect, LearnedCurve)]
    if not laws:
        return None
    legend = [('learned', ACCENT, 'bold')]
    if any(law.sd for law in laws):
        legend.append(('95 % band', ACCENT, 'band'))
    return layout.figure('learned', [_curve_chart(law) for law in laws], legend)


def _curve_chart(law: LearnedCurve) -> dict[str, Any]:
    """A curve with its band and its most probable closed form; the readings' range is dotted."""
    values = np.linspace(law.low, law.high, CURVE_POINTS)
    step = (law.high - law.low) / (len(law.learned) - 1)
    around = np.linspace(law.low - step, law.high + step, CURVE_POINTS)
    with np.errstate(invalid='ignore', divide='ignore'):  # a distance to an edge has an end
        around = around[np.isfinite(law.axis(around))]
    hover = {'hovertemplate': '%{y:.3g} at %{x:.3g}<extra></extra>'}
    title, bold = capital(effect_name(law.id)), {'color': ACCENT, 'width': 2.5}
    traces = [
        layout.scatter(_shown(law, around), _of_law(law, around), 'lines', line=bold, **hover)
    ]
    if law.sd:
        traces.insert(0, _band(law, values))
    for form in forms_of(law)[:1]:
        dotted = {'color': INK, 'width': 1.5, 'dash': 'dot'}
        curve = form(variable_at(law, values))
        traces.append(layout.scatter(_shown(law, values), curve, 'lines', line=dotted, **hover))
        title += f'; dots: {form.formula} ({percent(form.probability)})'
    line = {'type': 'line', 'yref': 'paper', 'y0': 0, 'y1': 1,
            'line': {'color': MUTED, 'width': 1, 'dash': 'dot'}}  # fmt: skip
    arranged = layout.base_layout(
        xaxis=layout.axis(covariate_label(law.covariate)),
        yaxis=layout.axis('factor' if law.kind == 'factor' else 'addition [µm]'),
        shapes=[line | {'x0': end, 'x1': end} for end in _shown(law, values[[0, -1]])],
    )
    return layout.chart(title, traces, arranged, 300)


def _band(law: LearnedCurve, values: np.ndarray) -> dict[str, Any]:
    """Where the law lies at 95 %, over the range of the readings."""
    half, curve = TWO_SIDED_95 * law.deviation(values), _of_law(law, values)
    low, high = curve - half, curve + half
    if law.kind == 'factor':
        low = np.maximum(low, LEAST_FACTOR)
    there_and_back = _shown(law, np.concatenate([values, values[::-1]]))
    return layout.scatter(
        there_and_back, np.concatenate([low, high[::-1]]), 'lines', line={'width': 0},
        fill='toself', fillcolor=BAND, hoverinfo='skip',
    )  # fmt: skip


def _shown(law: LearnedCurve, values: np.ndarray) -> np.ndarray:
    """Values of the covariate as the report shows them: passes count from 1."""
    return values + (1.0 if law.covariate == 'spray_pass' else 0.0)


def _of_law(law: LearnedCurve, values: np.ndarray) -> np.ndarray:
    return law.factor(values) if law.kind == 'factor' else law.curve(values)


def map_figure(data: ReportData) -> dict[str, Any] | None:
    """Each map over a part that the best model has learned, the part as the gun sees it."""
    law = data.model.effect(LearnedMap.id)
    if not isinstance(law, LearnedMap):
        return None
    found, marker = [], {'size': 3, 'color': INK}
    for grid, values in law.values_by_part():
        parts = [e for e in data.experiments if grid.is_of(e.measured_points)]
        neutral, title = 0.0, 'addition [µm]'
        if law.kind == 'factor':
            values, neutral, title = np.maximum(1.0 + values, LEAST_FACTOR), 1.0, 'factor'
        title += ' on ' + (joined([e.name for e in parts]) or 'a part that was not measured here')
        x = np.linspace(grid.low_m[0], grid.high_m[0], grid.columns)
        y = np.linspace(grid.low_m[1], grid.high_m[1], grid.rows)
        places = [places_m(part.measured_points) for part in parts]
        dots = [layout.scatter(p[:, 0], p[:, 1], 'markers', marker=marker, hoverinfo='skip')
                for p in places]  # fmt: skip
        labels = ('right of the centre [m]', 'above it [m]')
        found.append(_heat_map(title, labels, x, y, values, _around(values, neutral), dots))
    return layout.figure('maps', found) if found else None


def profile_figure(data: ReportData) -> dict[str, Any] | None:
    """The footprint from its middle outward, by eq. (1) and as the readings have it."""
    left_over = data.diagnosis and data.diagnosis.discrepancy
    if not left_over:
        return None
    profile = left_over.profile
    half = TWO_SIDED_95 * profile.sd
    band = np.concatenate([profile.found - half, (profile.found + half)[::-1]])
    radius_m = profile.radius_m
    traces = [
        layout.scatter(
            np.concatenate([radius_m, radius_m[::-1]]), np.maximum(band, 0.0), 'lines',
            line={'width': 0}, fill='toself', fillcolor=BAND, hoverinfo='skip',
        ),
        layout.scatter(radius_m, profile.eq1, 'lines', line={'color': MUTED, 'width': 1.5}),
        layout.scatter(radius_m, profile.found, 'lines', line={'color': ACCENT, 'width': 2.5}),
    ]  # fmt: skip
    arranged = layout.base_layout(
        xaxis=layout.axis('distance from the axis on the model plane [m]'),
        yaxis=layout.axis('flux over the peak of eq. (1)'),
    )
    legend = [('eq. (1)', MUTED, 'line'), ('readings', ACCENT, 'bold')]
    legend.append(('95 % band', ACCENT, 'band'))
    chart = layout.chart('mean over the angle', traces, arranged, 300)
    return layout.figure('profile', [chart], legend)


def footprint_figure(data: ReportData) -> dict[str, Any] | None:
    """The patterns of eq. (1), the patterns as learned, and the factor between the two."""
    laws = [effect for effect in data.model.effects if isinstance(effect, LearnedFootprint)]
    if not laws:
        return None
    patterns, brushes = data.model.patterns, data.model.brushes
    # As far out as the pattern matters: where it is above 2 % of its peak.
    reach = max(planar.radius_of_flux_m(0.02) for planar in patterns)
    along, labels = np.linspace(-reach, reach, 81), ('tool x [m]', 'tool y [m]')
    x, y = np.meshgrid(along, along)
    plain = [planar.flux_um_per_s(x, y) for planar in patterns]
    factor = np.maximum(1.0 + laws[0].h(x, y), LEAST_FACTOR)
    of = [f' of brush {brush.number}' for brush in brushes] if len(brushes) > 1 else ['']
    found = []
    for flux, whose in zip(plain, of, strict=True):
        colours = layout.FILM_COLOURS, 0.0, float(max(flux.max(), (flux * factor).max()))
        for title, values in (('of eq. (1)', flux), ('as learned', flux * factor)):
            title = f'pattern {title}{whose} [µm/s]'
            found.append(_heat_map(title, labels, along, along, values, colours))
    # Contours of the pattern of eq. (1), as shares of its peak.
    contours = [
        {
            'type': 'contour', 'x': along, 'y': along, 'z': plain[0], 'showscale': False,
            'autocontour': False, 'hoverinfo': 'skip', 'line': {'color': MUTED, 'width': 1},
            'contours': {'type': 'constraint', 'operation': '=', 'value': share * plain[0].max()},
            'showlegend': False,
        }
        for share in (0.1, 0.5, 0.9)
    ]  # fmt: skip
    title = f'factor, with contours of eq. (1){of[0]}'
    found.append(_heat_map(title, labels, along, along, factor, _around(factor, 1.0), contours))
    return layout.figure('footprint', found)


def _around(values: np.ndarray, neutral: float) -> tuple[list, float, float]:
    """Colours by how far values are from the neutral one, and the ends of their range."""
    away = max(float(np.abs(values - neutral).max()), 1e-3)
    return layout.RESIDUAL_COLOURS, neutral - away, neutral + away


def _heat_map(
    title: str,
    labels: tuple[str, str],
    x: np.ndarray,
    y: np.ndarray,
    values: np.ndarray,
    colours: tuple[list, float, float],
    above: Sequence[dict] = (),
) -> dict[str, Any]:
    """Values (Y, X) at places (X,) and (Y,) in these colours, with more traces above."""
    shared = {'showgrid': False, 'nticks': 6, 'constrain': 'domain'}
    arranged = layout.base_layout(
        xaxis=layout.axis(labels[0], range=[x[0], x[-1]], **shared),
        yaxis=layout.axis(labels[1], range=[y[0], y[-1]], scaleanchor='x', **shared),
    )
    heat = {
        'type': 'heatmap', 'x': x, 'y': y, 'z': values, 'zsmooth': 'best',
        'zmin': colours[1], 'zmax': colours[2], 'colorscale': colours[0],
        'hovertemplate': '%{z:.3g} at %{x:.2f}, %{y:.2f} m<extra></extra>',
        'colorbar': {'thickness': 10, 'outlinewidth': 0,
                     'tickfont': {'size': 11, 'color': MUTED}},
    }  # fmt: skip
    return layout.chart(title, [heat, *above], arranged, 340)
