"""Rows of the report's tables: figures and names; the sentences around them are the template's."""

from dataclasses import astuple
from itertools import product
from typing import Any

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.learned.curves import LearnedCurve
from paint_deposition.effects.learned.law import LearnedFootprint, LearnedLaw, LearnedMap
from paint_deposition.film.statistics import film_statistics
from paint_deposition.inference.fitting.estimates import estimates
from paint_deposition.inference.fitting.pattern_vector import PATTERN_NAMES
from paint_deposition.report import words
from paint_deposition.report.data import ReportData
from paint_deposition.report.style import TWO_SIDED_95

# What a parameter of the pattern is called: symbol, meaning, unit.
SYMBOLS = {
    'K1_cm3_per_s': ('K1', 'deposited solids rate', 'cm³/s'),
    'K2': ('K2', 'weight of the centred Gaussian', ''),
    'K3': ('K3', 'asymmetry of the ring', ''),
    'phi_rad': ('φ', 'phase of the asymmetry', 'rad'),
    'r_m': ('r', 'radius of the ring', 'mm'),
    'sigma1_m': ('σ1', 'width of the ring', 'mm'),
    'sigma2_m': ('σ2', 'width of the centred Gaussian', 'mm'),
}
LOW, IN, HIGH = 'low', 'in', 'high'


def class_rows(data: ReportData) -> list[dict[str, Any]]:
    """Candidate causes with the effects they are confounded with, and parameters."""
    rows = []
    for found in data.diagnosis.classes if data.diagnosis else ():
        effect = data.effect_class(found.best)
        like = [member for member in found.members if member != found.best]
        parameters = [
            _parameter(effect, name, *astuple(value)) for name, value in found.parameters.items()
        ]
        rows.append({
            'id': found.best, 'found': found, 'name': words.effect_name(found.best),
            'learned': words.is_learned(found.best),
            'like': like, 'others': [words.effect_name(member) for member in like],
            'accepted': data.diagnosis is not None and found.best in data.diagnosis.accepted,
            'meaning': words.effect_meaning(effect),
            'signature': effect.signature if effect else '',
            'parameters': parameters + _learned(data.model.effect(found.best)),
        })  # fmt: skip
    return rows


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


def law_rows(data: ReportData) -> list[dict[str, str]]:
    """Learned laws of the best model: where each holds, and how well a curve is known."""
    rows = []
    for law in data.model.effects:
        row = {'name': words.effect_name(law.id), 'best': ''}
        if isinstance(law, LearnedMap):
            rows.append(row | {'kind': 'map'})
        elif isinstance(law, LearnedFootprint):
            rows.append(row | {'kind': 'footprint', 'ends': words.number(1e3 * law.reach_m)})
        elif isinstance(law, LearnedCurve):
            _, ends, unit = words.learned_words(law)[1]
            row |= {'kind': 'curve', 'ends': ends, 'unit': unit}
            rows.append(row | (_band(law) if law.sd else {}))
    return rows


def _band(law: LearnedCurve) -> dict[str, str]:
    """Where the band of a curve is narrow, and where wide."""
    values = np.linspace(law.low, law.high, 101)
    half, shown = TWO_SIDED_95 * law.deviation(values), words.counted_from_1(law, values)
    unit, along = ' µm' if law.kind == 'addition' else '', words.unit_words(law.unit)
    ends = [
        f'± {words.number(half[at], 2)}{unit} at {words.number(shown[at])} {along}'.rstrip()
        for at in (half.argmin(), half.argmax())
    ]
    return {'best': ends[0], 'least': ends[1], 'forms': words.form_words(law)}


def pattern_rows(data: ReportData) -> list[dict[str, str]]:
    """The pattern's parameters; with 95 % intervals where the model was fitted."""
    fitted = estimates(data.diagnosis.history[-1].fit) if data.diagnosis else ()
    found = {estimate.name: estimate for estimate in fitted}
    brushes, rows = data.model.brushes, []
    of = [f'brush {brush.number}: ' if len(brushes) > 1 else '' for brush in brushes] or ['']
    for (whose, planar), name in product(zip(of, data.model.patterns, strict=True), PATTERN_NAMES):
        symbol, meaning, unit = SYMBOLS[name]
        factor = 1e3 if unit == 'mm' else 1.0
        value = words.number(factor * getattr(planar, name), 4)
        row = {'symbol': symbol, 'words': whose + meaning, 'unit': unit, 'value': value}
        if name in found:
            ends = (words.number(factor * end) for end in (found[name].low, found[name].high))
            row['interval'] = ' to '.join(ends)
        rows.append(row)
    return rows


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
    for effect_id in dict.fromkeys((*diagnosis.not_testable, *diagnosis.detectable)):
        if effect_id in diagnosis.accepted:
            continue
        effect, seen = data.effect_class(effect_id), diagnosis.detectable.get(effect_id, {})
        amplitudes = [
            {
                'words': words.parameter_words(name, info['unit']),
                'least': _size(seen.get(name), info['unit']),
                'usual': _size(info['typical'], info['unit']),
            }
            for name, info in (effect.parameters() if effect else {}).items()
            if info['role'] == 'amplitude'
        ]
        rows.append({
            'id': effect_id, 'testable': effect_id not in diagnosis.not_testable,
            'amplitudes': amplitudes, 'meaning': words.effect_meaning(effect),
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
        of_part, painted = data.rows_of(k), data.painted[k][-1]
        bands = [band for band in data.bands[of_part] if band]
        target_um, tolerance_um = data.study.campaign.target_of(experiment)
        film = film_statistics(
            painted.film_um, experiment.surface.vertex_areas_m2, painted.emitted_cm3,
            target_um=target_um, target_tolerance_um=tolerance_um, zones=experiment.zones,
        )  # fmt: skip
        rows.append({
            'name': experiment.name, 'measured': data.study.measured_um[of_part], 'film': film,
            'areas': {LOW: film.below_target, IN: film.within_target, HIGH: film.above_target},
            # Shares of the points that are low, in and high; empty without a target.
            'bands': {b: bands.count(b) / len(bands) for b in (LOW, IN, HIGH) if bands},
        })  # fmt: skip
    return rows


def point_rows(data: ReportData) -> list[dict[str, Any]]:
    """Each measured point: where, measured, predicted, deviation, and whether that is right.

    The model is right where the deviation is within what gauge and texture scatter by in 95 % of
    readings; the film is right in the target band.
    """
    found = data.comparisons[-1].points
    scatter_um = TWO_SIDED_95 * found.sigma_um
    rows: list[dict[str, Any]] = []
    for k, experiment in enumerate(data.experiments):
        labels, groups = experiment.readings.point[experiment.means.first], experiment.groups
        places = 1e3 * experiment.measured_points.positions_m
        for row, point, group, place in zip(
            range(*data.rows_of(k).indices(len(data.study))), labels, groups, places, strict=True
        ):
            residual = found.residual_um[row]
            rows.append({
                'part': experiment.name, 'point': str(point), 'group': str(group),
                **dict(zip(('x_mm', 'y_mm', 'z_mm'), place, strict=True)),
                'measured_um': found.measured_um[row], 'predicted_um': found.predicted_um[row],
                'deviation_um': residual, 'scatter_um': scatter_um[row],
                'model': 'OK' if abs(residual) <= scatter_um[row] else 'off',
                'film': data.bands[row],
            })  # fmt: skip
    return rows
