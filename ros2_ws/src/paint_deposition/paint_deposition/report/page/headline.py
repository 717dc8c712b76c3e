"""The verdict in plain words for the engineer who runs the process."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from paint_deposition.diagnosis.model_space import SURE
from paint_deposition.diagnosis.procedure import ALPHA
from paint_deposition.diagnosis.verdict import Diagnosis, percent
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.tables import class_rows
from paint_deposition.report.words import (
    capital,
    covariate_label,
    effect_name,
    in_print,
    is_learned,
    joined,
    micrometres,
    p_words,
    percent_words,
)

# Chance of deviations this large from the gauge alone, below which the model is called off.
CHANCE = 0.01
# An effect less probable than this is not called for.
LIKELY = 0.5


@dataclass(frozen=True)
class Headline:
    """What stands at the top of the report.

    Attributes:
        tone: 'good', 'found', 'open' or 'bad'.
        kicker, title: what kind of verdict, and the verdict.
        facts: (question, answer) in the order of reading; an empty answer is left out.
    """

    tone: str
    kicker: str
    title: str
    facts: tuple[tuple[str, str], ...]


def headline(data: ReportData) -> Headline:
    """Verdict and facts."""
    diagnosis = data.diagnosis
    if diagnosis is None:
        return _compared(data)
    # A diagnosis adds only what it is sure of.
    added = [c.probability for c in diagnosis.classes if c.best in diagnosis.accepted]
    if added and min(added) <= SURE:
        return _asked_for(data, diagnosis, min(added))
    return {
        'effect_missing': _missing,
        'none_missing': _nothing,
        'undecided': _undecided,
        'unknown_effect': _unknown,
        'fit_broken': _broken,
    }[diagnosis.verdict](data, diagnosis)


def _missing(data: ReportData, diagnosis: Diagnosis) -> Headline:
    rows = _accepted_rows(data)
    facts = (
        ('What is missing', _explained([row for row in rows if not is_learned(row['id'])])),
        ('How sure', f'{_sure(rows)} {_chance(diagnosis)}'),
        ('What it costs', _costs(data, diagnosis)),
        ('What changes', _changes(data, diagnosis)),
    )
    named = [row for row in rows if not is_learned(row['id'])]
    names = joined([_with_confounded(row) for row in named])
    return Headline('found', 'An effect is missing', f'The model lacked {names}', facts)


def _asked_for(data: ReportData, diagnosis: Diagnosis, probability: float) -> Headline:
    """An effect that the user had added although the readings do not show it for sure."""
    rows = _accepted_rows(data)
    names = joined([_with_article(row['id']) for row in rows])
    title = (
        f'The readings do not call for {names}'
        if probability < LIKELY
        else f'The readings do not settle whether {names} was missing'
    )
    more = 'Something is missing: run the diagnosis to find the cause.'
    facts = (
        ('What was added', _explained(rows)),
        ('How sure', f'{_sure(rows)} {_chance(diagnosis)}'),
        ('What it does', _costs(data, diagnosis)),
        ('What changes', _changes(data, diagnosis)),
        ('What to do', more if diagnosis.p_value < ALPHA else ''),
    )
    return Headline('open', 'Added as asked', title, facts)


def _nothing(data: ReportData, diagnosis: Diagnosis) -> Headline:
    facts = (
        ('What is missing', 'Nothing that these readings can show.'),
        ('How sure', f'{_chance(diagnosis)} {_blind(diagnosis)}'),
        ('What changes', _changes(data, diagnosis)),
    )
    return Headline('good', 'Nothing is missing', 'The model agrees with the readings', facts)


def _undecided(data: ReportData, diagnosis: Diagnosis) -> Headline:
    rows = [row for row in class_rows(data) if not row['accepted']]
    causes = [f'{_with_confounded(row)} ({percent(row["found"].probability)})' for row in rows[:3]]
    more = 'more ' if diagnosis.accepted else ''
    facts = (
        ('What is missing', f'Something {more}is, most likely {joined(causes, "or")}.'),
        ('How sure', f'{_chance(diagnosis)} No single cause is probable enough to be added.'),
        ('What changes', _changes(data, diagnosis)),
        ('What to do', _next(data)),
    )
    title = f'Something {more}is missing; the readings do not say which'
    return Headline('open', 'Undecided', title, facts)


def _unknown(data: ReportData, diagnosis: Diagnosis) -> Headline:
    unknown, where = diagnosis.unknown, ''
    title = 'Something shows that no known effect explains'
    remedy = (
        'Write the effect you suspect as a file of your own and add it; the charts of the '
        'residual below show its shape.'
    )
    if unknown:
        label = covariate_label(unknown.covariate).split(' [')[0].split(',')[0].lower()
        where = (
            f'{capital(in_print(unknown.where))}; most clearly against {label} '
            f'({p_words(unknown.p_value)}).'
        )
        if any(map(is_learned, diagnosis.accepted)):
            title += '; its law was learned'
            remedy = (
                'Look at the curve of the learned law below, and name its cause if you can. The '
                'model with it predicts as the error says, within the range of the readings.'
            )
        if unknown.kind == 'footprint':
            title = "The gun's pattern differs from the model's two Gaussians"
            remedy = 'Spray one straight pass on a flat panel and measure across it.'
    facts = (
        ('What is missing', diagnosis.reason),
        ('Where it shows', where),
        ('How sure', _chance(diagnosis)),
        ('What changes', _changes(data, diagnosis)),
        ('What to do', remedy),
    )
    return Headline('open', 'Unexplained', title, facts)


def _broken(data: ReportData, diagnosis: Diagnosis) -> Headline:
    facts = (
        ('Why', f'{capital(diagnosis.reason)}.'),
        (
            'What changes',
            f'{_changes(data, diagnosis)} No conclusion was drawn. The charts below show the '
            'fit as it stands, to find the fault.',
        ),
    )
    return Headline('bad', 'Not usable', 'The fit cannot be trusted', facts)


def _compared(data: ReportData) -> Headline:
    regions, points = data.comparisons[-1].regions, data.comparisons[-1].points
    freedom = min(data.study.noise.degrees_of_freedom, 1e6)
    chance = float(fisher.sf(points.chi_square_per_reading, len(points), freedom))
    title = 'The model agrees with the readings'
    if regions:
        title = 'The model misses the readings in places'
    elif chance < CHANCE:
        title = 'The model is further off than the gauge explains'
    off = bool(regions) or chance < CHANCE
    worst = float(np.abs(points.residual_um[points.worst]))
    where = ' '.join(f'{capital(in_print(region.description))}.' for region in regions[:3])
    facts = (
        (
            'How far off',
            f'RMSE {micrometres(points.rmse_um)}, at worst {micrometres(worst)}; '
            f'the gauge alone gives {micrometres(data.study.noise_floor_um)}.',
        ),
        ('Where', where or 'No region stands out.'),
        ('What to do', 'Run the diagnosis on this campaign to find the cause.' if off else ''),
    )
    return Headline('open' if off else 'good', 'Comparison', title, facts)


def key_figures(data: ReportData) -> list[tuple[str, str, str, str]]:
    """(label, before or '', after, remark) of the figures beside the facts."""
    noise, diagnosis = data.study.noise, data.diagnosis
    source = {'repeats': 'from repeats', 'stated': 'as stated'}.get(noise.source, noise.source)
    floor = ('Gauge noise', '', f'{data.study.noise_floor_um:.2f}', f'µm, {source}')
    if diagnosis is None:
        rmse_um = data.comparisons[-1].points.rmse_um
        return [('RMSE', '', f'{rmse_um:.2f}', 'µm on all points'), floor]
    fitted = [f'{step.rmse_um:.2f}' for step in diagnosis.history]
    left_out = [f'{step.holdout_rmse_um:.2f}' for step in diagnosis.history]
    found = [
        (f'RMSE, {label}', errors[0] if len(errors) > 1 else '', errors[-1], 'µm')
        for label, errors in (('fitted points', fitted), ('points left out', left_out))
    ]
    found.append(floor)
    for best in diagnosis.classes[:1]:
        remark = 'probability' + (', with its like' if len(best.members) > 1 else '')
        found.append((effect_name(best.best), '', percent(best.probability), remark))
    return found


def _explained(rows: list[dict]) -> str:
    return ' '.join(f'{capital(row["name"])}: {row["meaning"]}' for row in rows)


def _with_confounded(row: dict) -> str:
    if not row['others']:
        return row['name']
    return f'{row["name"]} (or {joined(row["others"], "or")})'


def _sure(rows: list[dict]) -> str:
    """How probable each of the effects is; a learned law names none."""
    found = []
    for row in rows:
        if is_learned(row['id']):
            continue
        names = joined([row['name'], *row['others']], 'or')
        text = f'{capital(names)} with a probability of {percent_words(row["found"].probability)}'
        if row['others']:
            text += '; these readings leave open which of them it is'
        found.append(f'{text}.')
    return ' '.join(found)


def _chance(diagnosis: Diagnosis) -> str:
    if not diagnosis.p_value < 1.0:
        return ''
    share = 'fewer than 0.1 %' if diagnosis.p_value < 1e-3 else f'{100 * diagnosis.p_value:.2g} %'
    return f'If nothing were missing, readings would look this suspicious in {share} of cases.'


def _costs(data: ReportData, diagnosis: Diagnosis) -> str:
    """What each effect that was added does to the readings."""
    return ' '.join(
        f'{capital(_with_article(name))} changes the reading by '
        f'{micrometres(change.least_um, True)} to {micrometres(change.most_um, True)} '
        f'over the part, {micrometres(change.rms_um)} RMS.'
        for name, change in data.changes.items()
        if name in diagnosis.accepted
    )


def _accepted_rows(data: ReportData) -> list[dict]:
    return [row for row in class_rows(data) if row['accepted']]


def _changes(data: ReportData, diagnosis: Diagnosis) -> str:
    """What the model written has that the one fitted before had not."""
    if not diagnosis.accepted:
        return 'The model was fitted as it is; no effect was added.'
    first, last = diagnosis.history[0], diagnosis.history[-1]
    return (
        f'{" ".join(_added(row) for row in _accepted_rows(data))} At points left out of the fit '
        f'the error goes from {micrometres(first.holdout_rmse_um)} to '
        f'{micrometres(last.holdout_rmse_um)}; the gauge itself scatters by '
        f'{micrometres(data.study.noise_floor_um)}.'
    )


def _added(row: dict) -> str:
    values = [
        f'{p["words"]} {p["value"]} {p["unit"]}'.rstrip()
        + (f' ({p["low"]} to {p["high"]})' if 'low' in p else '')
        for p in row['parameters']
    ]
    text = ' '.join(values) if is_learned(row['id']) else joined(values)
    return f'{capital(_with_article(row["id"]))} was added with {text}.'


def _with_article(name: str) -> str:
    return f'a {effect_name(name)}' if is_learned(name) else effect_name(name)


def _blind(diagnosis: Diagnosis) -> str:
    names = [effect_name(e) for e in diagnosis.not_testable]
    return f'Not testable with these readings: {joined(names)}.' if names else ''


def _next(data: ReportData) -> str:
    _, sprays = data.proposals
    if not sprays:
        return 'Take more readings, and repeats at some points.'
    spray = sprays[0]
    first, second = (effect_name(e) for e in spray.separates)
    return f'Spray {spray.what}: it separates {first} from {second}.'
