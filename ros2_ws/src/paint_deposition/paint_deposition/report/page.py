"""Pages: the report, and that of `paint demo`, each one HTML file that needs no network."""

import json
import re
from base64 import b64encode
from collections.abc import Callable, Mapping
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.special import fdtrc

from paint_deposition import __version__, git_version
from paint_deposition.files.atomic import filled, plain, write_text
from paint_deposition.film.film import Film
from paint_deposition.film.statistics import CPK_MEANS, film_statistics
from paint_deposition.inference.comparison.comparison import SideBySide
from paint_deposition.inference.diagnosis.model_space import ALPHA, SURE
from paint_deposition.inference.diagnosis.verdict import Diagnosis, percent
from paint_deposition.planning.improvement import Improvement
from paint_deposition.report import charts, words
from paint_deposition.report.colour_scales import TWO_SIDED_95, film_scale
from paint_deposition.report.data import (
    ReportData,
    blind_rows,
    class_rows,
    effect_rows,
    history_as_list,
    law_rows,
    pattern_rows,
)
from paint_deposition.report.drawing import DOTS_PER_INCH, PartPicture
from paint_deposition.report.film_pictures import page_film
from paint_deposition.report.plan_pictures import improved_figures
from paint_deposition.report.readings_pictures import (
    part_figures,
    profile_figures,
    residual_figures,
)

TEMPLATES = Path(__file__).parent / 'templates'
FILTERS: dict[str, Callable[..., Any]] = {
    'um': words.fixed,
    'signed': lambda value: words.fixed(value, signed=True),
    'whole': lambda value: words.fixed(value, 0),
    'micrometres': lambda value, signed=False: f'{words.fixed(value, signed=signed)} µm',
    'p': words.p_words,
    'percent': percent,
    'probability': words.probability_words,
    # Plain text with its units as they are printed.
    'in_print': lambda text: re.sub(r'(\d)-(\d)', r'\1–\2', text.replace(' um', ' µm')),
    'effect': words.effect_name,
    'capital': words.capital,
    'joined': words.joined,
    'covariate': words.covariate_label,
    'explanations': words.competing_explanations,
    'separation': words.separation_words,
    'film': lambda value: '' if np.isnan(value) else words.fixed(value, 1),
    'shares': lambda of: ', '.join(f'{100 * share:.0f} % {band}' for band, share in of.items()),
}


def report_html(data: ReportData) -> str:
    """The report as one page."""
    from plotly.offline import get_plotlyjs

    drawn = [
        charts.parity_figure(data), charts.covariate_figure(data), charts.learned_figure(data),
        charts.map_figure(data), charts.profile_figure(data), charts.footprint_figure(data),
    ]  # fmt: skip
    figures = [figure for figure in drawn if figure]
    content = json.dumps(plain(figures), separators=(',', ':'), allow_nan=False)
    films, git, diagnosis = film_rows(data), git_version(), data.diagnosis
    profiles, profile_legend = profile_figures(data)
    later = data.comparisons[-1].misfits
    # What the tables begin with: the model before, or of models side by side the last.
    shown = data.comparisons[-1 if data.beside else 0]
    zone_films = {row['name']: row['film'].zones for row in films}
    return _filled(
        'report.html.j2',
        **_verdict(data),
        head=list(data.study.campaign.head.items()),
        film=films,
        zones=[(z, zone_films[z.experiment][z.name]) for z in data.comparisons[-1].zones],
        cpk=CPK_MEANS,
        points=point_rows(data),
        effects=effect_rows(data),
        pattern=pattern_rows(data),
        learned=law_rows(data),
        blind=blind_rows(data),
        misfits=[
            {'kind': of[1], 'label': of[2], 'before': found, 'after': later.get(of, found)}
            for of, found in shown.misfits.items()
        ],
        shown=shown,
        of_model=f', {data.model_names[-1]}' if data.beside else '',
        history=history_as_list(data.study, diagnosis.history, data.older) if diagnosis else [],
        notes=(diagnosis or data.study).notes,
        lined=all(len(profile.line_m) for profile in data.profiles),
        places=data.proposals[0],
        made=datetime.now().astimezone().strftime('%Y-%m-%d %H:%M %Z'),
        version=f'{__version__} ({git})' if git else __version__,
        figures=[figure['name'] for figure in figures],
        content=content.replace('<', '\\u003c'),  # it stands inside a script element
        parts=[[*map(_embedded, part_figures(data, k))] for k in range(len(data.experiments))],
        profiles=list(map(_embedded, profiles)),
        profile_legend=profile_legend,
        script=(TEMPLATES / 'report.js').read_text(encoding='utf-8'),
        plotly=get_plotlyjs(),
    )


def write_story(
    path: Path,
    film: Film,
    found: Diagnosis,
    unseen: SideBySide,
    improved: Improvement,
    hidden: str,
    commands: Mapping[str, str],
) -> None:
    """Write the page of `paint demo`, whole or not at all.

    Args:
        film: that a recording leaves on a door.
        found: what the readings of doors like it say; unseen: both models on readings that no fit
            has seen.
        improved: the next door.
        hidden: the effect that was hidden in the readings, for the sceptic.
        commands: that do the same by hand, by their names.
    """
    data = ReportData(found)
    index = [experiment.name for experiment in data.experiments].index('door')
    door = PartPicture.of(film.surface)
    painted, _ = page_film(
        door, film.film_um, film.path, 'film predicted', film_scale(film.film_um)
    )
    residuals = residual_figures(data, index, PartPicture.of(data.experiments[index].surface))
    page = _filled(
        'story.html.j2', **_verdict(data), model_file='diagnosis/model.yaml', gun=film.guns[0],
        unseen=unseen, improved=improved, hidden=hidden, commands=commands,
        film=film.statistics, painted=_embedded(painted),
        residuals=list(map(_embedded, residuals)),
        programmes=list(map(_embedded, improved_figures(improved))),
    )  # fmt: skip
    write_text(path, page)


def film_rows(data: ReportData) -> list[dict[str, Any]]:
    """For each part its readings, and its film as the best model predicts it."""
    rows = []
    for k, experiment in enumerate(data.experiments):
        of_part, (film_um, emitted_cm3) = data.rows_of(k), data.painted[k][-1]
        bands = [band for band in data.bands[of_part] if band]
        target_um, tolerance_um = data.study.campaign.target_of(experiment)
        film = film_statistics(
            film_um, experiment.surface.vertex_areas_m2, emitted_cm3,
            target_um=target_um, target_tolerance_um=tolerance_um, zones=experiment.zones,
        )  # fmt: skip
        rows.append({
            'name': experiment.name, 'measured': data.study.measured_um[of_part], 'film': film,
            'areas': {
                'low': film.below_target, 'in': film.within_target, 'high': film.above_target,
            },
            # Shares of the points that are low, in and high; empty without a target.
            'bands': {b: bands.count(b) / len(bands) for b in ('low', 'in', 'high') if bands},
        })  # fmt: skip
    return rows


def point_rows(data: ReportData) -> list[dict[str, Any]]:
    """Each measured point: where, measured, predicted, deviation, and whether that is right.

    The model is right where the deviation is within what gauge and texture scatter by in 95 % of
    readings; the film is right in the target band.
    """
    found = data.comparisons[-1].points
    scatter_um = TWO_SIDED_95 * found.sigma_um
    rows: list[dict[str, Any]] = []
    for k, experiment in enumerate(data.experiments):
        labels, groups = experiment.readings.point[experiment.readings.first], experiment.groups
        places = 1e3 * experiment.measured_points.positions_m
        for row, point, group, place in zip(
            range(*data.rows_of(k).indices(len(data.study))), labels, groups, places, strict=True
        ):
            residual = found.residual_um[row]
            rows.append({
                'part': experiment.name, 'point': str(point), 'group': str(group),
                **dict(zip(('x_mm', 'y_mm', 'z_mm'), place, strict=True)),
                'measured_um': found.measured_um[row], 'predicted_um': found.predicted_um[row],
                'deviation_um': residual, 'scatter_um': scatter_um[row],
                'model': 'OK' if abs(residual) <= scatter_um[row] else 'off',
                'film': data.bands[row],
            })  # fmt: skip
    return rows


def _filled(name: str, **given: Any) -> str:
    """A page from its template, in the style that all pages share."""
    style = (TEMPLATES / 'report.css').read_text(encoding='utf-8')
    return filled(TEMPLATES / name, FILTERS, style=style, **given)


def _embedded(figure: Figure) -> str:
    """A picture as the address of an image that needs no file."""
    content = BytesIO()
    figure.savefig(content, format='png', dpi=DOTS_PER_INCH, facecolor='white')
    return f'data:image/png;base64,{b64encode(content.getvalue()).decode("ascii")}'


def _verdict(data: ReportData) -> dict[str, Any]:
    """What ``templates/verdict.j2`` puts into words for the engineer who runs the process."""
    points, freedom = data.comparisons[-1].points, min(data.study.noise.degrees_of_freedom, 1e6)
    targets = [data.study.campaign.target_of(experiment) for experiment in data.experiments]
    return {
        'data': data, 'd': data.diagnosis, 'counts': words.count_words(data.study),
        'classes': class_rows(data), 'sprays': data.proposals[1], 'SURE': SURE, 'ALPHA': ALPHA,
        'tolerance_um': min((tolerance for _, tolerance in targets if tolerance), default=0.0),
        # Deviations so large come from the gauge alone in 1 % of cases.
        'beyond_chance': fdtrc(len(points), freedom, points.chi_square_per_reading) < 0.01,
    }  # fmt: skip
