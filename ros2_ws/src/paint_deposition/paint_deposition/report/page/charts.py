"""Flat charts of the report: parity, covariates, the unexplained."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from paint_deposition.report.data import ReportData
from paint_deposition.report.page import layout
from paint_deposition.report.style import ACCENT, BEFORE, MUTED, TWO_SIDED_95
from paint_deposition.report.words import covariate_label, fixed, p_words

MOST_COVARIATES = 8
BINS = 6
# Conditions that differ by less than this share say nothing of the model.
LEAST_SPREAD = 0.01
AT_VALUE = '%{y:.2f} µm at %{x:.3g}'


def parity_figure(data: ReportData) -> dict[str, Any]:
    """Predicted against measured, with the band that the gauge's noise explains."""
    measured = data.study.measured_um
    predicted = [measured - residual for residual in data.residuals_um]
    top = 1.05 * max(measured.max(), *(p.max() for p in predicted))
    ends = np.array([0.0, top])
    spread = TWO_SIDED_95 * data.study.noise_floor_um
    bound = {'line': {'width': 0}, 'hoverinfo': 'skip'}
    traces = [
        layout.scatter(ends, ends + spread, 'lines', **bound),
        layout.scatter(ends, ends - spread, 'lines', **bound, fill='tonexty',
                fillcolor='rgba(154,165,177,0.25)'),
        layout.scatter(ends, ends, 'lines', hoverinfo='skip', line={'color': MUTED, 'width': 1}),
    ]  # fmt: skip
    for name, values, colour in _of_each_model(data, predicted):
        hover = 'measured %{x:.2f} µm, ' + name + ' %{y:.2f} µm<extra></extra>'
        marker = {'size': 5.5, 'color': colour, 'opacity': 0.9}
        traces.append(
            layout.scatter(measured, values, 'markers', marker=marker, hovertemplate=hover)
        )
    arranged = layout.base_layout(
        xaxis=layout.axis('measured [µm]', range=[0, top], constrain='domain'),
        yaxis=layout.axis('predicted [µm]', range=[0, top], scaleanchor='x', constrain='domain'),
    )
    legend = [('95 % gauge and texture', BEFORE, 'band'), *_legend(data)]
    return layout.figure('parity', [layout.chart('', traces, arranged, 400)], legend)


def _legend(data: ReportData) -> list[tuple[str, str, str]]:
    return [(name, colour, 'dot') for name, colour in _of_each_model(data)]


def _of_each_model(data: ReportData, *values: Iterable[np.ndarray]) -> Iterator[tuple]:
    """Name, values and colour of each model."""
    return zip(data.model_names, *values, data.colours, strict=True)


def covariate_figure(data: ReportData) -> dict[str, Any] | None:
    """Residual against what differs from point to point, the most telling first."""
    values = _conditions(data)
    differing = {n for n, v in values.items() if np.ptp(v) > LEAST_SPREAD * np.abs(v).max()}
    dependences = [d for d in data.comparisons[0].dependences if d.covariate in differing]
    dependences = dependences[:MOST_COVARIATES]
    if not dependences:
        return None
    reach = 1.1 * max(np.abs(r).max() for r in data.residuals_um)
    later = {d.covariate: d.correlation for d in data.comparisons[-1].dependences}
    charts = []
    for dependence in dependences:
        name = dependence.covariate
        x_mean, residual_means = _means(values[name], data.residuals_um)
        traces: list[dict] = []
        for label, residual, mean, colour in _of_each_model(
            data, data.residuals_um, residual_means
        ):
            traces += [
                layout.scatter(values[name], residual, 'markers',
                        marker={'size': 4, 'color': colour, 'opacity': 0.6},
                        hovertemplate=f'{AT_VALUE}<extra>{label}</extra>'),
                layout.scatter(x_mean, mean, 'lines', line={'color': colour, 'width': 2.5},
                        hoverinfo='skip'),
            ]  # fmt: skip
        arranged = layout.base_layout(
            xaxis=layout.axis(covariate_label(name), nticks=5),
            yaxis=layout.zero_axis('residual [µm]', range=[-reach, reach]),
        )
        text = f'ρ {fixed(dependence.correlation, signed=True)}'
        if data.improved and name in later:
            text += f' → {fixed(later[name], signed=True)}'
        text += f', {p_words(dependence.p_value)}'
        charts.append(layout.chart(text, traces, arranged, 220))
    return layout.figure('covariates', charts, _legend(data))


def _conditions(data: ReportData) -> dict[str, np.ndarray]:
    """Covariates of the first model at the points; passes count from 1, as on the 3D part."""
    values = {c.name: c.values for c in data.study.covariates(data.models[0])}
    return values | {'spray_pass': values['spray_pass'] + 1.0}


def _means(x: np.ndarray, residuals: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Means of the covariate, and of each model's residual, over sixths of the readings."""
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
    bin_of = np.minimum(np.digitize(x, edges), max(len(edges) - 1, 1))
    sums = np.array([np.bincount(bin_of, values) for values in (np.ones(len(x)), x, *residuals)])
    means = sums[1:, sums[0] > 0.0] / sums[0, sums[0] > 0.0]
    return means[0], means[1:]


def unknown_figure(data: ReportData) -> dict[str, Any] | None:
    """Mean residual along the covariate where the unexplained shows."""
    unknown = data.diagnosis.unknown if data.diagnosis else None
    if unknown is None or len(unknown.curve) < 2:
        return None
    covariate, y = list(unknown.curve.values())[:2]
    x = np.add(covariate, 1.0 if unknown.covariate == 'spray_pass' else 0.0)
    hover = f'{AT_VALUE}<extra></extra>'
    traces = [
        layout.scatter(_conditions(data)[unknown.covariate], data.residuals_um[-1], 'markers',
                hovertemplate=hover, marker={'size': 5, 'color': BEFORE}),
        layout.scatter(x, np.asarray(y), 'lines', hovertemplate=hover,
                line={'color': ACCENT, 'width': 2.5}),
    ]  # fmt: skip
    arranged = layout.base_layout(
        xaxis=layout.axis(covariate_label(unknown.covariate)),
        yaxis=layout.zero_axis('residual [µm]'),
    )
    legend = [('residual of each point', BEFORE, 'dot'), ('smoothed', ACCENT, 'bold')]
    return layout.figure('unknown', [layout.chart('', traces, arranged, 320)], legend)
