"""Sentences of the headline: what is missing, how sure that is, what it costs and what changes."""

from paint_deposition.diagnosis.verdict import Diagnosis, Step
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.tables import class_rows
from paint_deposition.report.words import (
    apart_words,
    capital,
    effect_name,
    is_learned,
    joined,
    micrometres,
    percent_words,
)


def explained(rows: list[dict]) -> str:
    return ' '.join(f'{capital(row["name"])}: {row["meaning"]}' for row in rows)


def with_confounded(row: dict) -> str:
    if not row['others']:
        return row['name']
    return f'{row["name"]} (or {joined(row["others"], "or")})'


def sure(rows: list[dict]) -> str:
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


def chance(diagnosis: Diagnosis) -> str:
    if not diagnosis.p_value < 1.0:
        return ''
    share = 'fewer than 0.1 %' if diagnosis.p_value < 1e-3 else f'{100 * diagnosis.p_value:.2g} %'
    return f'If nothing were missing, readings would look this suspicious in {share} of cases.'


def costs(data: ReportData, diagnosis: Diagnosis) -> str:
    """What each effect that was added does to the readings."""
    return ' '.join(
        f'{capital(with_article(name))} changes the reading by '
        f'{micrometres(change.least_um, True)} to {micrometres(change.most_um, True)} '
        f'over the part, {micrometres(change.rms_um)} RMS.'
        for name, change in data.changes.items()
        if name in diagnosis.accepted
    )


def accepted_rows(data: ReportData) -> list[dict]:
    return [row for row in class_rows(data) if row['accepted']]


def learned(data: ReportData, diagnosis: Diagnosis, what: str) -> str:
    """The laws that were learned, with their values and ranges, and the error before and after."""
    rows = [row for row in accepted_rows(data) if is_learned(row['id'])]
    if not rows:
        return ''
    laws = [f'a {row["name"].removeprefix("learned ")} ({_values(row)})' for row in rows]
    before, after = diagnosis.history[-2:]
    return f'{what} was learned as {joined(laws)}. {_errors(data, before, after)}'


def left_out(data: ReportData) -> str:
    """Slips among the readings, with what was probably meant."""
    slips = []
    for slip in data.study.slips:
        where, guess_um = slip.point.replace(': ', ' '), slip.guess_um
        meant = '' if guess_um is None else f' (was it {micrometres(guess_um)}?)'
        slips.append(
            f'{micrometres(slip.thickness_um)} at {where}, where '
            f'{micrometres(slip.expected_um)} is expected{meant}'
        )
    return f'The fit is without {joined(slips)}. Measure there again.' if slips else ''


def changes(data: ReportData, diagnosis: Diagnosis) -> str:
    """What the model written has that the one fitted before had not, learned laws apart."""
    if not diagnosis.accepted:
        return 'The model was fitted as it is; no effect was added.'
    added = ' '.join(
        f'{capital(row["name"])} was added with {_values(row)}.'
        for row in accepted_rows(data)
        if not is_learned(row['id'])
    )
    return added and f'{added} {_errors(data, diagnosis.history[0], diagnosis.history[-1])}'


def _errors(data: ReportData, before: Step, after: Step) -> str:
    return (
        f'At points left out of the fit the error goes from {micrometres(before.holdout_rmse_um)} '
        f'to {micrometres(after.holdout_rmse_um)}; the gauge and the texture of the film scatter '
        f'by {micrometres(data.study.noise_floor_um)}.'
    )


def _values(row: dict) -> str:
    values = [
        f'{p["words"]} {p["value"]} {p["unit"]}'.rstrip()
        + (f' ({p["low"]} to {p["high"]})' if 'low' in p else '')
        for p in row['parameters']
    ]
    return ' '.join(values) if is_learned(row['id']) else joined(values)


def with_article(name: str) -> str:
    return f'a {effect_name(name)}' if is_learned(name) else effect_name(name)


def blind(diagnosis: Diagnosis) -> str:
    names = [effect_name(e) for e in diagnosis.not_testable]
    return f'Not testable with these readings: {joined(names)}.' if names else ''


def to_do(data: ReportData) -> str:
    _, sprays = data.proposals
    if not sprays:
        return 'Take more readings, and repeats at some points.'
    return f'Spray {sprays[0].what}: {apart_words(sprays[0])}.'
