"""Inference linearised at a fitted model: sensitivities, evidence of hypotheses, the test."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paint_deposition.diagnosis.discrepancy import pattern_deviations_um, random_fields
from paint_deposition.diagnosis.evidence import NullModel
from paint_deposition.diagnosis.model_space import ModelSpace
from paint_deposition.diagnosis.sensitivities import (
    TESTABLE,
    Sensitivity,
    sensitivity,
    signal_to_noise,
)
from paint_deposition.effects.base import Effect
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.fitting.study import Study

# Signal-to-noise ratio of the smallest amplitude that is called detectable.
DETECTED = 3.0


@dataclass(frozen=True)
class Linearisation:
    """What may be missing from a fitted model, in the linear approximation around the fit.

    Attributes:
        fit: of the model, around which everything is linear.
        null: the hypothesis that nothing is missing.
        space: all hypotheses with their evidence, and the test of the null hypothesis.
        sensitivities: to all candidate effects, one for each shape.
        not_testable: ids of effects that do not show at their typical amplitude.
        detectable: smallest amplitude of each testable effect that would be seen, by parameter.
    """

    fit: Fit
    null: NullModel
    space: ModelSpace
    sensitivities: list[Sensitivity]
    not_testable: tuple[str, ...]
    detectable: dict[str, dict[str, float]]


def linearise(
    study: Study,
    fit: Fit,
    neutral: Mapping[str, list[Effect]],
    excluded: list[Sensitivity],
    seed: int,
) -> Linearisation:
    """Compute the evidence of everything that may be missing from a fitted model.

    Args:
        study: the readings.
        fit: of the model so far.
        neutral: the candidate effects at neutral amplitude, each in a few shapes.
        excluded: sensitivities to effects that are confounded with an accepted one; they are
            nuisance directions, along which no deviation counts as evidence.
        seed: of the simulated deviations.
    """
    null = NullModel.of(fit, np.hstack([*(s.columns for s in excluded), study.nuisance]))
    sensitivities: list[Sensitivity] = []
    not_testable, detectable = [], {}
    for effect_id, shapes in neutral.items():
        found = [sensitivity(study.forward, fit, shape, study.sigma_um) for shape in shapes]
        sensitivities += found
        if max(signal_to_noise(null.whiten(s.columns)) for s in found) >= TESTABLE:
            detectable[effect_id] = _detectable(null, found)
        else:
            not_testable.append(effect_id)
    by_part = [pattern_deviations_um(fit.model, rays) for rays in study.rays(fit.model)]
    deviations = [
        np.vstack(kinds) / study.sigma_um[:, np.newaxis] for kinds in zip(*by_part, strict=True)
    ]
    space = ModelSpace.of(
        null,
        sensitivities,
        _fields(study, fit),
        deviations,
        study.noise.degrees_of_freedom,
        seed,
    )
    return Linearisation(fit, null, space, sensitivities, tuple(not_testable), detectable)


def _fields(study: Study, fit: Fit) -> list[np.ndarray]:
    """Random fields in units of the noise, in proportion to the film that they change."""
    campaign = study.campaign
    covariates = study.covariates(fit.model)
    roots = random_fields(campaign.positions_m, campaign.experiment_of, covariates)
    relative = fit.predicted_um / np.mean(fit.predicted_um)
    whiten = study.noise_floor_um / study.sigma_um
    return [root * (relative * whiten)[:, np.newaxis] for root in roots]


def _detectable(null: NullModel, shapes: list[Sensitivity]) -> dict[str, float]:
    """Smallest detectable amplitudes, for the shape that shows best, where physically possible."""
    info = type(shapes[0].effect).parameters()
    found = {}
    for k, name in enumerate(shapes[0].names):
        strength = max(float(np.linalg.norm(null.whiten(s.columns[:, [k]]))) for s in shapes)
        amount = DETECTED * info[name]['typical'] / max(strength, 1e-9)
        room = max(abs(info[name][end] - info[name]['neutral']) for end in ('low', 'high'))
        if amount <= room:
            found[name] = amount
    return found
