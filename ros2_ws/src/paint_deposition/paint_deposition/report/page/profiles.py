"""Profiles along columns and rows with the residual below each: Figure 8 of the paper."""

from typing import Any

import numpy as np

from paint_deposition.inference.comparison.profiles import Profile
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.layout import (
    axis,
    base_layout,
    chart,
    figure,
    scatter,
    zero_axis,
)
from paint_deposition.report.style import BEFORE, INK, TWO_SIDED_95

CHART_PX = 300
# Share of a chart's height that the residual takes, and above which the film begins.
RESIDUAL_SHARE, FILM_FROM = 0.26, 0.31


def profile_figure(data: ReportData, index: int) -> dict[str, Any]:
    """Film along each column or row of one experiment: measured, before and after."""
    experiment = data.experiments[index].name
    profiles = [p for p in data.profiles if p.experiment == experiment]
    film_range, residual_range = _ranges(data, profiles)
    charts = []
    for profile in profiles:
        layout = base_layout(
            xaxis=axis(f'{profile.axis} [mm]', anchor='y2', nticks=7),
            yaxis=axis('film [µm]', domain=[FILM_FROM, 1.0], range=film_range, nticks=6),
            yaxis2=zero_axis(
                'residual', domain=[0.0, RESIDUAL_SHARE], range=residual_range, nticks=4
            ),
        )
        residuals = [trace | {'yaxis': 'y2'} for trace in _residual_traces(data, profile)]
        title = f'{profile.label}: {data.errors_in_words(profile.rows)}'
        charts.append(chart(title, _film_traces(data, profile) + residuals, layout, CHART_PX))
    return figure(f'profiles-{index}', charts, _legend(data))


def _legend(data: ReportData) -> list[tuple[str, str, str]]:
    lined = any(len(profile.line_m) for profile in data.profiles)
    models = [
        (name, line['color'], 'dot' if not lined else 'bold' if line['width'] > 2 else 'line')
        for name, line in zip(data.model_names, data.lines, strict=True)
    ]
    entries = [('measured, bars: 95 % gauge and texture', INK, 'dot'), *models]
    return entries + [('each pass alone', BEFORE, 'dots')] * lined


def _ranges(data: ReportData, profiles: list[Profile]) -> tuple[list[float], list[float]]:
    lines = [p.lines_um.max(initial=0.0) for p in profiles]
    measured = [data.study.measured_um[p.rows].max() for p in profiles]
    rows = np.concatenate([p.rows for p in profiles])
    off = max(np.abs(r[rows]).max() for r in data.residuals_um)
    noise = TWO_SIDED_95 * data.study.sigma_um[rows].max()
    reach = 1.05 * (off + 0.6 * noise)
    return [0.0, 1.03 * max(*lines, *measured, 1.0) + noise], [-reach, reach]


def _film_traces(data: ReportData, p: Profile) -> list[dict]:
    line_mm, at_mm, measured = 1e3 * p.line_m, 1e3 * p.position_m, data.study.measured_um[p.rows]
    traces = [
        scatter(line_mm, single, 'lines', line={'color': BEFORE, 'width': 1, 'dash': 'dot'},
                hovertemplate=f'pass {number}: %{{y:.1f}} µm<extra></extra>')
        for number, single in enumerate(p.passes_um, start=1)
    ]  # fmt: skip
    named = zip(data.model_names, data.lines, strict=True)
    for k, (name, line) in reversed(list(enumerate(named))):
        if len(line_mm):
            trace = scatter(line_mm, p.lines_um[k], 'lines', line=line)
        else:
            # An open ring lies over the full dot of the model after it.
            marker = {'size': 7, 'color': line['color']}
            if k < len(data.models) - 1:
                marker |= {'symbol': 'circle-open'}
            predicted = measured - data.residuals_um[k][p.rows]
            trace = scatter(at_mm, predicted, 'markers', marker=marker)
        traces.append(trace | {'hovertemplate': f'{name}: %{{y:.2f}} µm<extra></extra>'})
    traces.append(
        scatter(at_mm, measured, 'markers', marker={'size': 5, 'color': INK},
                error_y=_bars(data, p, INK),
                hovertemplate='measured %{y:.2f} µm at %{x:.0f} mm<extra></extra>')
    )  # fmt: skip
    return traces


def _residual_traces(data: ReportData, p: Profile) -> list[dict]:
    """Measured minus predicted; the bars of the last are the gauge's noise."""
    traces = [
        scatter(1e3 * p.position_m, residual[p.rows], 'lines+markers',
                marker={'size': 4.5, 'color': colour}, line={'width': 1, 'color': colour},
                hovertemplate='residual %{y:+.2f} µm<extra></extra>')
        for residual, colour in zip(
            reversed(data.residuals_um), reversed(data.colours), strict=True
        )
    ]  # fmt: skip
    traces[0]['error_y'] = _bars(data, p, data.colours[-1])
    return traces[::-1]


def _bars(data: ReportData, p: Profile, colour: str) -> dict[str, Any]:
    return {
        'type': 'data', 'array': TWO_SIDED_95 * data.study.sigma_um[p.rows],
        'color': colour, 'thickness': 1, 'width': 0,
    }  # fmt: skip
