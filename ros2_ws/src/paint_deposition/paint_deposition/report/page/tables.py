"""Rows of the report's tables."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from paint_deposition.diagnosis.verdict import Interval, percent
from paint_deposition.effects.base import Effect
from paint_deposition.fitting.estimates import estimates
from paint_deposition.fitting.parameters import PATTERN_NAMES
from paint_deposition.report.data import ReportData
from paint_deposition.report.words import (
    SYMBOLS,
    effect_meaning,
    effect_name,
    in_unit,
    number,
    parameter_words,
    percent_words,
    step_words,
)


def class_rows(data: ReportData) -> list[dict[str, Any]]:
    """Candidate causes with their probability, confounded effects and parameters."""
    if data.diagnosis is None:
        return []
    rows = []
    for candidate in data.diagnosis.classes:
        effect = data.effect_class(candidate.best)
        rows.append(
            {
                'name': effect_name(candidate.best),
                'id': candidate.best,
                'others': [effect_name(m) for m in candidate.members if m != candidate.best],
                'accepted': candidate.best in data.diagnosis.accepted,
                'probability': percent(candidate.probability),
                'probability_words': percent_words(candidate.probability),
                'share': round(100.0 * candidate.probability, 1),
                'meaning': effect_meaning(effect),
                'signature': effect.signature if effect else '',
                'parameters': [
                    _parameter(effect, name, found.value, found)
                    for name, found in candidate.parameters.items()
                ],
                'holdout': candidate.holdout_rmse_um,
            }
        )
    return rows


def _parameter(
    effect: type[Effect] | None, name: str, value: float, interval: Interval | None = None
) -> dict[str, str]:
    """A parameter in words, with its 95 % interval if there is one."""
    unit = effect.parameters()[name]['unit'] if effect else ''
    shown, shown_unit = in_unit(value, unit)
    row = {'words': parameter_words(name, unit), 'value': shown, 'unit': shown_unit}
    if interval is None:
        return row
    factor = 1e3 if shown_unit in ('mm', 'ms') else 1.0
    low, high = number(factor * interval.low), number(factor * interval.high)
    return row | {'low': low, 'high': high}


def pattern_rows(data: ReportData) -> list[dict[str, str]]:
    """The pattern's parameters; with 95 % intervals where the model was fitted."""
    intervals = _pattern_intervals(data)
    rows: list[dict[str, str]] = []
    for name in PATTERN_NAMES:
        symbol, words, unit = SYMBOLS[name]
        factor, shown = (1e3, 'mm') if unit == 'm' else (1.0, unit)
        row = {
            'symbol': symbol,
            'words': words,
            'unit': shown,
            'value': number(factor * getattr(data.model.planar, name), 4),
        }
        if name in intervals:
            low, high = intervals[name]
            row['interval'] = f'{number(factor * low)} to {number(factor * high)}'
        rows.append(row)
    return rows


def _pattern_intervals(data: ReportData) -> dict[str, tuple[float, float]]:
    if data.diagnosis is None:
        return {}
    return {e.name: (e.low, e.high) for e in estimates(data.diagnosis.history[-1].fit)}


def effect_rows(data: ReportData) -> list[dict[str, Any]]:
    """Effects in the best model, what each does to the film, and its parameters."""
    known = {c.best: c.parameters for c in data.diagnosis.classes} if data.diagnosis else {}
    rows = []
    for effect in data.model.effects:
        parameters = []
        for name in effect.parameters():
            found = known.get(effect.id, {}).get(name)
            value = found.value if found else getattr(effect, name)
            parameters.append(_parameter(type(effect), name, value, found))
        rows.append(
            {
                'name': effect_name(effect.id),
                'id': effect.id,
                'change': data.changes[effect.id],
                'parameters': parameters,
            }
        )
    return rows


def blind_rows(data: ReportData) -> list[dict[str, Any]]:
    """Effects that these readings could not show, and what would have been seen of others."""
    if data.diagnosis is None:
        return []
    rows: list[dict[str, Any]] = []
    accepted = set(data.diagnosis.accepted)
    for effect_id in (*data.diagnosis.not_testable, *data.diagnosis.detectable):
        if effect_id in accepted or effect_id in [row['id'] for row in rows]:
            continue
        effect = data.effect_class(effect_id)
        seen = data.diagnosis.detectable.get(effect_id, {})
        amplitudes = [
            {
                'words': parameter_words(name, info['unit']),
                'least': _size(seen.get(name), info['unit']),
                'usual': _size(info['typical'], info['unit']),
            }
            for name, info in (effect.parameters() if effect else {}).items()
            if info['role'] == 'amplitude'
        ]
        rows.append(
            {
                'id': effect_id,
                'name': effect_name(effect_id),
                'testable': effect_id not in data.diagnosis.not_testable,
                'amplitudes': amplitudes,
                'meaning': effect_meaning(effect),
            }
        )
    return rows


def _size(value: float | None, unit: str) -> str:
    if value is None or not np.isfinite(value):
        return ''
    return ' '.join(in_unit(abs(value), unit)).strip()


def history_rows(data: ReportData) -> list[dict[str, Any]]:
    """Models in the order in which they were made; what a file does not tell is None."""
    return [
        {
            'added': step_words(step),
            'campaign': str(step.get('campaign', '')),
            'rmse': _figure(step, 'rmse_um'),
            'holdout': _figure(step, 'holdout_rmse_um'),
            'noise': _figure(step, 'noise_floor_um'),
        }
        for step in data.history
    ]


def _figure(step: Mapping[str, Any], name: str) -> float | None:
    value = step.get(name)
    return value if isinstance(value, int | float) else None


def misfit_rows(data: ReportData) -> list[dict[str, Any]]:
    """Experiments, their groups and passes: bias and RMSE before and after."""
    later = {(m.experiment, m.kind, m.label): m for m in data.comparisons[-1].misfits}
    return [
        {'before': m, 'after': later.get((m.experiment, m.kind, m.label), m)}
        for m in data.comparisons[0].misfits
    ]
