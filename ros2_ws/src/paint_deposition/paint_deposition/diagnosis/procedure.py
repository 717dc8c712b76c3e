"""Which physical effect is missing from the model, if any: the procedure.

1. Fit the pattern; refuse to go on if it cannot be right.
2. Weigh every effect, pair of effects, shapeless cause and footprint deviation against each
   other, and test whether anything at all is missing.
3. If so, and one class of effects that the readings cannot tell apart is probable enough and
   helps to predict readings left out: add its best member, and start again from there.
4. Say what was found, or between what it is undecided, or where the unexplained shows.
"""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.stats import f as f_ratio

from paint_deposition.diagnosis.classes import Candidate, Ranking, rank
from paint_deposition.diagnosis.cross_validation import hold_out
from paint_deposition.diagnosis.judgement import Judgement, judge
from paint_deposition.diagnosis.sensitivities import Signature, neutral_shapes
from paint_deposition.diagnosis.unexplained import locate_unexplained
from paint_deposition.diagnosis.verdict import (
    Diagnosis,
    EffectClass,
    Interval,
    Step,
    Verdict,
)
from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.fitting.estimates import estimates
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.fitting.parameters import Unknowns
from paint_deposition.fitting.study import Study
from paint_deposition.readings.campaign import Campaign

ALPHA = 0.05
SURE = 0.8
STARTS = 10
MOST_EFFECTS = 3
# A point that gets less than this share of the mean film was hardly reached by the path.
REACHED = 0.02
MOST_UNREACHED = 0.1
# Standard deviations above the prediction from which the gauge found paint.
PAINTED = 3.0
# Chance of scattering so little: below it the noise is overstated, or the readings were made up.
TOO_GOOD = 1e-4
# What was found stands beside a rest whose evidence is below this share of its own: laws of
# effects are approximations, and with many readings even a good one leaves something.
LEFT_OVER = 0.5


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
    neutral = {key: neutral_shapes(effect) for key, effect in library.items()}
    study = Study.of(campaign, tuple(shapes[0] for shapes in neutral.values()))
    progress('fitting the pattern')
    fit = study.fit(Unknowns.of(start, *start.effects), STARTS, seed, study.levels)
    history = [Step.of(study, '', study.plain(fit))]
    trouble = trouble_with(study, history[0].fit)
    if trouble:
        return Diagnosis(study, 'fit_broken', trouble, np.nan, (), (), tuple(history))

    for effect in start.effects:
        neutral.pop(effect.id, None)
    accepted: list[EffectClass] = []
    nuisance: list[Signature] = []
    progress('weighing what may be missing')
    judged = first = judge(study, fit, neutral, nuisance, seed)
    while True:
        ranking = None
        if judged.weighing.p_value < ALPHA:
            progress('refitting with the most probable effects')
            ranking = rank(study, judged)
        best = _to_add(study, history[-1].fit, ranking) if len(accepted) < MOST_EFFECTS else None
        if best is None:
            break
        history.append(Step.of(study, best.best, study.plain(best.fit)))
        accepted.append(_told(study, best, history))
        nuisance += [s for s in judged.signatures if s.id in best.members[1:]]
        for member in best.members:
            neutral.pop(member)
        fit = best.fit
        progress(f'added {best.best}; weighing what is left')
        judged = judge(study, fit, neutral, nuisance, seed)
    return _conclude(study, first, judged, ranking, accepted, history, seed)


def trouble_with(study: Study, fit: Fit) -> str:
    """Why the fit cannot be right, or nothing."""
    mean = float(np.mean(study.measured_um))
    painted = fit.residual > PAINTED
    bare = float(np.mean(painted & (fit.predicted_um < REACHED * mean)))
    freedom = len(study) - len(fit.vector)
    if freedom < 5:
        return (
            f'{len(study)} points cannot determine {len(fit.vector)} parameters; '
            'measure at 30 points or more'
        )
    if bare > MOST_UNREACHED:
        return (
            f'the recorded path leaves {100 * bare:.0f} % of the points bare, where '
            'the gauge found paint; check the trajectory, its trigger and the mesh frame'
        )
    if not fit.converged:
        return 'the fit did not converge; give a start model nearer to the bell in use'
    if study.noise.source != 'assumed':
        reduced = fit.chi_square / freedom
        chance = f_ratio.cdf(reduced, freedom, min(study.noise.degrees_of_freedom, 1e6))
        if chance < TOO_GOOD:
            return (
                f'the readings scatter about the model {np.sqrt(reduced):.2f} times as much as '
                f'their noise says ({study.noise.source}); give their true sigma_um or repeats'
            )
    return ''


def _to_add(study: Study, before: Fit, ranking: Ranking | None) -> Candidate | None:
    """The best class if it is probable enough and helps to predict, else None."""
    if ranking is None or not ranking.classes:
        return None
    best = ranking.classes[0]
    sure = best.probability > SURE and _predicts_better(study, before, study.plain(best.fit))
    return best if sure else None


def _predicts_better(study: Study, before: Fit, after: Fit) -> bool:
    """Whether readings left out in patches and in passes are predicted better on average."""
    blockings = [study.patches(), study.bands(before.model)]
    gains = [
        hold_out(after, blocks).log_score - hold_out(before, blocks).log_score
        for blocks in blockings
        if len(np.unique(blocks)) > 2
    ]
    return not gains or float(np.mean(gains)) > 0.0


def _told(study: Study, candidate: Candidate, history: list[Step]) -> EffectClass:
    return EffectClass(
        candidate.members,
        candidate.probability,
        candidate.best,
        intervals(candidate.fit, candidate.best),
        {'before': history[-2].holdout_rmse_um, 'after': history[-1].holdout_rmse_um},
    )


def intervals(fit: Fit, effect_id: str) -> dict[str, Interval]:
    """95 % intervals of an effect's amplitudes, within what is physical."""
    found = {}
    for estimate in estimates(fit):
        owner, _, parameter = estimate.name.partition('.')
        if owner == effect_id:
            found[parameter] = Interval(estimate.value, estimate.low, estimate.high)
    return found


def _conclude(
    study: Study,
    first: Judgement,
    judged: Judgement,
    ranking: Ranking | None,
    accepted: list[EffectClass],
    history: list[Step],
    seed: int,
) -> Diagnosis:
    others = tuple(
        EffectClass(
            c.members, c.probability, c.best, intervals(c.fit, c.best),
            {
                'before': history[-1].holdout_rmse_um,
                'after': Step.of(study, c.best, study.plain(c.fit)).holdout_rmse_um,
            },
        )
        for c in (ranking.classes if ranking else ())
    )  # fmt: skip
    verdict: Verdict
    unknown = None
    if ranking is None and not accepted:
        verdict, reason = 'none_missing', (
            'The readings agree with the model to within the noise of the gauge.'
        )  # fmt: skip
    elif ranking is None or (accepted and _explains_most(history, judged)):
        names = ', and '.join(_in_words(c) for c in accepted)
        verdict, reason = 'effect_missing', f'The readings show {names}.'
    elif ranking.unknown + ranking.footprint > ranking.named or not others:
        footprint = ranking.footprint > ranking.unknown
        unknown = locate_unexplained(study, history[-1].fit, footprint, seed)
        verdict, reason = (
            'unknown_effect',
            (
                'The pattern itself differs from the two Gaussians of eq. (1).'
                if footprint
                else f'Something outside the library shows against {unknown.covariate}.'
            ),
        )
    else:
        verdict = 'undecided'
        reason = 'These may be missing: ' + ', or '.join(
            f'{c.best} ({100 * c.probability:.0f} %)' for c in others[:3]
        )
    return Diagnosis(
        study,
        verdict,
        reason,
        first.weighing.p_value,
        tuple(c.best for c in accepted),
        (*accepted, *others),
        tuple(history),
        unknown,
        first.not_testable,
        first.detectable,
    )


def _in_words(found: EffectClass) -> str:
    if len(found.members) == 1:
        return found.best
    return f'{found.best} (or what they cannot tell from it: {", ".join(found.members[1:])})'


def _explains_most(history: list[Step], judged: Judgement) -> bool:
    """Whether what was added explains far more than is left to explain."""
    left = float(np.max(judged.weighing.log_factors))
    count = len(history[0].fit.predicted_um)
    gained = count * np.log(history[0].rmse_um / history[-1].rmse_um)
    return left < LEFT_OVER * gained
