"""Charts of the learned laws: curves beside the nearest law of the library, maps, footprints."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.learned.curves import LearnedCurve
from paint_deposition.effects.learned.footprint import LearnedFootprint
from paint_deposition.effects.learned.law import LEAST_FACTOR
from paint_deposition.effects.learned.place import LearnedMap, places_m
from paint_deposition.inference.diagnosis.closed_forms import forms_of, variable_at
from paint_deposition.inference.diagnosis.verdict import percent
from paint_deposition.kernel.laws import Ray
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
from paint_deposition.report.style import ACCENT, INK, MUTED, TWO_SIDED_95
from paint_deposition.report.words import capital, covariate_label, effect_name, joined

CURVE_POINTS = 201
# Values tried of an amplitude and of a shape when a law of the library is fitted to a curve.
AMPLITUDES, SHAPES = 41, 5
# The accent, so pale that grid and curves show through.
BAND = 'rgba(0,112,140,0.18)'
# Share of a curve's variance that a law must explain to be called near.
NEAR = 0.5
HEIGHT_PX = 340
# Cells of a footprint from one side to the other, and how far out the pattern matters: where it
# is above this share of its peak.
CELLS, FAINT = 81, 0.02
# Contours of the pattern of eq. (1), as shares of its peak.
CONTOURS = (0.1, 0.5, 0.9)


def learned_figure(data: ReportData) -> dict[str, Any] | None:
    """Each learned law of the best model over its covariate."""
    laws = [effect for effect in data.model.effects if isinstance(effect, LearnedCurve)]
    if not laws:
        return None
    library = dict(EFFECTS) | dict(data.diagnosis.library if data.diagnosis else {})
    charts, legend = [], [('learned', ACCENT, 'bold')]
    if any(law.sd for law in laws):
        legend.append(('95 % band', ACCENT, 'band'))
    for law in laws:
        ends = [
            {'type': 'line', 'yref': 'paper', 'x0': end, 'x1': end, 'y0': 0, 'y1': 1,
             'line': {'color': MUTED, 'width': 1, 'dash': 'dot'}}
            for end in _shown(law, np.array([law.low, law.high]))
        ]  # fmt: skip
        layout = base_layout(
            xaxis=axis(covariate_label(law.covariate)),
            yaxis=axis('factor' if law.kind == 'factor' else 'addition [µm]'),
            shapes=ends,
        )
        title, traces = _traces(law, library)
        charts.append(chart(title, traces, layout, 300))
    return figure('learned', charts, legend)


def _traces(law: LearnedCurve, library: Mapping[str, type[Effect]]) -> tuple[str, list[dict]]:
    """A title, and the curve with that of the nearest law of the library."""
    values = np.linspace(law.low, law.high, CURVE_POINTS)
    step = (law.high - law.low) / (len(law.learned) - 1)
    around = np.linspace(law.low - step, law.high + step, CURVE_POINTS)
    with np.errstate(invalid='ignore', divide='ignore'):  # a distance to an edge has an end
        around = around[np.isfinite(law.axis(around))]
    hover = {'hovertemplate': '%{y:.3g} at %{x:.3g}<extra></extra>'}
    title, bold = capital(effect_name(law.id)), {'color': ACCENT, 'width': 2.5}
    traces = [scatter(_shown(law, around), _of_law(law, around), 'lines', line=bold, **hover)]
    if law.sd:
        traces.insert(0, _band(law, values))
    near = nearest_law(law, library, values)
    if near is not None:
        effect, curve = near
        dashed = {'color': INK, 'width': 1.5, 'dash': 'dash'}
        traces.append(scatter(_shown(law, values), curve, 'lines', line=dashed, **hover))
        title += f'; dashed: law of {effect_name(effect.id)}'
    for form in forms_of(law)[:1]:
        dotted = {'color': INK, 'width': 1.5, 'dash': 'dot'}
        curve = form(variable_at(law, values))
        traces.append(scatter(_shown(law, values), curve, 'lines', line=dotted, **hover))
        title += f'; dots: {form.formula} ({percent(form.probability)})'
    return title, traces


def _band(law: LearnedCurve, values: np.ndarray) -> dict[str, Any]:
    """Where the law lies at 95 %, over the range of the readings."""
    half, curve = TWO_SIDED_95 * law.deviation(values), _of_law(law, values)
    low, high = curve - half, curve + half
    if law.kind == 'factor':
        low = np.maximum(low, LEAST_FACTOR)
    there_and_back = _shown(law, np.concatenate([values, values[::-1]]))
    return scatter(
        there_and_back, np.concatenate([low, high[::-1]]), 'lines', line={'width': 0},
        fill='toself', fillcolor=BAND, hoverinfo='skip',
    )  # fmt: skip


def _shown(law: LearnedCurve, values: np.ndarray) -> np.ndarray:
    """Values of the covariate as the report shows them: passes count from 1."""
    return values + (1.0 if law.covariate == 'spray_pass' else 0.0)


def _of_law(law: LearnedCurve, values: np.ndarray) -> np.ndarray:
    return law.factor(values) if law.kind == 'factor' else law.curve(values)


def nearest_law(
    law: LearnedCurve, library: Mapping[str, type[Effect]], values: np.ndarray
) -> tuple[Effect, np.ndarray] | None:
    """The effect whose law over the same covariate is nearest to a learned one.

    Nearest up to a constant factor, or for an addition a constant, which the pattern takes up.

    Args:
        law: the learned law.
        library: effects by id.
        values: (N,) of the covariate, over the range of the law.

    Returns:
        The effect and its curve (N,) with the constant; None if none comes near.
    """
    learned = _of_law(law, values)
    constant = float(np.var(learned))
    found: list[tuple[float, Effect, np.ndarray]] = []
    for effect in _effects_over(law, library):
        curve = curve_of(effect, law, values)
        if curve is None:
            continue
        if law.kind == 'factor':
            curve = curve * float(curve @ learned) / max(float(curve @ curve), 1e-12)
        else:
            curve = curve + float(np.mean(learned - curve))
        found.append((float(np.mean((curve - learned) ** 2)), effect, curve))
    if not found or min(entry[0] for entry in found) > (1.0 - NEAR) * constant:
        return None
    _, effect, curve = min(found, key=lambda entry: entry[0])
    return effect, curve


def _effects_over(law: LearnedCurve, library: Mapping[str, type[Effect]]) -> Iterator[Effect]:
    """Effects of one amplitude whose own law is over the covariate, in many sizes and shapes."""
    for effect in library.values():
        if law.covariate not in effect.covariates or effect.free_law != law.kind:
            continue
        if len(effect.amplitudes()) != 1:
            continue
        choices = [
            np.linspace(at['low'], at['high'], AMPLITUDES) if at['role'] == 'amplitude'
            else np.geomspace(at['low'], at['high'], SHAPES)
            for at in effect.parameters().values()
        ]  # fmt: skip
        for chosen in product(*choices):
            yield effect(**dict(zip(effect.parameters(), map(float, chosen), strict=True)))


def curve_of(effect: Effect, law: LearnedCurve, values: np.ndarray) -> np.ndarray | None:
    """(N,) factor or addition [um] of an effect at values (N,) of a learned law's covariate.

    None where the effect acts on the path, or by more than this covariate.
    """
    if effect.flux_factor is not None:
        flux_factor, numbers = effect.flux_factor, effect.values()
        plain = Ray(0.0, 0.0, 1.0, 1.0, 0.0)
        rays = {
            'incidence_deg': lambda v: plain._replace(cos_incidence=float(np.cos(np.radians(v)))),
            'standoff_ratio': lambda v: plain._replace(standoff_ratio=float(v)),
        }
        ray = rays.get(law.covariate)
        return None if ray is None else np.array([flux_factor(ray(v), *numbers) for v in values])
    points: Any = SimpleNamespace(**{law.covariate: values})
    film = np.ones(len(values))
    try:
        shown = effect.on_gauge(effect.on_film(film, points), points)
    except AttributeError:
        return None
    if shown is film:
        return None
    return shown if law.kind == 'factor' else shown - film


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
