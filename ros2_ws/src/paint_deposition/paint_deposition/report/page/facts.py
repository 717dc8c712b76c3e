"""Sentences of the headline: what is missing, how sure that is, what it costs and what changes."""

from itertools import pairwise

from paint_deposition.inference.diagnosis.verdict import Diagnosis, Step, percent
from paint_deposition.report import words
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.tables import class_rows

# What in the cell is worth a look where an effect is more than physics.
CHECKS = {
    'air_drift': "Measure the booth's draught at the part.",
    'corner_slowdown': 'Compare the speed reached at turns with the programmed one.',
    'flow_drift': 'Check the paint flow over the time of a part.',
    'gauge_curvature_bias': 'Check the gauge on a curved sample of known film.',
    'gauge_gain': 'Calibrate the gauge.',
    'gauge_zero': 'Zero the gauge on bare metal.',
    'part_misalignment': 'Check where the part hangs.',
    'pose_lag': 'Check the clocks of robot and recording.',
    'tcp_offset': 'Check the TCP.',
    'tcp_standoff': 'Check the TCP along the axis of the bell.',
    'tcp_tilt': "Check the direction of the bell's axis in the TCP.",
    'trigger_lag': 'Check the lead times of the trigger.',
}


def good_enough(diagnosis: Diagnosis) -> str:
    """Whether the model predicts what it has not seen, before and with what was found."""
    first, last = diagnosis.history[0], diagnosis.history[-1]
    noise_um, um = diagnosis.noise_floor_um, words.micrometres
    after = (
        f'{um(last.holdout_rmse_um)} RMS, {um(last.beyond_noise_um(noise_um))} beyond gauge and '
        f'texture ({um(noise_um)})'
    )
    where = f'on {diagnosis.left_out} left out of the fit'
    if diagnosis.verdict == 'none_missing':
        return f'Yes. {words.capital(where)} the model is off by {after}.'
    if first is last:
        return f'No. {words.capital(where)} the model is off by {after}.'
    return (
        f'Not as it was: {where} it was off by {um(first.holdout_rmse_um)} RMS. With what was '
        f'found it is off by {after}.'
    )


def effect_meanings(rows: list[dict]) -> str:
    return ' '.join(f'{words.capital(row["name"])}: {row["meaning"]}' for row in rows)


def with_confounded(row: dict) -> str:
    others = f' (or {words.joined(row["others"], "or")})' if row['others'] else ''
    return f'{row["name"]}{others}'


def accepted_words(rows: list[dict]) -> str:
    """How probable each of the effects is; a learned law names none."""
    found = []
    for row in rows:
        if words.is_learned(row['id']):
            continue
        names = words.joined([row['name'], *row['others']], 'or')
        probability = percent(row['found'].probability)
        probability = probability.replace('>', 'more than').replace('<', 'less than')
        text = f'{words.capital(names)} with a probability of {probability}'
        if row['others']:
            text += '; these readings leave open which of them it is'
        found.append(f'{text}.')
    return ' '.join(found)


def p_value_sentence(diagnosis: Diagnosis) -> str:
    if not diagnosis.p_value < 1.0:
        return ''
    share = 'fewer than 0.1 %' if diagnosis.p_value < 1e-3 else f'{100 * diagnosis.p_value:.2g} %'
    return f'If nothing were missing, readings would look this suspicious in {share} of cases.'


def cost_of_missing(data: ReportData, diagnosis: Diagnosis) -> str:
    """By how much predictions are wrong without each effect that was added."""
    found = []
    for before, step in pairwise(diagnosis.history):
        change, um = data.changes[step.added], words.micrometres
        found.append(
            f'Without {with_article(step.added)}, once the pattern has adapted as well as it can, '
            f'the prediction differs by {um(change.rms_um)} RMS at the points, by '
            f'{um(change.least_um, True)} to {um(change.most_um, True)} at single ones, and the '
            f'error is {um(before.rmse_um)} instead of {um(step.rmse_um)}.'
        )
    return ' '.join(found)


def accepted_rows(data: ReportData) -> list[dict]:
    return [row for row in class_rows(data) if row['accepted']]


def learned(data: ReportData, diagnosis: Diagnosis, what: str) -> str:
    """The laws that were learned, with their values and ranges, and the error before and after."""
    rows = [row for row in accepted_rows(data) if words.is_learned(row['id'])]
    if not rows:
        return ''
    laws = [f'a {row["name"].removeprefix("learned ")} ({_values(row)})' for row in rows]
    before, after = diagnosis.history[-2:]
    return f'{what} was learned as {words.joined(laws)}. {_errors(diagnosis, before, after)}'


def left_out(data: ReportData) -> str:
    """Slips among the readings, with what was probably meant."""
    outliers = []
    for outlier in data.study.outliers:
        where, guess_um = outlier.point.replace(': ', ' '), outlier.guess_um
        meant = '' if guess_um is None else f' (was it {words.micrometres(guess_um)}?)'
        outliers.append(
            f'{words.micrometres(outlier.thickness_um)} at {where}, where '
            f'{words.micrometres(outlier.expected_um)} is expected{meant}'
        )
    return f'The fit is without {words.joined(outliers)}. Measure there again.' if outliers else ''


def changes(data: ReportData, diagnosis: Diagnosis) -> str:
    """What the model written has that the one fitted before had not, learned laws apart."""
    if not diagnosis.accepted:
        return 'The model was fitted as it is; no effect was added.'
    added = ' '.join(
        f'{words.capital(row["name"])} was added with {_values(row)}.'
        for row in accepted_rows(data)
        if not words.is_learned(row['id'])
    )
    return added and f'{added} {_errors(diagnosis, diagnosis.history[0], diagnosis.history[-1])}'


def _errors(diagnosis: Diagnosis, before: Step, after: Step) -> str:
    worse = f' Worse than before: {"; ".join(diagnosis.worse)}.' if diagnosis.worse else ''
    first, last, noise, noise_left = map(words.micrometres, (
        before.holdout_rmse_um, after.holdout_rmse_um,
        before.beyond_noise_um(diagnosis.noise_floor_um),
        after.beyond_noise_um(diagnosis.noise_floor_um),
    ))  # fmt: skip
    return (
        f'The error on {diagnosis.left_out} left out of the fit: {first} → {last}; beyond gauge '
        f'and texture: {noise} → {noise_left}.{worse}'
    )


def _values(row: dict) -> str:
    values = [
        f'{p["words"]} {p["value"]} {p["unit"]}'.rstrip()
        + (f' ({p["low"]} to {p["high"]})' if 'low' in p else '')
        for p in row['parameters']
    ]
    return ' '.join(values) if words.is_learned(row['id']) else words.joined(values)


def with_article(name: str) -> str:
    return f'a {words.effect_name(name)}' if words.is_learned(name) else words.effect_name(name)


def not_testable(diagnosis: Diagnosis) -> str:
    names = [words.effect_name(e) for e in diagnosis.not_testable]
    return f'Not testable with these readings: {words.joined(names)}.' if names else ''


def next_steps(data: ReportData) -> str:
    """The spray that settles most."""
    _, sprays = data.proposals
    if not sprays:
        return 'Take more readings, and repeats at some points.'
    return f'Spray {sprays[0].what}: {words.separation_words(sprays[0])}.'


def to_use(data: ReportData, named: list[dict]) -> str:
    """What a shop does with a model that has found its effects."""
    checks = dict.fromkeys(
        CHECKS.get(one, '') for row in named for one in (row['id'], *row['like'])
    )
    plan = 'Simulate and plan with model.yaml of this folder: it holds what was missing.'
    settle = next_steps(data) if data.proposals[1] and any(row['others'] for row in named) else ''
    return ' '.join(filter(None, [*checks, plan, settle]))
