"""Which physical effects are missing from the model, if any: the procedure.

1. Fit the pattern; stop if the fit cannot be right.
2. Compute the evidence of all sets of up to three causes around the fit, and test whether anything
   is missing at all.
3. If so, refit with every effect of the best set that is probable enough, and look beside it, its
   law being allowed to be off, until nothing more is found. Test each effect by leaving it out.
4. Learn what the accepted laws leave unexplained as laws of any form, if readings left out are
   predicted better.
5. Conclude what is missing, or between what it is undecided, or where the unexplained shows.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.diagnosis.cross_validation import Stage, nested_rmse_um
from paint_deposition.inference.diagnosis.explanations import FOOTPRINT, UNKNOWN
from paint_deposition.inference.diagnosis.learning import choose_laws
from paint_deposition.inference.diagnosis.model_space import PRIOR, SURE, Group, Model, ModelSpace
from paint_deposition.inference.diagnosis.run import Run
from paint_deposition.inference.diagnosis.unexplained import locate_unexplained
from paint_deposition.inference.diagnosis.verdict import Diagnosis, EffectClass, percent
from paint_deposition.inference.fitting.one_thread import on_one_thread
from paint_deposition.inference.posterior import Posterior
from paint_deposition.inference.readings.campaign import Campaign

# Significance level of the test that something is missing.
ALPHA = 0.05
ROUNDS = 4
# Effects tried in the place of a shapeless cause: this many, whose laws alone have this share of
# its log evidence.
TRIALS, LEAST_LAW = 3, 0.4
# Least log evidence of such a cause, and its share of all that there was: less may be what the
# laws that were accepted leave over.
LEAST, LEFT_OVER = 12.0, 0.15
# From this log evidence on the law of the right effect may leave some of it, where it is off.
STRONG = 25.0
# An effect that was accepted in such a place stays from this share of that evidence on.
STAYS = 0.5
# Effects that are at least this probable are listed, and this many named where none is sure.
WORTH_LISTING, NAMED = 0.05, 3
# Share by which learned laws must lower the error on points left out.
LEAST_GAIN = 0.005


@on_one_thread
def diagnose(
    campaign: Campaign,
    start: DepositionModel,
    library: Mapping[str, type[Effect]],
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
    known: Posterior | None = None,
) -> Diagnosis:
    """Find what is missing from a model.

    Args:
        campaign: the readings and how the parts were painted.
        start: first guess of the pattern; its effects are kept and refitted.
        library: effects to consider, by id.
        seed: of starts and simulated deviations.
        progress: called with a line for each step of the work.
        known: what an earlier job told of the start's parameters: the prior.
    """
    run = Run(campaign, start, library, seed, progress, known)
    if run.trouble:
        return run.diagnosis(np.nan, 'fit_broken', run.trouble)
    progress('computing the evidence of what may be missing')
    space = run.linearise()
    p_value = space.p_value(seed)
    if p_value >= ALPHA:
        reason = 'The readings agree with the model to within the noise of the gauge.'
        return run.diagnosis(p_value, 'none_missing', reason)
    stages: list[Stage] = []
    least = max(LEAST, LEFT_OVER * float(space.models[0].log_weight))
    while len(stages) < ROUNDS:
        found = _started(space)
        effects = found or _behind_shapeless(run, space, least)
        if not effects:
            break
        names = [effect.id for effect in effects]
        progress('refitting with ' + ', '.join(names))
        stages.append(Stage(space, run.plain, frozenset(names), shapeless=not found))
        run.fit = run.fitted_with([*run.taken, *effects])
        space = run.linearise()
    groups = _tested(run, least)
    if len(groups) < sum(len(stage.accepted) for stage in stages):
        space = run.linearise()
    stages.append(Stage(space, run.plain))
    errors_um = nested_rmse_um(stages, run.study)
    _accept(run, groups, float(errors_um[0]))
    progress('learning what the laws leave unexplained')
    _learn(run, space, stages, errors_um)
    return _conclude(run, space, p_value)


def _started(space: ModelSpace) -> list[Effect]:
    """The accepted effects with amplitudes to start a fit from."""
    best = space.models[0]
    amounts = dict(zip(best.chosen, space.amplitudes(best), strict=True)) if best.causes else {}
    effects = []
    for cause, k, _ in space.accepted:
        law = space.explanations[k].sensitivity
        amplitudes = amounts[k]
        if law is None:
            # A free law says nothing of the law's amplitude: take it from the law alone.
            effects.append(_by_law_alone(space, cause))
        else:
            effects.append(law.with_amplitudes(amplitudes[: len(law.names)]))
    return effects


def _by_law_alone(space: ModelSpace, cause: str) -> Effect:
    """An effect with the amplitudes that its law has if nothing else is missing."""
    k, size, _ = space.best_law(cause)
    law = space.explanations[k].sensitivity
    assert law is not None
    (amplitudes,) = space.amplitudes(Model((cause,), (k,), (size,)))
    return law.with_amplitudes(amplitudes[: len(law.names)])


def _behind_shapeless(run: Run, space: ModelSpace, least: float) -> list[Effect]:
    """The effect that most of what a shapeless cause explains comes from, or the two together."""
    shares = _shares_of_shapeless(run, space, run.taken, least)
    if not shares:
        return []
    best = next(iter(shares))
    effect = _by_law_alone(space, best)
    if shares[best] > SURE:
        return [effect]
    if shares[best] < LEAST_LAW:
        return []
    # Another effect may have bent the first one's share: both have to stand the test afterwards.
    fit = run.fitted_with([*run.taken, effect])
    beside = run.linearise(fit)
    second = _started(beside)
    if not second:
        rest = _shares_of_shapeless(run, beside, run.candidates_in(fit), least)
        taking = [cause for cause in rest if rest[cause] > SURE]
        second = [_by_law_alone(beside, cause) for cause in taking[:1]]
    return [effect, *second] if second else []


def _shares_of_shapeless(
    run: Run, space: ModelSpace, beside: Sequence[Effect], least: float, *wanted: str
) -> dict[str, float]:
    """The share of a shapeless cause's evidence that an effect takes after a refit with it.

    A shapeless cause follows the readings more closely than any law, and the more so the more
    readings there are: its evidence says how far a law is off, not that the effect is absent.

    Args:
        run: the readings.
        space: at the model without the effect.
        beside: effects that this model has.
        least: log evidence from which on a shapeless cause calls for this.
        wanted: effects to try besides the ones whose laws explain most, whatever leads: much
            evidence is linear only nearly, and a difference of little beside it says nothing.

    Returns:
        By effect, largest first; empty where no shapeless cause is in question. Of evidence that
        is not strong an effect takes all, so that nothing more is called for, or none.
    """
    weight = float(space.models[0].log_weight)
    if weight < least or not (wanted or space.is_shapeless):
        return {}
    evidence = {c: space.best_law(c)[2] for c in space.causes if c not in PRIOR}
    likely = [c for c in evidence if evidence[c] >= LEAST_LAW * weight]
    likely = sorted(likely, key=lambda c: -evidence[c])[:TRIALS]
    shares = {}
    for cause in dict.fromkeys([*likely, *wanted]):
        fit = run.fitted_with([*beside, _by_law_alone(space, cause)])
        share = 1.0 - float(run.linearise(fit).models[0].log_weight) / weight
        shares[cause] = share if weight >= STRONG or share == 1.0 else 0.0
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _tested(run: Run, least: float) -> dict[str, Group]:
    """What could stand in the place of each added effect, all others as they are.

    An effect that does not stand this test is taken out again, the least probable first.
    """
    while True:
        effects = {effect.id: effect for effect in run.taken}
        groups = {}
        for name in effects:
            others = [e for e in effects.values() if e.id != name]
            space = run.linearise(run.fitted_with(others))
            groups[name] = space.group(name)
            if groups[name][1] <= SURE:
                shares = _shares_of_shapeless(run, space, others, STAYS * least, name)
                taking = tuple(cause for cause in shares if shares[cause] > SURE)
                if name in taking:
                    groups[name] = taking, max(shares.values())
        if not groups or min(p for _, p in groups.values()) > SURE:
            return groups
        weakest = min(groups, key=lambda name: groups[name][1])
        run.fit = run.fitted_with([e for e in effects.values() if e.id != weakest])


def _accept(run: Run, groups: dict[str, Group], holdout_um: float) -> None:
    """Accept the effects of the newest fit, strongest first, each as a step of the history."""
    final = run.fit
    effects = {effect.id: effect for effect in run.taken}
    left = list(effects)
    taken: list[Effect] = []
    while left:
        trials = {name: run.fitted_with([*taken, effects[name]]) for name in left[1:] and left}
        name = min(left, key=lambda n: trials[n].objective) if trials else left[0]
        left.remove(name)
        taken.append(effects[name])
        before, fit = run.history[-1], trials[name] if left else final
        members, probability = groups[name]
        members = (name, *(m for m in members if m not in effects))
        run.record(name, fit, None if left else holdout_um)
        run.accepted.append(run.described(members, probability, before))


def _learn(run: Run, space: ModelSpace, stages: Sequence[Stage], errors_um: np.ndarray) -> None:
    """Add as many laws of any form as improve the prediction of points left out.

    A law that the model cannot be fitted with is not tried again.
    """
    without: set[str] = set()
    while True:
        enough = np.flatnonzero(errors_um <= (1.0 + LEAST_GAIN) * errors_um.min())[0]
        options = [e for e in space.explanations if e.learns not in without]
        chosen = [(options[k], size) for k, size in choose_laws(run.plain, options, space.freedom)]
        chosen = chosen[:enough]
        if not chosen:
            return
        fit = run.learned(chosen)
        if fit.objective <= run.fit.objective:
            break
        without.add(chosen[0][0].learns)
        errors_um = nested_rmse_um(stages, run.study, without)
    laws = [
        e.id for e in fit.model.effects if e.family == 'learned' and e not in run.start.effects
    ]
    before = run.history[-1]
    run.record(' and '.join(laws), fit, float(errors_um[len(chosen)]))
    run.accepted += [run.described((law,), 1.0, before) for law in laws]


def _conclude(run: Run, space: ModelSpace, p_value: float) -> Diagnosis:
    """The verdict on what was found."""
    named = [c for c in run.accepted if not c.best.startswith('learned:')]
    others = _others(run, space)
    if named:
        names = ', and '.join(_in_words(c) for c in named)
        return run.diagnosis(p_value, 'effect_missing', f'The readings show {names}.', others)
    outside = space.inclusion(UNKNOWN, FOOTPRINT)
    if outside > 0.5 or not others:
        footprint = space.inclusion(FOOTPRINT) > space.inclusion(UNKNOWN)
        unknown = locate_unexplained(run.study, run.history[0].fit, footprint, run.seed)
        reason = (
            'The pattern itself differs from the two Gaussians of eq. (1).'
            if footprint
            else f'Something outside the library shows against {unknown.covariate}.'
        )
        return run.diagnosis(p_value, 'unknown_effect', reason, others, unknown)
    reason = 'These may be missing: ' + ', or '.join(
        f'{c.best} ({percent(c.probability)})' for c in others[:NAMED]
    )
    return run.diagnosis(p_value, 'undecided', reason, others)


def _others(run: Run, space: ModelSpace) -> tuple[EffectClass, ...]:
    """Groups of effects that may act, but are not accepted."""
    known = {member for found in run.accepted for member in found.members}
    best = space.models[0]
    found: list[EffectClass] = []
    for cause in sorted(run.candidates, key=lambda c: -space.inclusion(c)):
        if cause in known or space.inclusion(cause) < WORTH_LISTING:
            continue
        members, probability = space.group(cause) if cause in best.causes else ((cause,), 0.0)
        members = (cause, *(m for m in members if m not in known and m != cause))
        known |= set(members)
        fit = run.fitted_with([*run.taken, run.candidates[cause][0]])
        probability = probability or space.inclusion(cause)
        found.append(run.described(members, probability, run.history[-1], fit))
    return tuple(found)


def _in_words(found: EffectClass) -> str:
    if len(found.members) == 1:
        return found.best
    return f'{found.best} (or what they cannot tell from it: {", ".join(found.members[1:])})'
