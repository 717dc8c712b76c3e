"""Charts of the report page: parity, covariates, and the learned laws."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from paint_deposition.effects.closed_forms import forms_of, variable_at
from paint_deposition.effects.learned_curves import LearnedCurve, counted_from_1
from paint_deposition.effects.learned_laws import (
    LEAST_FACTOR,
    LearnedFootprint,
    LearnedMap,
    places_m,
)
from paint_deposition.inference.diagnosis.verdict import percent
from paint_deposition.report.colour_scales import (
    ACCENT,
    BEFORE,
    COOLWARM,
    INK,
    MUTED,
    TWO_SIDED_95,
    VIRIDIS,
)
from paint_deposition.report.data import ReportData
from paint_deposition.report.words import (
    capital,
    covariate_label,
    effect_name,
    fixed,
    joined,
    p_words,
)

CLEAR = 'rgba(0,0,0,0)'
# Two of the style's colours, so pale that grid and curves show through.
PALE_ACCENT, PALE_BEFORE = 'rgba(0,112,140,0.18)', 'rgba(154,165,177,0.25)'


def _figure(
    name: str, charts: Sequence[dict], legend: Sequence[tuple[str, str, str]] = ()
) -> dict[str, Any] | None:
    """Charts beside and below each other, as the page's width allows; None without any.

    The legend of all of them has for each entry words, colour and the kind of mark: 'line',
    'bold', 'dot' or 'band'.
    """
    return {'name': name, 'charts': charts, 'legend': legend} if charts else None


def _chart(
    title: str, traces: list[dict], x: dict, y: dict, height: int, **more: Any
) -> dict[str, Any]:
    """A chart with these axes, in the style of the page.

    The page sets the title as text, so that it wraps on a narrow one.
    """
    layout = {'xaxis': x, 'yaxis': y, 'height': height}
    return {'title': title, 'data': traces, 'layout': layout | more}


def _axis(title: str, **more: Any) -> dict[str, Any]:
    return {'title': {'text': title}} | more


def _line(x: np.ndarray, y: np.ndarray, colour: str, width: float, **more: Any) -> dict[str, Any]:
    line = {'color': colour, 'width': width, 'dash': more.pop('dash', 'solid')}
    return {'type': 'scatter', 'mode': 'lines', 'x': x, 'y': y, 'line': line} | more


def _dots(x: np.ndarray, y: np.ndarray, colour: str, size: float, **more: Any) -> dict[str, Any]:
    marker = {'color': colour, 'size': size, 'opacity': more.pop('opacity', 1.0)}
    return {'type': 'scatter', 'mode': 'markers', 'x': x, 'y': y, 'marker': marker} | more


def _band(x: np.ndarray, low: np.ndarray, high: np.ndarray, colour: str) -> dict[str, Any]:
    """What lies between two curves, (N,) each at the same places (N,)."""
    there_and_back = np.concatenate([x, x[::-1]]), np.concatenate([low, high[::-1]])
    line = _line(*there_and_back, CLEAR, 0.0)
    return line | {'fill': 'toself', 'fillcolor': colour, 'hoverinfo': 'skip'}


def parity_figure(data: ReportData) -> dict[str, Any] | None:
    """Predicted against measured, with the band that the gauge's noise explains."""
    measured = data.study.measured_um
    predicted = [measured - residual for residual in data.residuals_um]
    top = 1.05 * max(measured.max(), *(p.max() for p in predicted))
    ends, spread = np.array([0.0, top]), TWO_SIDED_95 * data.study.noise_floor_um
    traces = [
        _band(ends, ends - spread, ends + spread, PALE_BEFORE),
        _line(ends, ends, MUTED, 1, hoverinfo='skip'),
    ]
    for name, values, colour in _of_each_model(data, predicted):
        hover = 'measured %{x:.2f} µm, ' + name + ' %{y:.2f} µm<extra></extra>'
        traces.append(_dots(measured, values, colour, 5.5, opacity=0.9, hovertemplate=hover))
    shared = {'range': [0, top], 'constrain': 'domain'}
    x = _axis('measured [µm]', **shared)
    y = _axis('predicted [µm]', scaleanchor='x', **shared)
    legend = [('95 % gauge and texture', BEFORE, 'band')]
    legend += [(name, colour, 'dot') for name, colour in _of_each_model(data)]
    return _figure('parity', [_chart('', traces, x, y, 400)], legend)


def _of_each_model(data: ReportData, *values: Iterable[np.ndarray]) -> Iterator[tuple]:
    """Name, values and colour of each model."""
    return zip(data.model_names, *values, data.colours, strict=True)


def covariate_figure(data: ReportData) -> dict[str, Any] | None:
    """Residual against what differs from point to point, the most telling first."""
    covariates = data.study.covariates(data.models[0])
    values = {name: counted_from_1(name, found) for name, found in covariates.items()}
    # Conditions that differ by less say nothing of the model.
    differing = {n for n, v in values.items() if np.ptp(v) > 0.01 * np.abs(v).max()}
    dependences = [d for d in data.comparisons[0].dependences.items() if d[0] in differing]
    reach = 1.1 * max(np.abs(r).max() for r in data.residuals_um)
    later = data.comparisons[-1].dependences
    charts = []
    for name, (correlation, p_value) in dependences[:8]:
        x = values[name]
        # Means of the covariate, and of each model's residual, over sixths of the readings.
        edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, 7)))
        sixth = np.minimum(np.digitize(x, edges), max(len(edges) - 1, 1))
        counted = (np.ones(len(x)), x, *data.residuals_um)
        sums = np.array([np.bincount(sixth, of_point) for of_point in counted])
        x_mean, *means = sums[1:, sums[0] > 0.0] / sums[0, sums[0] > 0.0]
        traces: list[dict] = []
        for label, residual, mean, colour in _of_each_model(data, data.residuals_um, means):
            hover = '%{y:.2f} µm at %{x:.3g}' + f'<extra>{label}</extra>'
            traces += [
                _dots(x, residual, colour, 4, opacity=0.6, hovertemplate=hover),
                _line(x_mean, mean, colour, 2.5, hoverinfo='skip'),
            ]
        text = f'ρ {fixed(correlation, signed=True)}'
        if data.improved and name in later:
            text += f' → {fixed(later[name][0], signed=True)}'
        title = f'{text}, {p_words(p_value)}'
        y_axis = _axis('residual [µm]', range=[-reach, reach], zeroline=True)
        x_axis = _axis(covariate_label(name), nticks=5)
        charts.append(_chart(title, traces, x_axis, y_axis, 220))
    legend = [(name, colour, 'dot') for name, colour in _of_each_model(data)]
    return _figure('covariates', charts, legend)


def learned_figure(data: ReportData) -> dict[str, Any] | None:
    """Each learned curve of the best model with its band and its most probable closed form.

    The range of the readings lies between dotted lines.
    """
    charts, legend = [], [('learned', ACCENT, 'bold')]
    hover = {'hovertemplate': '%{y:.3g} at %{x:.3g}<extra></extra>'}
    end = {'type': 'line', 'yref': 'paper', 'y0': 0, 'y1': 1,
           'line': {'color': MUTED, 'width': 1, 'dash': 'dot'}}  # fmt: skip
    laws = [effect for effect in data.model.effects if isinstance(effect, LearnedCurve)]
    for law in laws:
        values, factor = np.linspace(law.low, law.high, 201), law.kind == 'factor'
        curve = law.factor if factor else law.curve
        step = (law.high - law.low) / (len(law.learned) - 1)
        around = np.linspace(law.low - step, law.high + step, 201)
        with np.errstate(invalid='ignore', divide='ignore'):  # a distance to an edge has an end
            around = around[np.isfinite(law.axis(around))]
        title, x = capital(effect_name(law.id)), counted_from_1(law.covariate, values)
        traces = [
            _line(counted_from_1(law.covariate, around), curve(around), ACCENT, 2.5, **hover)
        ]
        if law.sd:
            half = TWO_SIDED_95 * law.deviation(values)
            low = np.maximum(curve(values) - half, LEAST_FACTOR if factor else -np.inf)
            traces.insert(0, _band(x, low, curve(values) + half, PALE_ACCENT))
        for form in forms_of(law)[:1]:
            traces.append(_line(x, form(variable_at(law, values)), INK, 1.5, dash='dot', **hover))
            title += f'; dots: {form.formula} ({percent(form.probability)})'
        ends = [end | {'x0': x[k], 'x1': x[k]} for k in (0, -1)]
        x_axis = _axis(covariate_label(law.covariate))
        y_axis = _axis('factor' if factor else 'addition [µm]')
        charts.append(_chart(title, traces, x_axis, y_axis, 300, shapes=ends))
    if any(law.sd for law in laws):
        legend.append(('95 % band', ACCENT, 'band'))
    return _figure('learned', charts, legend)


def map_figure(data: ReportData) -> dict[str, Any] | None:
    """Each map over a part that the best model has learned, the part as the gun sees it."""
    law, found = data.model.effect(LearnedMap.id), []
    if not isinstance(law, LearnedMap):
        return None
    for grid, values in law.values_by_part():
        parts = [e for e in data.experiments if grid.is_of(e.measured_points)]
        neutral, title = 0.0, 'addition [µm]'
        if law.kind == 'factor':
            values, neutral, title = np.maximum(1.0 + values, LEAST_FACTOR), 1.0, 'factor'
        title += ' on ' + (joined([e.name for e in parts]) or 'a part that was not measured here')
        x = np.linspace(grid.low_m[0], grid.high_m[0], grid.columns)
        y = np.linspace(grid.low_m[1], grid.high_m[1], grid.rows)
        read_m = [places_m(part.measured_points) for part in parts]
        dots = [_dots(at[:, 0], at[:, 1], INK, 3, hoverinfo='skip') for at in read_m]
        places = {'right of the centre [m]': x, 'above it [m]': y}
        found.append(_heat_map(title, places, values, _around(values, neutral), dots))
    return _figure('maps', found)


def profile_figure(data: ReportData) -> dict[str, Any] | None:
    """The footprint from its middle outward, by eq. (1) and as the readings have it."""
    left_over = data.diagnosis and data.diagnosis.discrepancy
    if not left_over:
        return None
    profile = left_over.profile
    half, radius_m = TWO_SIDED_95 * profile.sd, profile.radius_m
    low, high = (np.maximum(profile.found + of, 0.0) for of in (-half, half))
    traces = [
        _band(radius_m, low, high, PALE_ACCENT),
        _line(radius_m, profile.eq1, MUTED, 1.5),
        _line(radius_m, profile.found, ACCENT, 2.5),
    ]
    x = _axis('distance from the axis on the model plane [m]')
    legend = [
        ('eq. (1)', MUTED, 'line'), ('readings', ACCENT, 'bold'), ('95 % band', ACCENT, 'band'),
    ]  # fmt: skip
    y = _axis('flux over the peak of eq. (1)')
    return _figure('profile', [_chart('mean over the angle', traces, x, y, 300)], legend)


def footprint_figure(data: ReportData) -> dict[str, Any] | None:
    """The patterns of eq. (1), the patterns as learned, and the factor between the two."""
    law = data.model.effect(LearnedFootprint.id)
    if not isinstance(law, LearnedFootprint):
        return None
    patterns, brushes = data.model.patterns, data.model.brushes
    # As far out as the pattern matters: where it is above 2 % of its peak.
    reach = max(planar.radius_of_flux_m(0.02) for planar in patterns)
    along = np.linspace(-reach, reach, 81)
    places = {'tool x [m]': along, 'tool y [m]': along}
    x, y = np.meshgrid(along, along)
    factor = np.maximum(1.0 + law.h(x, y), LEAST_FACTOR)
    of = [f' of brush {brush.number}' for brush in brushes] if len(brushes) > 1 else ['']
    plain = [planar.flux_um_per_s(x, y) for planar in patterns]
    found = []
    for flux, whose in zip(plain, of, strict=True):
        colours = VIRIDIS, 0.0, float(max(flux.max(), (flux * factor).max()))
        for title, values in (('of eq. (1)', flux), ('as learned', flux * factor)):
            title = f'pattern {title}{whose} [µm/s]'
            found.append(_heat_map(title, places, values, colours))
    peak = float(plain[0].max())
    contours = {
        'type': 'contour', 'x': along, 'y': along, 'z': plain[0], 'showscale': False,
        'autocontour': False, 'hoverinfo': 'skip', 'line': {'color': MUTED, 'width': 1},
        'contours': {'coloring': 'none', 'start': 0.1 * peak, 'end': 0.9 * peak,
                     'size': 0.4 * peak},
    }  # fmt: skip
    title = f'factor, with contours of eq. (1){of[0]}'
    found.append(_heat_map(title, places, factor, _around(factor, 1.0), [contours]))
    return _figure('footprint', found)


def _around(values: np.ndarray, neutral: float) -> tuple[np.ndarray, float, float]:
    """Colours by how far values are from the neutral one, and the ends of their range."""
    away = max(float(np.abs(values - neutral).max()), 1e-3)
    return COOLWARM, neutral - away, neutral + away


def _heat_map(
    title: str,
    places: Mapping[str, np.ndarray],
    values: np.ndarray,
    colours: tuple[np.ndarray, float, float],
    above: Sequence[dict] = (),
) -> dict[str, Any]:
    """Values (Y, X) at places, (X,) and (Y,) by what they are, with more traces above.

    ``colours`` are the table (256, 3) and the values at its ends.
    """
    shared = {'showgrid': False, 'nticks': 6, 'constrain': 'domain'}
    (across, x), (upward, y), (table, low, high) = *places.items(), colours
    shares = np.linspace(0.0, 1.0, len(table)).round(4).tolist()
    heat = {
        'type': 'heatmap', 'x': x, 'y': y, 'z': values, 'zsmooth': 'best', 'zmin': low,
        'zmax': high, 'hovertemplate': '%{z:.3g} at %{x:.2f}, %{y:.2f} m<extra></extra>',
        'colorscale': [
            [share, f'rgb({r},{g},{b})'] for share, (r, g, b) in zip(shares, table, strict=True)
        ],
        'colorbar': {'thickness': 10, 'outlinewidth': 0,
                     'tickfont': {'size': 11, 'color': MUTED}},
    }  # fmt: skip
    x_axis = _axis(across, range=[x[0], x[-1]], **shared)
    y_axis = _axis(upward, range=[y[0], y[-1]], scaleanchor='x', **shared)
    return _chart(title, [heat, *above], x_axis, y_axis, 340)
