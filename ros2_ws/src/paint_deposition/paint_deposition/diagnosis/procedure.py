"""Which physical effect is missing from the model, if any: the procedure.

1. Fit the pattern; stop if the fit cannot be right.
2. Compute the evidence of every effect, pair of effects, shapeless cause and deviation of the
   footprint, and test whether anything at all is missing.
3. If so, and one class of effects that the readings cannot tell apart is probable enough and
   improves the prediction of points left out: add its best member, and repeat from 2.
4. Conclude what is missing, or between what it is undecided, or where the unexplained shows.
"""

from collections.abc import Callable, Mapping

import numpy as np

from paint_deposition.diagnosis.classes import ConfoundedClass, Posterior, class_posterior
from paint_deposition.diagnosis.cross_validation import hold_out
from paint_deposition.diagnosis.linearisation import Linearisation
from paint_deposition.diagnosis.run import ALPHA, SURE, Run
from paint_deposition.diagnosis.unexplained import locate_unexplained
from paint_deposition.diagnosis.verdict import Diagnosis, EffectClass, Step, percent
from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.readings.campaign import Campaign

MOST_EFFECTS = 3
# What was added is the verdict if the evidence that remains is below this share of its own: laws
# of effects are approximations, and with many readings even a good one leaves something.
LEFT_OVER = 0.5
# Candidates that are named where none is sure.
NAMED = 3


def diagnose(
    campaign: Campaign,
    start: DepositionModel,
    library: Mapping[str, type[Effect]],
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
) -> Diagnosis:
    """Find what is missing from a model.

    Args:
        campaign: the readings and how the parts were painted.
        start: first guess of the pattern; its effects are kept and refitted.
        library: effects to consider, by id.
        seed: of starts and simulated deviations.
        progress: called with a line for each step of the work.
    """
    run = Run(campaign, start, library, seed, progress)
    if run.trouble:
        return run.diagnosis(None, 'fit_broken', run.trouble)
    progress('computing the evidence of what may be missing')
    first = linear = run.linearise()
    while True:
        posterior = None
        if linear.space.p_value < ALPHA:
            progress('refitting with the most probable effects')
            posterior = class_posterior(run.study, linear)
        best = _to_add(run, posterior)
        if best is None:
            return _conclude(run, first, linear, posterior)
        run.add(best, linear)
        progress(f'added {best.best}; computing the evidence of what is left')
        linear = run.linearise()


def _to_add(run: Run, posterior: Posterior | None) -> ConfoundedClass | None:
    """The best class if it is probable enough and improves the prediction, else None."""
    if posterior is None or not posterior.classes or len(run.accepted) == MOST_EFFECTS:
        return None
    best = posterior.classes[0]
    return best if best.probability > SURE and _predicts_better(run, best) else None


def _predicts_better(run: Run, candidate: ConfoundedClass) -> bool:
    """Whether points left out in patches and in passes are predicted better on average."""
    blockings = [run.study.patches(), run.study.pass_blocks(run.fit.model)]
    gains = [
        hold_out(candidate.fit, blocks).log_score - hold_out(run.fit, blocks).log_score
        for blocks in blockings
        if len(np.unique(blocks)) > 1
    ]
    return bool(np.mean(gains) > 0.0)


def _conclude(
    run: Run, first: Linearisation, last: Linearisation, posterior: Posterior | None
) -> Diagnosis:
    others = tuple(
        run.described(c, Step.of(run.study, c.best, c.fit))
        for c in (posterior.classes if posterior else ())
    )
    if posterior is None and not run.accepted:
        reason = 'The readings agree with the model to within the noise of the gauge.'
        return run.diagnosis(first, 'none_missing', reason)
    if posterior is None or (run.accepted and _explains_most(run, last)):
        names = ', and '.join(_in_words(c) for c in run.accepted)
        return run.diagnosis(first, 'effect_missing', f'The readings show {names}.', others)
    if posterior.unknown + posterior.footprint > posterior.named or not others:
        footprint = posterior.footprint > posterior.unknown
        unknown = locate_unexplained(run.study, run.fit, footprint, run.seed)
        reason = (
            'The pattern itself differs from the two Gaussians of eq. (1).'
            if footprint
            else f'Something outside the library shows against {unknown.covariate}.'
        )
        return run.diagnosis(first, 'unknown_effect', reason, others, unknown)
    reason = 'These may be missing: ' + ', or '.join(
        f'{c.best} ({percent(c.probability)})' for c in others[:NAMED]
    )
    return run.diagnosis(first, 'undecided', reason, others)


def _in_words(found: EffectClass) -> str:
    if len(found.members) == 1:
        return found.best
    return f'{found.best} (or what they cannot tell from it: {", ".join(found.members[1:])})'


def _explains_most(run: Run, last: Linearisation) -> bool:
    """Whether the effects that were added explain far more than is left to explain."""
    left = float(np.max(last.space.log_bayes_factors))
    gained = len(run.study) * np.log(run.history[0].rmse_um / run.history[-1].rmse_um)
    return left < LEFT_OVER * gained
