"""The verdict in plain words for the engineer who runs the process."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from paint_deposition.diagnosis.procedure import ALPHA, SURE
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.tables import class_rows, effect_rows
from paint_deposition.report.words import (
    covariate_label,
    effect_name,
    in_print,
    joined,
    micrometres,
    p_words,
    percent,
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
        facts: (question, answer) in the order of reading.
        figures: (label, before or '', after, remark) of the key figures.
    """

    tone: str
    kicker: str
    title: str
    facts: tuple[tuple[str, str], ...]
    figures: tuple[tuple[str, str, str, str], ...]


def headline(data: ReportData) -> Headline:
    """Verdict, facts and key figures."""
    if data.diagnosis is None:
        tone, kicker, title, facts = _compared(data)
    elif _least_probable(data) <= SURE:
        tone, kicker, title, facts = _asked_for(data)
    else:
        verdict = data.diagnosis.verdict
        tone, kicker, title, facts = {
            'effect_missing': _missing,
            'none_missing': _nothing,
            'undecided': _undecided,
            'unknown_effect': _unknown,
            'fit_broken': _broken,
        }[verdict](data)
    return Headline(tone, kicker, title, tuple(facts), tuple(_figures(data)))


def _missing(data: ReportData):
    rows = _accepted_rows(data)
    names = joined([_with_rivals(row) for row in rows])
    facts = [
        ('What is missing', ' '.join(f'{_capital(r["name"])}: {r["meaning"]}' for r in rows)),
        ('How sure', ' '.join(_sure(row) for row in rows) + f' {_chance(data)}'),
        ('What it costs', _costs(data)),
        ('What changes', _changes(data)),
    ]
    return 'found', 'An effect is missing', f'The model lacked {names}', facts


def _least_probable(data: ReportData) -> float:
    """Of the effects added, the least probability; a diagnosis adds only what it is sure of."""
    accepted = data.diagnosis.accepted
    return min((c.probability for c in data.diagnosis.classes if c.best in accepted), default=1.0)


def _asked_for(data: ReportData):
    """An effect that the user had added although the readings do not show it for sure."""
    rows = _accepted_rows(data)
    names = joined([row['name'] for row in rows])
    title = (
        f'The readings do not call for {names}'
        if _least_probable(data) < LIKELY
        else f'The readings do not settle whether {names} was missing'
    )
    facts = [
        ('What was added', ' '.join(f'{_capital(r["name"])}: {r["meaning"]}' for r in rows)),
        ('How sure', ' '.join(_sure(row) for row in rows) + f' {_chance(data)}'),
        ('What it does', _costs(data)),
        ('What changes', _changes(data)),
    ]
    if data.diagnosis.p_value < ALPHA:
        facts.append(('What to do', 'Something is missing: run the diagnosis to find the cause.'))
    return 'open', 'Added as asked', title, facts


def _nothing(data: ReportData):
    facts = [
        ('What is missing', 'Nothing that these readings can show.'),
        ('How sure', _chance(data) + _blind(data)),
        ('What changes', _changes(data)),
    ]
    return 'good', 'Nothing is missing', 'The model agrees with the readings', facts


def _undecided(data: ReportData):
    rows = [row for row in class_rows(data) if not row['accepted']]
    causes = [f'{_with_rivals(row)} ({row["probability"]})' for row in rows[:3]]
    facts = [
        ('What is missing', f'Something {_more(data)}is, most likely {joined(causes, "or")}.'),
        ('How sure', f'{_chance(data)} No single cause is probable enough to be added.'),
        ('What changes', _changes(data)),
        ('What to do', _next(data)),
    ]
    title = f'Something {_more(data)}is missing; the readings do not say which'
    return 'open', 'Undecided', title, facts


def _unknown(data: ReportData):
    unknown = data.diagnosis.unknown
    pattern = unknown is not None and unknown.kind == 'footprint'
    title = (
        "The gun's pattern differs from the model's two Gaussians"
        if pattern
        else 'Something shows that no known effect explains'
    )
    facts = [('What is missing', data.diagnosis.reason)]
    if unknown is not None:
        label = covariate_label(unknown.covariate).split(' [')[0].split(',')[0].lower()
        where = _capital(in_print(unknown.where))
        clearest = f'most clearly against {label} ({p_words(unknown.p_value)})'
        facts.append(('Where it shows', f'{where}; {clearest}.'))
    facts += [
        ('How sure', _chance(data)),
        ('What changes', _changes(data)),
        ('What to do', 'Spray one straight pass on a flat panel and measure across it.' if pattern
         else 'Write the effect you suspect as a file of your own and add it; see the charts of '
              'the residual below for its shape.'),
    ]  # fmt: skip
    return 'open', 'Unexplained', title, facts


def _broken(data: ReportData):
    facts = [
        ('Why', _capital(data.diagnosis.reason) + '.'),
        ('What changes', f'{_changes(data)} No conclusion was drawn. The charts below show the '
                         'fit as it stands, to find the fault.'),
    ]  # fmt: skip
    return 'bad', 'Not usable', 'The fit cannot be trusted', facts


def _compared(data: ReportData):
    comparison = data.comparisons[-1]
    freedom = min(data.study.noise.degrees_of_freedom, 1e6)
    chance = float(fisher.sf(data.chi_square_per_point[-1], len(data.study), freedom))
    off = bool(comparison.regions) or chance < CHANCE
    title = 'The model misses the readings in places' if comparison.regions else (
        'The model is further off than the gauge explains' if off
        else 'The model agrees with the readings'
    )  # fmt: skip
    worst = float(np.max(np.abs(data.residuals_um[-1])))
    facts = [
        ('How far off', f'RMSE {micrometres(data.rmse_um[-1])}, at worst {micrometres(worst)}; '
                        f'the gauge alone gives {micrometres(data.study.noise_floor_um)}.'),
        ('Where', ' '.join(f'{_capital(in_print(r.description))}.' for r in comparison.regions[:3])
         or 'No region stands out.'),
    ]  # fmt: skip
    if off:
        facts.append(('What to do', 'Run the diagnosis on this campaign to find the cause.'))
    return 'open' if off else 'good', 'Comparison', title, facts


def _figures(data: ReportData):
    diagnosis = data.diagnosis
    floor = data.study.noise_floor_um
    if diagnosis is None:
        yield 'RMSE', '', f'{data.rmse_um[-1]:.2f}', 'µm on all points'
    else:
        first, last = diagnosis.history[0], diagnosis.history[-1]
        before = len(diagnosis.history) > 1
        for label, one, two in (
            ('RMSE, fitted points', first.rmse_um, last.rmse_um),
            ('RMSE, points left out', first.holdout_rmse_um, last.holdout_rmse_um),
        ):
            yield label, f'{one:.2f}' if before else '', f'{two:.2f}', 'µm'
    yield 'Gauge noise', '', f'{floor:.2f}', f'µm, {_noise_source(data)}'
    if diagnosis is not None and diagnosis.classes:
        best = diagnosis.classes[0]
        yield (
            effect_name(best.best),
            '',
            percent(best.probability),
            'probability' + (', with its rivals' if len(best.members) > 1 else ''),
        )


def _noise_source(data: ReportData) -> str:
    return {
        'repeats': 'from repeats', 'stated': 'as stated', 'assumed': 'assumed',
    }.get(data.study.noise.source, data.study.noise.source)  # fmt: skip


def _with_rivals(row: dict) -> str:
    if not row['others']:
        return row['name']
    return f'{row["name"]} (or {joined(row["others"], "or")})'


def _sure(row: dict) -> str:
    names = joined([row['name'], *row['others']], 'or')
    text = f'{_capital(names)} with a probability of {row["probability_words"]}'
    if row['others']:
        text += '; these readings cannot tell them apart'
    return text + '.'


def _chance(data: ReportData) -> str:
    p_value = data.diagnosis.p_value
    if not p_value < 1.0:
        return ''
    share = 'fewer than 0.1 %' if p_value < 1e-3 else f'{100.0 * p_value:.2g} %'
    return f'If nothing were missing, readings would look this suspicious in {share} of cases.'


def _cost(row: dict) -> str:
    change = row['change']
    return (
        f'{_capital(row["name"])} changes the reading by {micrometres(change.least_um, True)} to '
        f'{micrometres(change.most_um, True)} over the part, {micrometres(change.rms_um)} RMS.'
    )


def _costs(data: ReportData) -> str:
    accepted = data.diagnosis.accepted
    return ' '.join(_cost(row) for row in effect_rows(data) if row['id'] in accepted)


def _accepted_rows(data: ReportData) -> list[dict]:
    return [row for row in class_rows(data) if row['accepted']]


def _more(data: ReportData) -> str:
    """After what was added already."""
    return 'more ' if data.diagnosis.accepted else ''


def _changes(data: ReportData) -> str:
    """What the model written has that the one fitted before had not."""
    if not data.diagnosis.accepted:
        return 'The model was fitted as it is; no effect was added.'
    first, last = data.diagnosis.history[0], data.diagnosis.history[-1]
    floor = data.study.noise_floor_um
    text = ' '.join(_added(row) for row in _accepted_rows(data))
    text += (
        f' At points left out of the fit the error goes from {micrometres(first.holdout_rmse_um)} '
        f'to {micrometres(last.holdout_rmse_um)}; the gauge itself scatters by '
        f'{micrometres(floor)}.'
    )
    return text


def _added(row: dict) -> str:
    values = [
        f'{p["words"]} {p["value"]} {p["unit"]} ({p["low"]} to {p["high"]})'.replace('  ', ' ')
        for p in row['parameters']
    ]
    return f'{_capital(row["name"])} was added with {joined(values)}.'


def _blind(data: ReportData) -> str:
    names = [effect_name(e) for e in data.diagnosis.not_testable]
    return f' Not testable with these readings: {joined(names)}.' if names else ''


def _next(data: ReportData) -> str:
    if data.sprays:
        spray = data.sprays[0]
        return (
            f'Spray {spray.what}: it separates {effect_name(spray.separates[0])} from '
            f'{effect_name(spray.separates[1])}.'
        )
    return 'Take more readings, and repeats at some points.'


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
