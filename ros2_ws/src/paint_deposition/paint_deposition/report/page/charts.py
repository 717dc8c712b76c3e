"""Charts of the report page: what they share, parity, covariates, the unexplained."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from paint_deposition.film.colour_scales import COOLWARM, VIRIDIS
from paint_deposition.report.data import ReportData
from paint_deposition.report.style import ACCENT, BEFORE, GRID, INK, MUTED, TWO_SIDED_95
from paint_deposition.report.words import covariate_label, fixed, p_words

CLEAR = 'rgba(0,0,0,0)'
FONT = 'Inter, "Segoe UI", "Helvetica Neue", Arial, sans-serif'
AT_VALUE = '%{y:.2f} µm at %{x:.3g}'


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


def parity_figure(data: ReportData) -> dict[str, Any]:
    """Predicted against measured, with the band that the gauge's noise explains."""
    measured = data.study.measured_um
    predicted = [measured - residual for residual in data.residuals_um]
    top = 1.05 * max(measured.max(), *(p.max() for p in predicted))
    ends = np.array([0.0, top])
    spread = TWO_SIDED_95 * data.study.noise_floor_um
    bound = {'line': {'width': 0}, 'hoverinfo': 'skip'}
    traces = [
        scatter(ends, ends + spread, 'lines', **bound),
        scatter(ends, ends - spread, 'lines', **bound, fill='tonexty',
                fillcolor='rgba(154,165,177,0.25)'),
        scatter(ends, ends, 'lines', hoverinfo='skip', line={'color': MUTED, 'width': 1}),
    ]  # fmt: skip
    for name, values, colour in _of_each_model(data, predicted):
        hover = 'measured %{x:.2f} µm, ' + name + ' %{y:.2f} µm<extra></extra>'
        marker = {'size': 5.5, 'color': colour, 'opacity': 0.9}
        traces.append(scatter(measured, values, 'markers', marker=marker, hovertemplate=hover))
    arranged = base_layout(
        xaxis=axis('measured [µm]', range=[0, top], constrain='domain'),
        yaxis=axis('predicted [µm]', range=[0, top], scaleanchor='x', constrain='domain'),
    )
    legend = [('95 % gauge and texture', BEFORE, 'band'), *_legend(data)]
    return figure('parity', [chart('', traces, arranged, 400)], legend)


def _legend(data: ReportData) -> list[tuple[str, str, str]]:
    return [(name, colour, 'dot') for name, colour in _of_each_model(data)]


def _of_each_model(data: ReportData, *values: Iterable[np.ndarray]) -> Iterator[tuple]:
    """Name, values and colour of each model."""
    return zip(data.model_names, *values, data.colours, strict=True)


def covariate_figure(data: ReportData) -> dict[str, Any] | None:
    """Residual against what differs from point to point, the most telling first."""
    values = _conditions(data)
    # Conditions that differ by less than this share say nothing of the model.
    differing = {n for n, v in values.items() if np.ptp(v) > 0.01 * np.abs(v).max()}
    dependences = [d for d in data.comparisons[0].dependences if d.covariate in differing]
    dependences = dependences[:8]
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
                scatter(values[name], residual, 'markers',
                        marker={'size': 4, 'color': colour, 'opacity': 0.6},
                        hovertemplate=f'{AT_VALUE}<extra>{label}</extra>'),
                scatter(x_mean, mean, 'lines', line={'color': colour, 'width': 2.5},
                        hoverinfo='skip'),
            ]  # fmt: skip
        arranged = base_layout(
            xaxis=axis(covariate_label(name), nticks=5),
            yaxis=zero_axis('residual [µm]', range=[-reach, reach]),
        )
        text = f'ρ {fixed(dependence.correlation, signed=True)}'
        if data.improved and name in later:
            text += f' → {fixed(later[name], signed=True)}'
        text += f', {p_words(dependence.p_value)}'
        charts.append(chart(text, traces, arranged, 220))
    return figure('covariates', charts, _legend(data))


def _conditions(data: ReportData) -> dict[str, np.ndarray]:
    """Covariates of the first model at the points; passes count from 1, as on the 3D part."""
    values = {c.name: c.values for c in data.study.covariates(data.models[0])}
    return values | {'spray_pass': values['spray_pass'] + 1.0}


def _means(x: np.ndarray, residuals: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Means of the covariate, and of each model's residual, over sixths of the readings."""
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, 7)))
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
        scatter(_conditions(data)[unknown.covariate], data.residuals_um[-1], 'markers',
                hovertemplate=hover, marker={'size': 5, 'color': BEFORE}),
        scatter(x, np.asarray(y), 'lines', hovertemplate=hover,
                line={'color': ACCENT, 'width': 2.5}),
    ]  # fmt: skip
    arranged = base_layout(
        xaxis=axis(covariate_label(unknown.covariate)),
        yaxis=zero_axis('residual [µm]'),
    )
    legend = [('residual of each point', BEFORE, 'dot'), ('smoothed', ACCENT, 'bold')]
    return figure('unknown', [chart('', traces, arranged, 320)], legend)
