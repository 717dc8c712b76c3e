"""The verdict in plain words for the engineer who runs the process."""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from paint_deposition.inference.diagnosis.model_space import SURE
from paint_deposition.inference.diagnosis.procedure import ALPHA
from paint_deposition.inference.diagnosis.verdict import Diagnosis, percent
from paint_deposition.report import words
from paint_deposition.report.data import ReportData
from paint_deposition.report.page import facts
from paint_deposition.report.page.tables import class_rows

# Chance of deviations this large from the gauge alone, below which the model is called off.
CHANCE = 0.01
# An effect less probable than this is not called for.
LIKELY = 0.5


@dataclass(frozen=True)
class Headline:
    """What stands at the top of the report."""

    tone: str  # 'good', 'found', 'open' or 'bad'
    # What kind of verdict, and the verdict.
    kicker: str
    title: str
    # (question, answer) in the order of reading; an empty answer is left out.
    facts: tuple[tuple[str, str], ...]


def headline(data: ReportData) -> Headline:
    """Verdict and facts."""
    diagnosis = data.diagnosis
    if data.names:
        return _side_by_side(data)
    if diagnosis is None:
        return _compared(data)
    # A diagnosis adds effects that it is sure of, and keeps learned laws for what they predict.
    added = [c for c in diagnosis.classes if c.best in diagnosis.accepted]
    if any(
        c.probability < 1.0 if words.is_learned(c.best) else c.probability <= SURE for c in added
    ):
        return _asked_for(data, diagnosis, min(c.probability for c in added))
    return {
        'effect_missing': _missing,
        'none_missing': _nothing,
        'undecided': _undecided,
        'unknown_effect': _unknown,
        'fit_broken': _broken,
    }[diagnosis.verdict](data, diagnosis)


def _missing(data: ReportData, diagnosis: Diagnosis) -> Headline:
    rows = facts.accepted_rows(data)
    named = [row for row in rows if not words.is_learned(row['id'])]
    answers = (
        ('Is it good enough', facts.good_enough(diagnosis)),
        ('What is missing', facts.effect_meanings(named)),
        ('How sure', f'{facts.accepted_words(rows)} {facts.p_value_sentence(diagnosis)}'),
        ('How much better', facts.changes(data, diagnosis)),
        ('What to do', facts.to_use(data, named)),
        ('What it costs', facts.cost_of_missing(data, diagnosis)),
        ('What is learned', facts.learned(data, diagnosis, 'What their laws leave over')),
        ('What is left out', facts.left_out(data)),
    )
    names = words.joined([facts.with_confounded(row) for row in named])
    kicker = 'An effect is missing' if len(named) == 1 else 'Effects are missing'
    return Headline('found', kicker, f'The model lacked {names}', answers)


def _asked_for(data: ReportData, diagnosis: Diagnosis, probability: float) -> Headline:
    """An effect that the user had added, and that no diagnosis would have added."""
    rows = facts.accepted_rows(data)
    names = words.joined([facts.with_article(row['id']) for row in rows])
    title = (
        f'The readings do not call for {names}'
        if probability < LIKELY
        else f'The readings do not settle whether {names} was missing'
    )
    if probability > SURE:
        title = f'{words.capital(names)} was added'
    more = 'Something is missing: run the diagnosis to find the cause.'
    answers = (
        ('What was added', facts.effect_meanings(rows)),
        ('What is learned', facts.learned(data, diagnosis, 'It')),
        ('How sure', f'{facts.accepted_words(rows)} {facts.p_value_sentence(diagnosis)}'),
        ('What it does', facts.cost_of_missing(data, diagnosis)),
        ('What changes', facts.changes(data, diagnosis)),
        ('What to do', more if diagnosis.p_value < ALPHA else ''),
    )
    return Headline('open', 'Added as asked', title, answers)


def _nothing(data: ReportData, diagnosis: Diagnosis) -> Headline:
    answers = (
        ('Is it good enough', f'{facts.good_enough(diagnosis)} {diagnosis.reason}'),
        ('What is missing', 'Nothing that these readings can show.'),
        ('How sure', f'{facts.p_value_sentence(diagnosis)} {facts.not_testable(diagnosis)}'),
        ('What changes', facts.changes(data, diagnosis)),
        ('What to do', 'Simulate and plan with model.yaml of this folder.'),
        ('What is left out', facts.left_out(data)),
    )
    return Headline('good', 'Nothing is missing', 'The model agrees with the readings', answers)


def _undecided(data: ReportData, diagnosis: Diagnosis) -> Headline:
    rows = [row for row in class_rows(data) if not row['accepted']]
    causes = [
        f'{facts.with_confounded(row)} ({percent(row["found"].probability)})' for row in rows[:3]
    ]
    named = [name for name in diagnosis.accepted if not words.is_learned(name)]
    more = 'more ' if named else ''
    answers = (
        ('Is it good enough', facts.good_enough(diagnosis)),
        ('What is missing', f'Something {more}is, most likely {words.joined(causes, "or")}.'),
        (
            'How sure',
            f'{facts.p_value_sentence(diagnosis)} No single cause is probable enough to be added.',
        ),
        ('How much better', facts.changes(data, diagnosis)),
        ('What to do', facts.next_steps(data)),
        ('What is learned', facts.learned(data, diagnosis, 'What is missing')),
        ('What is left out', facts.left_out(data)),
    )
    title = f'Something {more}is missing; the readings do not say which'
    return Headline('open', 'Undecided', title, answers)


def _unknown(data: ReportData, diagnosis: Diagnosis) -> Headline:
    unknown, reason, where = diagnosis.unknown, diagnosis.reason, ''
    title = 'Something shows that no known effect explains'
    remedy = (
        'Write the effect you suspect as a file of your own and add it; the charts of the '
        'residual below show its shape.'
    )
    if unknown:
        label = words.covariate_label(unknown.covariate).split(' [')[0].split(',')[0].lower()
        reason = reason.replace(f'against {unknown.covariate}', f'against {label}')
        where = (
            f'{words.capital(words.in_print(unknown.where))}; most clearly against {label} '
            f'({words.p_words(unknown.p_value)}).'
        )
    if any(map(words.is_learned, diagnosis.accepted)):
        title += '; its law was learned'
        remedy = (
            'Look at the learned laws below, and name the cause if you can. The model with them '
            'predicts as the error says, within the range of the readings.'
        )
    answers = (
        ('Is it good enough', facts.good_enough(diagnosis)),
        ('What is missing', reason),
        ('Where it shows', where),
        ('How sure', facts.p_value_sentence(diagnosis)),
        ('How much better', facts.changes(data, diagnosis)),
        ('What to do', remedy),
        ('What is learned', facts.learned(data, diagnosis, 'It')),
        ('What is left out', facts.left_out(data)),
    )
    return Headline('open', 'Unexplained', title, answers)


def _broken(data: ReportData, diagnosis: Diagnosis) -> Headline:
    more = (
        'No conclusion was drawn. The charts below show the fit as it stands, to find the fault.'
    )
    answers = (
        ('Why', f'{words.capital(diagnosis.reason)}.'),
        ('What changes', f'{facts.changes(data, diagnosis)} {more}'),
    )
    return Headline('bad', 'Not usable', 'The fit cannot be trusted', answers)


def _compared(data: ReportData) -> Headline:
    regions, points = data.comparisons[-1].regions, data.comparisons[-1].points
    freedom = min(data.study.noise.degrees_of_freedom, 1e6)
    by_chance = float(fdtrc(len(points), freedom, points.chi_square_per_reading))
    title = 'The model agrees with the readings'
    if regions:
        title = 'The model misses the readings in places'
    elif by_chance < CHANCE:
        title = 'The model is further off than the gauge explains'
    off = bool(regions) or by_chance < CHANCE
    worst = float(np.abs(points.residual_um[points.worst]))
    where = ' '.join(
        f'{words.capital(words.in_print(region.description))}.' for region in regions[:3]
    )
    answers = (
        (
            'How far off',
            f'RMSE {words.micrometres(points.rmse_um)}, at worst {words.micrometres(worst)}; '
            f'the gauge alone gives {words.micrometres(data.study.noise_floor_um)}.',
        ),
        ('Where', where or 'No region stands out.'),
        ('What to do', 'Run the diagnosis on this campaign to find the cause.' if off else ''),
    )
    return Headline('open' if off else 'good', 'Comparison', title, answers)


def _side_by_side(data: ReportData) -> Headline:
    errors = [comparison.points.rmse_um for comparison in data.comparisons]
    best = data.names[int(np.argmin(errors))]
    each = [f'{n} {words.micrometres(e)}' for n, e in zip(data.names, errors, strict=True)]
    floor = words.micrometres(data.study.noise_floor_um)
    remedy = 'unless it was fitted to these very readings and the others were not.'
    answers = (
        ('How far off', f'RMSE at the points of {words.joined(each)}; the gauge alone: {floor}.'),
        ('What to do', f'Take {best}, {remedy}'),
    )
    return Headline('open', 'Side by side', f'{best} has the smallest error', answers)


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
