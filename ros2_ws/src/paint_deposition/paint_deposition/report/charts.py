"""Charts of the report page: parity, covariates, the learned laws and the footprint."""

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from paint_deposition.effects.learned_curves import LearnedCurve, counted_from_1
from paint_deposition.effects.learned_laws import (
    LEAST_FACTOR,
    LearnedFootprint,
    LearnedMap,
    places_m,
)
from paint_deposition.inference.diagnosis.closed_forms import forms_of, variable_at
from paint_deposition.inference.diagnosis.verdict import percent
from paint_deposition.report.colour_scales import (
    ACCENT,
    BEFORE,
    FILM_PALETTE,
    INK,
    MUTED,
    RESIDUAL_PALETTE,
    TABLE,
    TWO_SIDED_95,
    ColourScale,
)
from paint_deposition.report.data import ReportData
from paint_deposition.report.drawing import (
    PAGE_IN,
    TEXT_PT,
    colour_bar,
    legend,
    new_figure,
    quiet,
)
from paint_deposition.report.words import (
    capital,
    covariate_label,
    effect_name,
    fixed,
    joined,
    p_words,
)


def page_charts(data: ReportData) -> dict[str, list[Figure]]:
    """The charts by the section of the page in which they stand, of those that have any."""
    charts = {
        'parity': [parity_figure(data)],
        'covariates': covariate_figures(data),
        'learned': learned_figures(data),
        'maps': map_figures(data),
        'profile': radial_figures(data),
        'footprint': footprint_figures(data),
    }
    return {name: figures for name, figures in charts.items() if figures}


def parity_figure(data: ReportData) -> Figure:
    """Predicted against measured, with the band that the gauge's noise explains."""
    measured = data.study.measured_um
    predicted = [measured - residual for residual in data.residuals_um]
    top = 1.05 * max(measured.max(), *(p.max() for p in predicted))
    ends, spread = np.array([0.0, top]), TWO_SIDED_95 * data.study.noise_floor_um
    figure, axes = _chart(PAGE_IN, 'measured [µm]', 'predicted [µm]')
    label = '95 % gauge and texture'
    axes.fill_between(
        ends, ends - spread, ends + spread, color=BEFORE, alpha=0.25, lw=0, label=label
    )
    axes.plot(ends, ends, color=MUTED, lw=0.8)
    for name, values, colour in zip(data.model_names, predicted, data.colours, strict=True):
        axes.plot(measured, values, 'o', ms=3.5, color=colour, alpha=0.9, label=name)
    axes.set(xlim=ends, ylim=ends, aspect='equal')
    legend(axes, loc='upper left')
    return figure


def covariate_figures(data: ReportData) -> list[Figure]:
    """Residual against what differs from point to point, the most telling first."""
    covariates = data.study.covariates(data.models[0])
    values = {name: counted_from_1(name, found) for name, found in covariates.items()}
    # Conditions that differ by less say nothing of the model.
    differing = {n for n, v in values.items() if np.ptp(v) > 0.01 * np.abs(v).max()}
    dependences = [d for d in data.comparisons[0].dependences.items() if d[0] in differing]
    reach = 1.1 * max(np.abs(r).max() for r in data.residuals_um)
    later = data.comparisons[-1].dependences
    figures: list[Figure] = []
    for name, (correlation, p_value) in dependences[:8]:
        x = values[name]
        # Means of the covariate, and of each model's residual, over sixths of the readings.
        edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, 7)))
        sixth = np.minimum(np.digitize(x, edges), max(len(edges) - 1, 1))
        counted = (np.ones(len(x)), x, *data.residuals_um)
        sums = np.array([np.bincount(sixth, of_point) for of_point in counted])
        x_mean, *means = sums[1:, sums[0] > 0.0] / sums[0, sums[0] > 0.0]
        text = f'ρ {fixed(correlation, signed=True)}'
        if data.improved and name in later:
            text += f' → {fixed(later[name][0], signed=True)}'
        title = f'{text}, {p_words(p_value)}'
        figure, axes = _chart(2.3, covariate_label(name), 'residual [µm]', title)
        axes.axhline(0.0, color=MUTED, lw=0.8)
        models = zip(data.model_names, data.colours, data.residuals_um, means, strict=True)
        for label, colour, residual, mean in models:
            axes.plot(x, residual, 'o', ms=2.5, color=colour, alpha=0.6)
            axes.plot(x_mean, mean, color=colour, lw=2.0, label=label)
        axes.set_ylim(-reach, reach)
        if not figures and len(data.models) > 1:
            legend(axes, loc='best')
        figures.append(figure)
    return figures


def learned_figures(data: ReportData) -> list[Figure]:
    """Each learned curve of the best model with its band and its most probable closed form.

    The range of the readings lies between dotted lines.
    """
    figures = []
    for law in data.model.effects:
        if not isinstance(law, LearnedCurve):
            continue
        values, factor = np.linspace(law.low, law.high, 201), law.kind == 'factor'
        curve = law.factor if factor else law.curve
        step = (law.high - law.low) / (len(law.learned) - 1)
        around = np.linspace(law.low - step, law.high + step, 201)
        with np.errstate(invalid='ignore', divide='ignore'):  # a distance to an edge has an end
            around = around[np.isfinite(law.axis(around))]
        title, x = capital(effect_name(law.id)), counted_from_1(law.covariate, values)
        forms = forms_of(law)[:1]
        for form in forms:
            title += f'; dots: {form.formula} ({percent(form.probability)})'
        figure, axes = _chart(
            2.8, covariate_label(law.covariate), 'factor' if factor else 'addition [µm]', title
        )
        if law.sd:
            half = TWO_SIDED_95 * law.deviation(values)
            low = np.maximum(curve(values) - half, LEAST_FACTOR if factor else -np.inf)
            high = curve(values) + half
            axes.fill_between(x, low, high, color=ACCENT, alpha=0.18, lw=0, label='95 % band')
        shown = counted_from_1(law.covariate, around)
        axes.plot(shown, curve(around), color=ACCENT, lw=2.0, label='learned')
        for form in forms:
            axes.plot(x, form(variable_at(law, values)), ':', color=INK, lw=1.5)
        for end in x[[0, -1]]:
            axes.axvline(end, color=MUTED, lw=0.8, linestyle=':')
        legend(axes, loc='best')
        figures.append(figure)
    return figures


def map_figures(data: ReportData) -> list[Figure]:
    """Each map over a part that the best model has learned, the part as the gun sees it."""
    law, found = data.model.effect(LearnedMap.id), []
    if not isinstance(law, LearnedMap):
        return []
    for grid, values in law.values_by_part():
        parts = [e for e in data.experiments if grid.is_of(e.measured_points)]
        neutral, title = 0.0, 'addition [µm]'
        if law.kind == 'factor':
            values, neutral, title = np.maximum(1.0 + values, LEAST_FACTOR), 1.0, 'factor'
        title += ' on ' + (joined([e.name for e in parts]) or 'a part that was not measured here')
        x = np.linspace(grid.low_m[0], grid.high_m[0], grid.columns)
        y = np.linspace(grid.low_m[1], grid.high_m[1], grid.rows)
        labels = 'right of the centre [m]', 'above it [m]'
        figure, axes = _heat_map(title, labels, x, y, values, _about(values, neutral))
        for part in parts:
            axes.plot(*places_m(part.measured_points).T, 'o', ms=2.0, color=INK)
        found.append(figure)
    return found


def radial_figures(data: ReportData) -> list[Figure]:
    """The footprint from its middle outward, by eq. (1) and as the readings have it."""
    left_over = data.diagnosis and data.diagnosis.discrepancy
    if not left_over:
        return []
    profile = left_over.profile
    half, radius_m = TWO_SIDED_95 * profile.sd, profile.radius_m
    low, high = (np.maximum(profile.found + of, 0.0) for of in (-half, half))
    title = 'mean over the angle'
    x, y = 'distance from the axis on the model plane [m]', 'flux over the peak of eq. (1)'
    figure, axes = _chart(2.8, x, y, title)
    axes.fill_between(radius_m, low, high, color=ACCENT, alpha=0.18, lw=0, label='95 % band')
    axes.plot(radius_m, profile.eq1, color=MUTED, lw=1.2, label='eq. (1)')
    axes.plot(radius_m, profile.found, color=ACCENT, lw=2.0, label='readings')
    legend(axes, loc='upper right')
    return [figure]


def footprint_figures(data: ReportData) -> list[Figure]:
    """The patterns of eq. (1), the patterns as learned, and the factor between the two."""
    law = data.model.effect(LearnedFootprint.id)
    if not isinstance(law, LearnedFootprint):
        return []
    patterns, brushes = data.model.patterns, data.model.brushes
    # As far out as the pattern matters: where it is above 2 % of its peak.
    reach = max(planar.radius_of_flux_m(0.02) for planar in patterns)
    along = np.linspace(-reach, reach, 81)
    labels, (x, y) = ('tool x [m]', 'tool y [m]'), np.meshgrid(along, along)
    factor = np.maximum(1.0 + law.h(x, y), LEAST_FACTOR)
    of = [f' of brush {brush.number}' for brush in brushes] if len(brushes) > 1 else ['']
    plain = [planar.flux_um_per_s(x, y) for planar in patterns]
    found = []
    for flux, whose in zip(plain, of, strict=True):
        scale = ColourScale(0.0, float(max(flux.max(), (flux * factor).max())), FILM_PALETTE)
        for title, values in (('of eq. (1)', flux), ('as learned', flux * factor)):
            title = f'pattern {title}{whose} [µm/s]'
            found.append(_heat_map(title, labels, along, along, values, scale)[0])
    title = f'factor, with contours of eq. (1){of[0]}'
    figure, axes = _heat_map(title, labels, along, along, factor, _about(factor, 1.0))
    levels = plain[0].max() * np.array([0.1, 0.5, 0.9])
    axes.contour(along, along, plain[0], levels, colors=MUTED, linewidths=0.8)
    return [*found, figure]


def _chart(height_in: float, x: str, y: str, title: str = '') -> tuple[Figure, Axes]:
    """A chart as wide as a page has room for."""
    figure = new_figure(PAGE_IN, height_in)
    axes = figure.subplots()
    # So many letters of a title fit over a chart.
    quiet(axes, x, y, fill(title, 46), size=TEXT_PT)
    return figure, axes


def _about(values: np.ndarray, neutral: float) -> ColourScale:
    """Colours by how far values are from the neutral one."""
    away = max(float(np.abs(values - neutral).max()), 1e-3)
    return ColourScale(neutral - away, neutral + away, RESIDUAL_PALETTE)


def _heat_map(
    title: str,
    labels: tuple[str, str],
    x: np.ndarray,
    y: np.ndarray,
    values: np.ndarray,
    scale: ColourScale,
) -> tuple[Figure, Axes]:
    """Values (Y, X) at even places x (X,) and y (Y,)."""
    size = np.array([np.ptp(x), np.ptp(y)])
    figure, axes = _chart((PAGE_IN - 0.8) * size[1] / size[0] + 1.3, *labels, title)
    sides = [(at[0] - half, at[-1] + half) for at in (x, y) for half in [0.5 * (at[1] - at[0])]]
    axes.imshow(
        values, ListedColormap(scale.palette[:TABLE] / 255.0), vmin=scale.low, vmax=scale.high,
        origin='lower', extent=(*sides[0], *sides[1]), interpolation='bilinear',
    )  # fmt: skip
    axes.set(xlim=x[[0, -1]], ylim=y[[0, -1]])
    axes.grid(False)
    colour_bar(figure, [axes], '', scale)
    return figure, axes
