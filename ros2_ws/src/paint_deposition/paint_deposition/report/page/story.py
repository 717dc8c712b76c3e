"""The story that `paint demo` tells: one HTML file with a chapter for each step.

The words of a chapter are those that the command prints, and its figures are those of the files.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from paint_deposition.files.atomic import write_text
from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.film import Film
from paint_deposition.inference.comparison.comparison import SideBySide
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.planning.improvement.improvement import FilmSummary, Improvement
from paint_deposition.report import words
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.headline import headline, key_figures
from paint_deposition.report.page.report import embedded, from_template
from paint_deposition.report.pictures.comparison import residual_figures
from paint_deposition.report.pictures.film import page_film
from paint_deposition.report.pictures.part import PartPicture
from paint_deposition.report.pictures.planning import improved_figures

# Seconds after which a page that is not complete looks for more.
RELOAD_S = 2


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
    reload_s = RELOAD_S if underway and not ended else None
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
