"""Flat charts of the report: parity, covariates, history, the unexplained."""

from typing import Any

import numpy as np
from scipy.stats import binned_statistic

from paint_deposition.report.data import ReportData
from paint_deposition.report.page.layout import (
    axis,
    base_layout,
    chart_title,
    figure,
    grid_domains,
)
from paint_deposition.report.style import ACCENT, BEFORE, GRID, INK, MUTED, TWO_SIDED_95
from paint_deposition.report.words import covariate_label, p_words, step_words

COVARIATES_A_ROW = 4
MOST_COVARIATES = 8
BINS = 6
# Conditions that differ by less than this share say nothing of the model.
LEAST_SPREAD = 0.01


def parity_figure(data: ReportData) -> dict[str, Any]:
    """Predicted against measured, with the band that the gauge's noise explains."""
    measured = data.study.measured_um
    predicted = [measured - residual for residual in data.residuals_um]
    top = 1.05 * max(measured.max(), *(p.max() for p in predicted))
    ends = np.linspace(0.0, top, 40)
    order = np.argsort(measured)
    spread = TWO_SIDED_95 * data.study.noise_floor_um
    traces: list[dict] = [
        {'type': 'scatter', 'x': ends, 'y': ends + spread, 'mode': 'lines',
         'line': {'width': 0}, 'hoverinfo': 'skip', 'showlegend': False},
        {'type': 'scatter', 'x': ends, 'y': ends - spread, 'mode': 'lines', 'fill': 'tonexty',
         'fillcolor': 'rgba(154,165,177,0.25)', 'line': {'width': 0}, 'hoverinfo': 'skip',
         'name': '95 % gauge noise'},
        {'type': 'scatter', 'x': ends, 'y': ends, 'mode': 'lines', 'hoverinfo': 'skip',
         'line': {'color': MUTED, 'width': 1}, 'showlegend': False},
    ]  # fmt: skip
    for name, values, marker in _before_and_after(data, predicted):
        traces.append({
            'type': 'scatter', 'x': measured[order], 'y': values[order], 'mode': 'markers',
            'name': name, 'marker': marker,
            'hovertemplate': 'measured %{x:.2f} µm, ' + name + ' %{y:.2f} µm<extra></extra>',
        })  # fmt: skip
    layout = base_layout(
        xaxis=axis('measured [µm]', range=[0, top], constrain='domain'),
        yaxis=axis('predicted [µm]', range=[0, top], scaleanchor='x', constrain='domain'),
    )
    layout['legend']['traceorder'] = 'normal'
    return figure('parity', traces, layout, 420)


def _before_and_after(
    data: ReportData, values: list[np.ndarray]
) -> list[tuple[str, np.ndarray, dict[str, Any]]]:
    """Name, values and marker of each model, the last one in the strong colour."""
    colours = (BEFORE, ACCENT) if data.improved else (ACCENT,)
    return [
        (name, value, {'size': 5.5, 'color': colour, 'opacity': 0.9})
        for name, value, colour in zip(data.model_names, values, colours, strict=True)
    ]


def covariate_figure(data: ReportData) -> dict[str, Any] | None:
    """Residual against what differs from point to point, the most telling first."""
    values = _conditions(data)
    differing = {n for n, v in values.items() if np.ptp(v) > LEAST_SPREAD * np.abs(v).max()}
    dependences = [d for d in data.comparisons[0].dependences if d.covariate in differing]
    dependences = dependences[:MOST_COVARIATES]
    if not dependences:
        return None
    rows = -(-len(dependences) // min(COVARIATES_A_ROW, len(dependences)))
    height = 96 + 220 * rows
    layout = base_layout(margin={'l': 48, 'r': 12, 't': 56, 'b': 40}, annotations=[])
    layout['legend'] |= {'y': 1.0 + 30 / (height - 96)}
    reach = 1.1 * max(np.abs(r).max() for r in data.residuals_um)
    later = {d.covariate: d for d in data.comparisons[-1].dependences}
    traces: list[dict] = []
    domains = grid_domains(len(dependences), COVARIATES_A_ROW, height - 96, (36, 74))
    for k, (dependence, (x, y)) in enumerate(zip(dependences, domains, strict=True), start=1):
        name = '' if k == 1 else str(k)
        where = {'xaxis': f'x{name}', 'yaxis': f'y{name}'}
        for label, residual, marker in _before_and_after(data, data.residuals_um):
            traces += _dependence_traces(
                values[dependence.covariate], residual, label, marker, where, k == 1
            )
        layout[f'xaxis{name}'] = axis(
            covariate_label(dependence.covariate), domain=x, anchor=f'y{name}', nticks=5
        )
        layout[f'yaxis{name}'] = axis(
            'residual [µm]' if x[0] == 0.0 else '', domain=y, anchor=f'x{name}',
            range=[-reach, reach], zeroline=True, zerolinecolor=MUTED, zerolinewidth=1,
        )  # fmt: skip
        text = f'ρ {dependence.correlation:+.2f}'
        after = later.get(dependence.covariate)
        if data.improved and after is not None:
            text += f' → {after.correlation:+.2f}'
        text += f', {p_words(dependence.p_value)}'
        layout['annotations'].append(chart_title(text.replace('-', '−'), x[0], y[1], 11))
    return figure('covariates', traces, layout, height)


def _conditions(data: ReportData) -> dict[str, np.ndarray]:
    """Covariates of the first model at the points; passes count from 1, as on the 3D part."""
    values = {c.name: c.values for c in data.study.covariates(data.models[0])}
    return values | {'spray_pass': values['spray_pass'] + 1.0}


def _dependence_traces(
    x: np.ndarray,
    residual: np.ndarray,
    label: str,
    marker: dict[str, Any],
    where: dict[str, Any],
    first: bool,
) -> list[dict]:
    common = where | {'type': 'scatter', 'legendgroup': label, 'name': label}
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
    traces = [common | {
        'x': x, 'y': residual, 'mode': 'markers', 'showlegend': first,
        'marker': marker | {'size': 4, 'opacity': 0.6},
        'hovertemplate': '%{y:.2f} µm at %{x:.3g}<extra>' + label + '</extra>',
    }]  # fmt: skip
    if len(edges) > 2:
        mean_x, mean_r = (binned_statistic(x, v, 'mean', edges).statistic for v in (x, residual))
        filled = np.isfinite(mean_x)
        traces.append(common | {
            'x': mean_x[filled], 'y': mean_r[filled], 'mode': 'lines', 'showlegend': False,
            'line': {'color': marker['color'], 'width': 2.5}, 'hoverinfo': 'skip',
        })  # fmt: skip
    return traces


def history_figure(data: ReportData) -> dict[str, Any] | None:
    """Errors of each model fitted to this campaign against the gauge's noise."""
    if data.diagnosis is None or len(data.diagnosis.history) < 2:
        return None
    steps = data.diagnosis.history
    names = [step_words(step) for step in data.history[-len(steps) :]]
    bars = [
        ('fitted points', [s.rmse_um for s in steps], BEFORE, INK),
        ('points left out', [s.holdout_rmse_um for s in steps], ACCENT, 'white'),
    ]
    traces = [
        {'type': 'bar', 'x': names, 'y': values, 'name': name, 'marker': {'color': colour},
         'text': [f'{v:.2f}' for v in values], 'textposition': 'inside',
         'insidetextanchor': 'start', 'textangle': 0, 'insidetextfont': {'color': text},
         'hovertemplate': name + ': %{y:.2f} µm<extra></extra>'}
        for name, values, colour, text in bars
    ]  # fmt: skip
    floor = data.diagnosis.noise_floor_um
    top = 1.15 * max(*(max(values) for _, values, _, _ in bars), floor)
    layout = base_layout(
        margin={'l': 56, 'r': 64, 't': 48, 'b': 48}, barmode='group',
        bargap=0.45, bargroupgap=0.06,
        xaxis=axis('', ticks='', tickfont={'size': 12, 'color': INK}),
        yaxis=axis('RMSE [µm]', range=[0, top]),
        shapes=[{'type': 'line', 'xref': 'paper', 'x0': 0, 'x1': 1, 'y0': floor, 'y1': floor,
                 'line': {'color': INK, 'width': 1.5, 'dash': 'dash'}}],
        annotations=[{
            'xref': 'paper', 'x': 1.01, 'y': floor, 'xanchor': 'left', 'yanchor': 'middle',
            'showarrow': False, 'text': f'gauge<br>noise<br>{floor:.2f} µm',
            'font': {'size': 11, 'color': INK}, 'align': 'left',
        }],
    )  # fmt: skip
    return figure('history', traces, layout, 420)


def unknown_figure(data: ReportData) -> dict[str, Any] | None:
    """Mean residual along the covariate where the unexplained shows."""
    unknown = data.diagnosis.unknown if data.diagnosis else None
    if unknown is None or len(unknown.curve) < 2:
        return None
    covariate, y = list(unknown.curve.values())[:2]
    x = np.add(covariate, 1.0 if unknown.covariate == 'spray_pass' else 0.0)
    hover = {'hovertemplate': '%{y:.2f} µm at %{x:.3g}<extra></extra>'}
    traces = [
        hover | {
            'type': 'scatter', 'mode': 'markers', 'name': 'residual of each point',
            'x': _conditions(data)[unknown.covariate], 'y': data.residuals_um[-1],
            'marker': {'size': 5, 'color': BEFORE},
        },
        hover | {
            'type': 'scatter', 'x': x, 'y': y, 'mode': 'lines', 'name': 'smoothed',
            'line': {'color': ACCENT, 'width': 2.5},
        },
    ]  # fmt: skip
    layout = base_layout(
        xaxis=axis(covariate_label(unknown.covariate)),
        yaxis=axis('residual [µm]', zeroline=True, zerolinecolor=MUTED, gridcolor=GRID),
    )
    return figure('unknown', traces, layout, 320)
