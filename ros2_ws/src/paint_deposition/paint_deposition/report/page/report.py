"""The report: one HTML file that needs no network, for the browser and for paper."""

import json
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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
from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.film import Film
from paint_deposition.film.statistics import CPK_MEANS
from paint_deposition.inference.comparison.comparison import SideBySide
from paint_deposition.inference.diagnosis.verdict import Diagnosis, percent
from paint_deposition.planning.improvement import FilmSummary, Improvement
from paint_deposition.report import words
from paint_deposition.report.data import ReportData
from paint_deposition.report.page import charts, learned, tables
from paint_deposition.report.page.headline import headline, key_figures
from paint_deposition.report.pictures import comparison
from paint_deposition.report.pictures.comparison import residual_figures
from paint_deposition.report.pictures.film import page_film
from paint_deposition.report.pictures.part import PartPicture
from paint_deposition.report.pictures.planning import improved_figures
from paint_deposition.report.style import DOTS_PER_INCH

TEMPLATES = Path(__file__).parent / 'templates'


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
        sprays=sprays[:5],
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


@dataclass(frozen=True)
class Chapter:
    """What one step found."""

    title: str
    text: tuple[str, ...]  # paragraphs
    figures: Sequence[tuple[str, str, str, str]]  # label, before or '', after, unit or remark
    pictures: Sequence[tuple[str, str]]  # what each shows, and its content as an address


def write_story(
    path: Path, told: Sequence[tuple[Chapter, str]], underway: str = '', ended: bool = False
) -> Path:
    """Write the page, whole or not at all.

    Args:
        told: each chapter with the command that does the same by hand.
        underway: what is being done; until it has ``ended`` the page reloads itself.
    """
    # Seconds after which a page that is not complete looks for more.
    reload_s = 2 if underway and not ended else None
    page = from_template('story.html.j2', {}, told=told, underway=underway, reload_s=reload_s)
    write_text(path, page)
    return path


def of_film(film: Film) -> Chapter:
    """The film that a recording leaves on a part."""
    s, gun = film.statistics, film.guns[0]
    part = PartPicture.of(film.surface)
    picture, _ = page_film(
        part, film.film_um, film.path, 'film predicted', film_scale(film.film_um)
    )
    return Chapter(
        'The film, from the mesh of a door and the recorded poses of the bell',
        (f'{words.capital(gun.geometry.sentence)}. The model of 2002 turns these poses into a '
         'film. How much paint the bell gives is not known yet: a usual 50 mm bell is taken.',),
        (('Film', '', f'{s.mean_um:.1f}', 'µm on average'),
         ('Least and greatest', '', f'{s.min_um:.1f} to {s.max_um:.1f}', 'µm'),
         ('Paint on the door', '', f'{100 * s.capture_fraction:.0f}', '% of what the bell gives')),
        [('The film on the door; lines are the passes, numbered where they begin',
          embedded(picture))],
    )  # fmt: skip


def of_readings(found: Diagnosis, experiment: str) -> Chapter:
    """A campaign's readings against the model before and after, drawn on one of its parts."""
    data = ReportData.of(found)
    index = [e.name for e in data.experiments].index(experiment)
    before, after = data.comparisons[0], data.comparisons[-1]
    pictures = residual_figures(data, index, PartPicture.of(data.experiments[index].surface))
    regions = [words.in_print(f'{r.experiment}, {r.description}') for r in before.regions]
    rmse = [of.points.rmse_um for of in (before, after)]
    return Chapter(
        'The readings of a gauge against the model',
        (f'{words.capital(words.count_words(data.study))}, painted by one bell. With its pattern '
         f'fitted to them the model of 2002 is off by {words.micrometres(rmse[0])} RMSE, and '
         f'beyond what gauge and texture explain: {"; ".join(regions) or "nowhere"}.',
         f'With what the diagnosis added, the error at these points is '
         f'{words.micrometres(rmse[1])}.'),
        key_figures(data)[:3],
        [(f'Measured minus predicted on the {experiment}, {name}: red is more paint than the '
          'model says, blue less; dots are readings', embedded(figure))
         for name, figure in zip(data.model_names, pictures, strict=True)],
    )  # fmt: skip


def of_cause(found: Diagnosis, unseen: SideBySide, hidden: str) -> Chapter:
    """What was missing, how sure that is, and how both models do on readings no fit has seen.

    For the sceptic with the id of the effect that was hidden in the readings.
    """
    data = ReportData.of(found)
    told = headline(data)
    facts = dict(told.facts)
    errors = [one.points.rmse_um for one in unseen.by_name.values()]
    count = len(unseen.by_name[unseen.best].readings)
    before, after = map(words.fixed, errors)
    return Chapter(
        told.title,
        (*(facts[what] for what in ('What is missing', 'How sure') if facts.get(what)),
         f'{count} more readings of the door were kept from every fit. On them the error goes '
         f'from {before} to {after} µm.',
         f'What the virtual shop had hidden, by a law of its own: {words.effect_name(hidden)}.'),
        (*key_figures(data)[3:],
         (f'RMSE, {count} unseen readings', before, after, 'µm')),
        (),
    )  # fmt: skip


def of_improvement(found: Improvement) -> Chapter:
    """A programme before and after, in the film that the model predicts."""
    band = f'within {found.band}'

    def both(
        label: str, unit: str, digits: int, figure: Callable[[FilmSummary], float]
    ) -> tuple[str, str, str, str]:
        before, after = (words.fixed(figure(of), digits) for of in (found.before, found.after))
        return label, before, after, unit

    return Chapter(
        'The next door, more even',
        ('The path of the robot stays. The model with what was missing chooses the speeds along '
         'it, and where the gun opens and closes.',
         'Both films are predicted by that model. The new programme is written as a bag, a table '
         f'and a robot program. The figures are of {found.region}.'),
        (both('Standard deviation', '% of the mean', 1, lambda f: 100 * f.sigma_n),
         both('Area', f'% {band}', 0, lambda f: 100 * f.within),
         both('Least film', 'µm', 1, lambda f: f.statistics.min_um),
         both('Paint', 'cm³', 1, lambda f: f.paint_cm3),
         both('Time', 's', 1, lambda f: f.cycle_s)),
        [(f'The film on the door, {when}; pink is thinner, red thicker than the bar',
          embedded(figure))
         for when, figure in zip(('before', 'after'), improved_figures(found), strict=True)],
    )  # fmt: skip
