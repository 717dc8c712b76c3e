"""Add an effect that the user chose and fit the model with it."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from scipy.special import expit, logsumexp

from paint_deposition.diagnosis.judgement import Judgement, judge
from paint_deposition.diagnosis.procedure import ALPHA, SURE, intervals, trouble_with
from paint_deposition.diagnosis.sensitivities import neutral_shapes
from paint_deposition.diagnosis.unexplained import locate_unexplained
from paint_deposition.diagnosis.verdict import Diagnosis, EffectClass, Step, Verdict
from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError
from paint_deposition.fitting.parameters import Unknowns
from paint_deposition.fitting.study import Study
from paint_deposition.readings.campaign import Campaign

STARTS = 10


def refit(
    campaign: Campaign,
    start: DepositionModel,
    added: type[Effect] | None,
    library: Mapping[str, type[Effect]] = MappingProxyType({}),
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
) -> Diagnosis:
    """Fit the model without and with an effect, and weigh the two.

    Args:
        campaign: the readings.
        start: the model so far; its effects are refitted too.
        added: the effect, or None to fit what is there.
        library: effects to test for beside it, by id.
        seed: of starts and simulated deviations.
        progress: called with a line for each step of the work.

    Raises:
        ModelError: the model has the effect already.
    """
    if added and start.effect(added.id):
        raise ModelError(
            f'{added.id} is in the model already; to fit it anew, add none, or take it out'
        )
    neutral = {
        key: neutral_shapes(effect) for key, effect in library.items() if not start.effect(key)
    }
    if added:
        neutral[added.id] = neutral_shapes(added)
    study = Study.of(campaign, (*start.effects, *(shapes[0] for shapes in neutral.values())))
    progress('fitting the model as it is')
    fit = study.fit(Unknowns.of(start, *start.effects), STARTS, seed, study.levels)
    history = [Step.of(study, '', study.plain(fit))]
    trouble = trouble_with(study, history[0].fit)
    if trouble:
        return Diagnosis(study, 'fit_broken', trouble, np.nan, (), (), tuple(history))
    judged = judge(study, fit, neutral, [], seed)
    if added is None:
        return _as_it_is(study, history[0], judged, seed)
    progress(f'fitting with {added.id}')
    fits = [
        study.fit(
            Unknowns.of(fit.model.with_effect(shape), *start.effects, shape), extra=study.levels
        )
        for shape in neutral[added.id]
    ]
    best = min(fits, key=lambda f: f.chi_square + f.penalty)
    history.append(Step.of(study, added.id, study.plain(best)))
    probability = _probability(judged, added.id)
    effect = EffectClass(
        (added.id,),
        probability,
        added.id,
        intervals(best, added.id),
        {'before': history[0].holdout_rmse_um, 'after': history[1].holdout_rmse_um},
    )
    verdict: Verdict = 'none_missing' if judged.weighing.p_value >= ALPHA else 'undecided'
    return Diagnosis(
        study,
        'effect_missing' if probability > SURE else verdict,
        f'{added.id} was added as asked; it is missing with a probability of '
        f'{100 * probability:.0f} % against the model as it was.',
        judged.weighing.p_value,
        (added.id,),
        (effect,),
        tuple(history),
        not_testable=judged.not_testable,
        detectable=judged.detectable,
    )


def _probability(judged: Judgement, effect_id: str) -> float:
    """That the effect is missing and not nothing, which had the same chance before."""
    hypotheses = judged.weighing.hypotheses
    shapes = [k for k, h in enumerate(hypotheses) if h.effects == (effect_id,) and not h.other]
    factors = judged.weighing.log_factors[shapes]
    return float(expit(logsumexp(factors, b=1.0 / len(shapes))))


def _as_it_is(study: Study, step: Step, judged: Judgement, seed: int) -> Diagnosis:
    """The verdict on a model to which nothing was added."""
    missing = judged.weighing.p_value < ALPHA
    reason = 'The model was fitted as it is'
    return Diagnosis(
        study,
        'unknown_effect' if missing else 'none_missing',
        reason + ('; something is missing, which diagnose can tell.' if missing else '.'),
        judged.weighing.p_value,
        (),
        (),
        (step,),
        locate_unexplained(study, step.fit, False, seed) if missing else None,
        judged.not_testable,
        judged.detectable,
    )
