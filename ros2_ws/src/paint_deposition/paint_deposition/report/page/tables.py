"""Rows of the report's tables."""

from dataclasses import astuple
from itertools import product
from typing import Any

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.learned.law import LearnedLaw
from paint_deposition.film.statistics import film_statistics
from paint_deposition.inference.diagnosis.verdict import Diagnosis, EffectClass
from paint_deposition.inference.fitting.estimates import estimates
from paint_deposition.inference.fitting.pattern_vector import PATTERN_NAMES
from paint_deposition.report import words
from paint_deposition.report.data import ReportData
from paint_deposition.report.style import TWO_SIDED_95

LOW, IN, HIGH = 'low', 'in', 'high'


def class_rows(data: ReportData) -> list[dict[str, Any]]:
    """Candidate causes with the effects they are confounded with, and parameters."""
    diagnosis = data.diagnosis
    return [_class_row(data, diagnosis, c) for c in diagnosis.classes] if diagnosis else []


def _class_row(data: ReportData, diagnosis: Diagnosis, found: EffectClass) -> dict[str, Any]:
    effect = data.effect_class(found.best)
    like = [member for member in found.members if member != found.best]
    parameters = [
        _parameter(effect, name, *astuple(value)) for name, value in found.parameters.items()
    ]
    return {
        'id': found.best,
        'found': found,
        'name': words.effect_name(found.best),
        'like': like,
        'others': [words.effect_name(member) for member in like],
        'accepted': found.best in diagnosis.accepted,
        'meaning': words.effect_meaning(effect),
        'signature': effect.signature if effect else '',
        'parameters': parameters + _learned(data.model.effect(found.best)),
    }


def _parameter(effect: type[Effect] | None, name: str, *values: float) -> dict[str, str]:
    """A parameter in words: its value, and the ends of its 95 % interval if there is one."""
    unit = effect.parameters()[name]['unit'] if effect else ''
    # A value below this share of its interval is printed as none.
    if abs(values[0]) < 1e-4 * np.ptp(values):
        values = (0.0, *values[1:])
    printed = zip(('unit', 'value', 'low', 'high'), words.in_unit(unit, *values), strict=False)
    return {'words': words.parameter_words(name, unit)} | dict(printed)


def _learned(effect: Effect | None) -> list[dict[str, str]]:
    """The curve and the range of a learned law; nothing for other effects."""
    if not isinstance(effect, LearnedLaw):
        return []
    keys = ('words', 'value', 'unit')
    return [dict(zip(keys, row, strict=True)) for row in words.learned_words(effect)]


def pattern_rows(data: ReportData) -> list[dict[str, str]]:
    """The pattern's parameters; with 95 % intervals where the model was fitted."""
    fitted = estimates(data.diagnosis.history[-1].fit) if data.diagnosis else ()
    found = {estimate.name: estimate for estimate in fitted}
    brushes, rows = data.model.brushes, []
    of = [f'brush {brush.number}: ' if len(brushes) > 1 else '' for brush in brushes] or ['']
    for (whose, planar), name in product(zip(of, data.model.patterns, strict=True), PATTERN_NAMES):
        symbol, meaning, unit = words.SYMBOLS[name]
        factor, shown = (1e3, 'mm') if unit == 'm' else (1.0, unit)
        value = words.number(factor * getattr(planar, name), 4)
        row = {'symbol': symbol, 'words': whose + meaning, 'unit': shown, 'value': value}
        if name in found:
            ends = (words.number(factor * end) for end in (found[name].low, found[name].high))
            row['interval'] = ' to '.join(ends)
        rows.append(row)
    return rows


def noise_rows(data: ReportData) -> list[tuple[str, str, str]]:
    """What the readings scatter by: what, how much, and how that is known."""
    noise, texture = data.study.noise, data.study.texture
    known = {'repeats': 'from repeats', 'stated': 'as stated', 'neighbours': 'from neighbours'}
    rows = (
        ('noise of the gauge, one reading', words.micrometres(noise.typical_um), noise.source),
        ('texture of the film', f'{100 * texture.share:.2g} % of it', texture.source),
    )
    return [(what, amount, known.get(source, source)) for what, amount, source in rows]


def effect_rows(data: ReportData) -> list[dict[str, Any]]:
    """Effects in the best model, what each does to the film, and its parameters."""
    known = {c.best: c.parameters for c in data.diagnosis.classes} if data.diagnosis else {}
    rows = []
    for effect in data.model.effects:
        found = known.get(effect.id, {})
        parameters = _learned(effect)
        for name in effect.parameters():
            values = astuple(found[name]) if name in found else [getattr(effect, name)]
            parameters.append(_parameter(type(effect), name, *values))
        change = data.changes.get(effect.id)
        rows.append({'id': effect.id, 'change': change, 'parameters': parameters})
    return rows


def blind_rows(data: ReportData) -> list[dict[str, Any]]:
    """Effects that these readings could not show, and what would have been seen of others."""
    diagnosis, rows = data.diagnosis, []
    if diagnosis is None:
        return []
    ids = dict.fromkeys((*diagnosis.not_testable, *diagnosis.detectable))
    for effect_id in ids:
        if effect_id in diagnosis.accepted:
            continue
        effect, seen = data.effect_class(effect_id), diagnosis.detectable.get(effect_id, {})
        parameters = effect.parameters() if effect else {}
        amplitudes = [
            {
                'words': words.parameter_words(name, info['unit']),
                'least': _size(seen.get(name), info['unit']),
                'usual': _size(info['typical'], info['unit']),
            }
            for name, info in parameters.items()
            if info['role'] == 'amplitude'
        ]
        testable = effect_id not in diagnosis.not_testable
        rows.append({
            'id': effect_id, 'testable': testable, 'amplitudes': amplitudes,
            'meaning': words.effect_meaning(effect),
        })  # fmt: skip
    return rows


def _size(value: float | None, unit: str) -> str:
    if value is None or not np.isfinite(value):
        return ''
    shown_unit, size = words.in_unit(unit, abs(value))
    return f'{size} {shown_unit}'.strip()


def misfit_rows(data: ReportData) -> list[dict[str, Any]]:
    """Experiments, their groups and passes: bias and RMSE before and after."""
    later = {(m.experiment, m.kind, m.label): m for m in data.comparisons[-1].misfits}
    return [
        {'before': m, 'after': later.get((m.experiment, m.kind, m.label), m)}
        for m in data.comparisons[0].misfits
    ]


def film_rows(data: ReportData) -> list[dict[str, Any]]:
    """For each part its readings, and its film as the best model predicts it."""
    rows = []
    for k, experiment in enumerate(data.experiments):
        measured, painted = data.study.measured_um[data.rows_of(k)], data.painted[k][-1]
        of_points = range(*data.rows_of(k).indices(len(data.study)))
        bands = [band for row in of_points if (band := band_of(data, row))]
        target_um, tolerance_um = data.study.campaign.target_of(experiment)
        film = film_statistics(
            painted.film_um, experiment.surface.vertex_areas_m2, painted.emitted_cm3,
            target_um=target_um, target_tolerance_um=tolerance_um, zones=experiment.zones,
        )  # fmt: skip
        areas = {LOW: film.below_target, IN: film.within_target, HIGH: film.above_target}
        rows.append({
            'name': experiment.name, 'measured': measured, 'areas': areas, 'film': film,
            # Shares of the points that are low, in and high; empty without a target.
            'bands': {b: bands.count(b) / len(bands) for b in (LOW, IN, HIGH) if bands},
        })  # fmt: skip
    return rows


def band_of(data: ReportData, row: int) -> str:
    """Where the film measured at a point is beside its target band; '' without a target."""
    target, tolerance = (wanted[row] for wanted in data.wanted_um)
    off = data.study.measured_um[row] - target
    return '' if np.isnan(off) else IN if abs(off) <= tolerance else LOW if off < 0.0 else HIGH


def point_rows(data: ReportData) -> list[dict[str, Any]]:
    """Each measured point: where, measured, predicted, deviation, and whether that is right.

    The model is right where the deviation is within what gauge and texture scatter by in 95 % of
    readings; the film is right in the target band.
    """
    found = data.comparisons[-1].points
    rows: list[dict[str, Any]] = []
    for k, experiment in enumerate(data.experiments):
        first = data.rows_of(k).start
        labels, groups = experiment.readings.point[experiment.means.first], experiment.groups
        for p, position in enumerate(experiment.measured_points.positions_m):
            row = first + p
            residual, scatter = found.residual_um[row], TWO_SIDED_95 * found.sigma_um[row]
            rows.append({
                'part': experiment.name, 'point': str(labels[p]), 'group': str(groups[p]),
                **dict(zip(('x_mm', 'y_mm', 'z_mm'), 1e3 * position, strict=True)),
                'measured_um': found.measured_um[row], 'predicted_um': found.predicted_um[row],
                'deviation_um': residual, 'scatter_um': scatter,
                'model': 'OK' if abs(residual) <= scatter else 'off',
                'film': band_of(data, row),
            })  # fmt: skip
    return rows
