"""The report: one HTML file that needs no network, for the browser and for paper."""

import json
from base64 import b64encode
from collections.abc import Callable, Mapping
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from paint_deposition import __version__
from paint_deposition.effects.learned.law import LearnedLaw
from paint_deposition.files.atomic import plain, write_text
from paint_deposition.files.version import git_version
from paint_deposition.film.statistics import CPK_MEANS
from paint_deposition.inference.diagnosis.verdict import percent
from paint_deposition.report import words
from paint_deposition.report.data import ReportData
from paint_deposition.report.page import charts, learned, tables
from paint_deposition.report.page.headline import headline, key_figures
from paint_deposition.report.pictures import comparison
from paint_deposition.report.pictures.chart import DOTS_PER_INCH

TEMPLATES = Path(__file__).parent / 'templates'
SPRAYS_SHOWN = 5


def write_report(path: Path, data: ReportData) -> Path:
    """Write the report as one HTML file, whole or not at all."""
    write_text(path, report_html(data))
    return path


def report_html(data: ReportData) -> str:
    """The page as text."""
    from plotly.offline import get_plotlyjs

    filters: dict[str, Callable[..., str]] = {
        'um': words.fixed,
        'signed': lambda value: words.fixed(value, signed=True),
        'whole': lambda value: words.fixed(value, 0),
        'p': words.p_words,
        'percent': percent,
        'probability': words.probability_words,
        'in_print': words.in_print,
        'effect': words.effect_name,
        'capital': words.capital,
        'film': lambda value: '' if np.isnan(value) else words.fixed(value, 1),
        'step': words.step_words,
        'shares': lambda of: ', '.join(
            f'{100 * share:.0f} % {band}' for band, share in of.items()
        ),
    }
    drawn = [
        charts.parity_figure(data),
        charts.covariate_figure(data),
        charts.unknown_figure(data),
        learned.learned_figure(data),
        learned.map_figure(data),
        learned.profile_figure(data),
        learned.footprint_figure(data),
    ]
    figures = [figure for figure in drawn if figure]
    content = json.dumps(plain(figures), separators=(',', ':'), allow_nan=False)
    films = tables.film_rows(data)
    zone_films = {row['name']: row['film'].zones for row in films}
    (places, sprays), git = data.proposals, git_version()
    return from_template(
        'report.html.j2', filters,
        data=data,
        headline=headline(data),
        key_figures=key_figures(data),
        head=list(data.study.campaign.head.items()),
        film=films,
        zones=[(z, zone_films[z.experiment][z.name]) for z in data.comparisons[-1].zones],
        cpk=CPK_MEANS,
        points=tables.point_rows(data),
        counts=words.count_words(data.study),
        classes=tables.class_rows(data),
        effects=tables.effect_rows(data),
        pattern=tables.pattern_rows(data),
        learned=[words.learned_range(e) for e in data.model.effects if isinstance(e, LearnedLaw)],
        left_out=data.study.left_out,
        noise=tables.noise_rows(data),
        levels=data.diagnosis.random_effects if data.diagnosis else (),
        shift=data.diagnosis and data.diagnosis.pattern_shift,
        blind=tables.blind_rows(data),
        misfits=tables.misfit_rows(data),
        places=places,
        sprays=sprays[:SPRAYS_SHOWN],
        separates=words.capital(words.competing_explanations(sprays[0])) if sprays else '',
        provenance=[
            ('Made', datetime.now().astimezone().strftime('%Y-%m-%d %H:%M %Z')),
            ('paint_deposition', f'{__version__} ({git})' if git else __version__),
        ],
        lined=all(len(p.line_m) for p in data.profiles),
        figures=[figure['name'] for figure in figures],
        content=content.replace('<', '\\u003c'),  # it stands inside a script element
        parts=[
            list(map(embedded, comparison.part_figures(data, k)))
            for k in range(len(data.experiments))
        ],
        profiles=list(map(embedded, comparison.profile_figures(data))),
        profile_legend=comparison.profile_legend(data),
        script=(TEMPLATES / 'report.js').read_text(encoding='utf-8'),
        plotly=get_plotlyjs(),
    )  # fmt: skip


def from_template(name: str, filters: Mapping[str, Callable[..., str]], **given: Any) -> str:
    """A page from its template, in the style that all pages share."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters.update(filters)
    style = (TEMPLATES / 'report.css').read_text(encoding='utf-8')
    return environment.get_template(name).render(style=style, **given)


def embedded(figure: Figure) -> str:
    """A picture as the address of an image that needs no file."""
    content = BytesIO()
    figure.savefig(content, format='png', dpi=DOTS_PER_INCH, facecolor='white')
    return f'data:image/png;base64,{b64encode(content.getvalue()).decode("ascii")}'
