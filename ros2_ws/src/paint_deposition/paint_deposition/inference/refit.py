"""Add an effect that the user chose and fit the model with it."""

from collections.abc import Callable

from paint_deposition.effects.base import Effect
from paint_deposition.errors import ModelError
from paint_deposition.inference.campaign import Campaign
from paint_deposition.inference.diagnosis import ALPHA, SURE, intervals, trouble_with
from paint_deposition.inference.judgement import judge
from paint_deposition.inference.signatures import neutral_shapes
from paint_deposition.inference.study import Study
from paint_deposition.inference.unknowns import Unknowns
from paint_deposition.inference.verdict import Diagnosis, EffectClass, Step, Verdict
from paint_deposition.model.deposition_model import DepositionModel

STARTS = 10


def refit(
    campaign: Campaign,
    start: DepositionModel,
    added: type[Effect] | None,
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
) -> Diagnosis:
    """Fit the model without and with an effect, and weigh the two.

    Args:
        campaign: the readings.
        start: the model so far; its effects are refitted too.
        added: the effect, or None to fit what is there.
        seed: of starts and simulated deviations.
        progress: called with a line for each step of the work.

    Raises:
        ModelError: the model has the effect already.
    """
    if added and start.effect(added.id):
        raise ModelError(
            f'{added.id} is in the model already; to fit it anew, add none, or take it out'
        )
    shapes = neutral_shapes(added) if added else []
    study = Study.of(campaign, (*start.effects, *shapes[:1]))
    progress('fitting the model as it is')
    fit = study.fit(Unknowns.of(start, *start.effects), STARTS, seed)
    history = [Step.of(study, '', fit)]
    trouble = trouble_with(study, fit)
    if trouble:
        return Diagnosis(study, 'fit_broken', trouble, 1.0, (), (), tuple(history))
    if added is None:
        judged = judge(study, fit, {}, [], seed)
        rest = judged.weighing.p_value
        return Diagnosis(
            study,
            'none_missing' if rest >= ALPHA else 'unknown_effect',
            'The model was fitted as it is.',
            rest,
            (),
            (),
            tuple(history),
        )
    judged = judge(study, fit, {added.id: shapes}, [], seed)
    progress(f'fitting with {added.id}')
    fits = [
        study.fit(Unknowns.of(fit.model.with_effect(shape), *start.effects, shape))
        for shape in shapes
    ]
    best = min(fits, key=lambda f: f.chi_square + f.penalty)
    history.append(Step.of(study, added.id, best))
    hypotheses, weights = judged.weighing.hypotheses, judged.weighing.posterior
    probability = sum(
        float(w) for h, w in zip(hypotheses, weights, strict=True) if added.id in h.effects
    )
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
