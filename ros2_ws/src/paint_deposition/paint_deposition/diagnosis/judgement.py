"""One round of weighing: signatures at the fitted model, evidence, and the test."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paint_deposition.diagnosis.discrepancy import pattern_deviations_um, random_fields
from paint_deposition.diagnosis.evidence import BaseSpace
from paint_deposition.diagnosis.hypotheses import Weighing, weigh
from paint_deposition.diagnosis.sensitivities import TESTABLE, Signature, signature, visibility
from paint_deposition.effects.base import Effect
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.fitting.study import Study

# An amplitude is seen from this signal to noise on.
SEEN = 3.0


@dataclass(frozen=True)
class Judgement:
    """What the readings say beside a fitted model.

    Attributes:
        fit: of the model with each part at a level of its own; all is linear around it.
        base: deviations with the model's own freedom taken out.
        weighing: all hypotheses with their evidence, and the test.
        signatures: of all effects, by shape.
        not_testable: ids that do not show at typical amplitude; larger they may be there.
        detectable: smallest visible amplitude of each testable effect, by parameter.
    """

    fit: Fit
    base: BaseSpace
    weighing: Weighing
    signatures: list[Signature]
    not_testable: tuple[str, ...]
    detectable: dict[str, dict[str, float]]


def judge(
    study: Study,
    fit: Fit,
    neutral: Mapping[str, list[Effect]],
    nuisance: list[Signature],
    seed: int,
) -> Judgement:
    """Weigh what may be missing from a fitted model.

    Args:
        study: the readings.
        fit: of the model so far, with each part at a level of its own.
        neutral: the candidate effects, each in a few shapes.
        nuisance: signatures that the test must not see: rivals of what was accepted.
        seed: of the simulated deviations.
    """
    levelled, fit = fit, study.plain(fit)
    columns = [s.columns for s in nuisance]
    if study.levels is not None:
        columns.append(study.levels)
    base = BaseSpace.of(fit, np.hstack(columns) if columns else None)
    signatures: list[Signature] = []
    not_testable, detectable = [], {}
    for effect_id, shapes in neutral.items():
        marks = [signature(study.forward, fit, shape, study.sigma_um) for shape in shapes]
        signatures += marks
        if max(visibility(base.project(m.columns)) for m in marks) >= TESTABLE:
            detectable[effect_id] = _detectable(base, marks)
        else:
            not_testable.append(effect_id)
    by_part = [pattern_deviations_um(fit.model, rays) for rays in study.rays(fit.model)]
    deviations = [
        np.vstack(kinds) / study.sigma_um[:, np.newaxis] for kinds in zip(*by_part, strict=True)
    ]
    weighing = weigh(
        base,
        signatures,
        _fields(study, fit),
        deviations,
        study.noise.degrees_of_freedom,
        seed,
    )
    return Judgement(levelled, base, weighing, signatures, tuple(not_testable), detectable)


def _fields(study: Study, fit: Fit) -> list[np.ndarray]:
    """Random fields whitened by the typical noise, as additions and as factors on the film."""
    roots = random_fields(study.positions_m, study.experiment_of, study.covariates(fit.model))
    relative = fit.predicted_um / np.mean(fit.predicted_um)
    whiten = study.noise_floor_um / study.sigma_um
    return [root * (relative * whiten)[:, np.newaxis] for root in roots]


def _detectable(base: BaseSpace, marks: list[Signature]) -> dict[str, float]:
    """Smallest amplitudes that stand out, for the shape that shows best, where physical."""
    info = type(marks[0].effect).parameters()
    found = {}
    for k, name in enumerate(marks[0].names):
        strength = max(float(np.linalg.norm(base.project(m.columns[:, [k]]))) for m in marks)
        amount = SEEN * info[name]['typical'] / max(strength, 1e-9)
        room = max(abs(info[name][end] - info[name]['neutral']) for end in ('low', 'high'))
        if amount <= room:
            found[name] = amount
    return found
