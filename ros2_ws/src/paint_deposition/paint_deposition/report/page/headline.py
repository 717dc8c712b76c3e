"""The verdict in plain words for the engineer who runs the process, by its template."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import fdtrc

from paint_deposition.files.atomic import filled
from paint_deposition.inference.diagnosis.model_space import SURE
from paint_deposition.inference.diagnosis.procedure import ALPHA
from paint_deposition.inference.diagnosis.verdict import percent
from paint_deposition.report import words
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.tables import class_rows


@dataclass(frozen=True)
class Headline:
    """What stands at the top of the report."""

    tone: str  # 'good', 'found', 'open' or 'bad'
    # What kind of verdict, and the verdict.
    kicker: str
    title: str
    # (question, answer) in the order of reading.
    facts: tuple[tuple[str, str], ...]


def headline(data: ReportData) -> Headline:
    """Verdict and facts, from ``templates/headline.j2``."""
    told = {'tone': '', 'kicker': '', 'title': ''}
    facts: list[tuple[str, str]] = []

    def verdict(*parts: str) -> str:
        told.update(zip(told, parts, strict=True))
        return ''

    def answer(question: str, caller: Callable[[], str]) -> str:
        text = ' '.join(caller().split())
        facts.extend([(question, text)] if text else [])
        return ''

    template = Path(__file__).parent / 'templates' / 'headline.j2'
    filled(template, verdict=verdict, answer=answer, **_figures(data))
    return Headline(facts=tuple(facts), **told)


def _figures(data: ReportData) -> dict[str, Any]:
    """What the sentences are made of."""
    diagnosis, kind, rows = data.diagnosis, 'side_by_side', class_rows(data)
    added = [row for row in rows if row['accepted']]
    learned = [row for row in added if words.is_learned(row['id'])]
    named = [row for row in added if not words.is_learned(row['id'])]
    if diagnosis is None and not data.names:
        kind = 'compared'
    elif diagnosis:
        # A diagnosis adds effects that it is sure of, and keeps learned laws for what they
        # predict: others were added by the user.
        asked = any(row['found'].probability < 1.0 for row in learned)
        asked |= any(row['found'].probability <= SURE for row in named)
        kind = 'asked_for' if asked else diagnosis.verdict
    errors = [comparison.points.rmse_um for comparison in data.comparisons]
    points, freedom = data.comparisons[-1].points, min(data.study.noise.degrees_of_freedom, 1e6)
    history = diagnosis.history if diagnosis else (None,)
    return {
        'data': data, 'd': diagnosis, 'kind': kind, 'added': added, 'named': named,
        'open': [row for row in rows if not row['accepted']],
        'first': history[0], 'last': history[-1], 'steps': list(pairwise(history)),
        'least': min((row['found'].probability for row in added), default=1.0),
        'causes': [one for row in named for one in (row['id'], *row['like'])],
        'laws': [f'a {row["name"].removeprefix("learned ")} ({_values(row)})' for row in learned],
        'sprays': data.proposals[1],
        'added_names': [_with_article(row['id']) for row in added],
        'not_testable': list(map(words.effect_name, diagnosis.not_testable if diagnosis else ())),
        # Deviations so large come from the gauge alone in 1 % of cases.
        'beyond_chance': fdtrc(len(points), freedom, points.chi_square_per_reading) < 0.01,
        'best': data.names[int(np.argmin(errors))] if data.names else '',
        'each': [f'{n} {words.micrometres(e)}' for n, e in zip(data.names, errors, strict=False)],
        'um': words.micrometres, 'percent': percent, 'capital': words.capital,
        'joined': words.joined, 'with_article': _with_article, 'values': _values,
        'or_their_like': _or_their_like,
        'in_print': words.in_print, 'p_words': words.p_words,
        'covariate_label': words.covariate_label, 'separation_words': words.separation_words,
        'SURE': SURE, 'ALPHA': ALPHA,
    }  # fmt: skip


def _with_article(name: str) -> str:
    return ('a ' if words.is_learned(name) else '') + words.effect_name(name)


def _values(row: dict[str, Any]) -> str:
    """The parameters of an effect or a law, with their intervals."""
    values = [
        f'{p["words"]} {p["value"]} {p["unit"]}'.rstrip()
        + (f' ({p["low"]} to {p["high"]})' if 'low' in p else '')
        for p in row['parameters']
    ]
    return ' '.join(values) if words.is_learned(row['id']) else words.joined(values)


def _or_their_like(rows: Sequence[dict], last: str = 'and', probable: bool = False) -> str:
    """Effects with those that they are confounded with, and how probable each is."""
    found = []
    for row in rows:
        others = f' (or {words.joined(row["others"], "or")})' if row['others'] else ''
        found.append(row['name'] + others)
        if probable:
            found[-1] += f' ({percent(row["found"].probability)})'
    return words.joined(found, last)


def key_figures(data: ReportData) -> list[tuple[str, str, str, str]]:
    """(label, before or '', after, remark) of the figures beside the facts."""
    noise, diagnosis = data.study.noise, data.diagnosis
    source = {'repeats': 'from repeats', 'stated': 'as stated'}.get(noise.source, noise.source)
    floor = ('Gauge and texture', '', f'{data.study.noise_floor_um:.2f}', f'µm, {source}')
    if data.names:
        models = zip(data.names, data.comparisons, strict=True)
        errors = [(f'Error, {n}', '', f'{c.points.rmse_um:.2f}', 'µm RMS at the points')
                  for n, c in models]  # fmt: skip
        return [*errors, floor]
    if diagnosis is None:
        rmse_um = data.comparisons[-1].points.rmse_um
        return [('Error', '', f'{rmse_um:.2f}', 'µm RMS at the points'), floor]
    first, last = diagnosis.history[0], diagnosis.history[-1]
    found = []
    for label, name in (
        (f'Error on {diagnosis.left_out} left out', 'holdout_rmse_um'),
        ('Error at fitted points', 'rmse_um'),
    ):
        before = f'{getattr(first, name):.2f}' if first is not last else ''
        found.append((label, before, f'{getattr(last, name):.2f}', 'µm RMS'))
    found.append(floor)
    open_too = diagnosis.verdict == 'undecided'
    named = [
        c for c in diagnosis.classes
        if not words.is_learned(c.best) and (open_too or c.best in diagnosis.accepted)
    ]  # fmt: skip
    for best in named[:1]:
        remark = 'probability' + (', with its like' if len(best.members) > 1 else '')
        found.append((words.effect_name(best.best), '', percent(best.probability), remark))
    return found
