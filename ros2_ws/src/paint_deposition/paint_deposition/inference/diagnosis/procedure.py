"""Which physical effects are missing from the model, if any: the procedure.

1. Fit the pattern; stop if the fit cannot be right.
2. Compute the evidence of all sets of up to three causes around the fit, beside a remainder of
   nature of every size, and test whether anything is missing at all.
3. If so, refit with the sets that this proposes, and take the one whose refitted model has the
   highest evidence; look beside it until nothing more is found. Test each by leaving it out.
4. Learn what the accepted laws leave unexplained as laws of any form, if readings left out are
   predicted better.
5. Conclude what is missing, or between what it is undecided, or where the unexplained shows.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.diagnosis.cross_validation import Stage, nested_rmse_um
from paint_deposition.inference.diagnosis.evidence import NullModel
from paint_deposition.inference.diagnosis.explanations import UNKNOWN
from paint_deposition.inference.diagnosis.learning import choose_laws
from paint_deposition.inference.diagnosis.mixture import Mixture
from paint_deposition.inference.diagnosis.model_space import Group
from paint_deposition.inference.diagnosis.run import Run
from paint_deposition.inference.diagnosis.search import Search
from paint_deposition.inference.diagnosis.unexplained import locate_unexplained
from paint_deposition.inference.diagnosis.verdict import Diagnosis, EffectClass, percent
from paint_deposition.inference.fitting.least_squares import on_one_thread
from paint_deposition.inference.posterior import Posterior
from paint_deposition.inference.readings.campaign import Campaign

# Significance level of the test that something is missing.
ALPHA = 0.05
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
    search = Search(run)
    run.remainder = search.nothing.space.figures
    p_value = search.nothing.space.p_value(seed)
    if p_value >= ALPHA:
        reason = 'The readings agree with the model to within the noise of the gauge.'
        return run.diagnosis(p_value, 'none_missing', reason)
    progress('refitting with what may be missing')
    path = search.path()
    best, groups = search.groups(path[-1])
    stages = [
        Stage(here.space, run.plain_of(here.fit), after.names - here.names)
        for here, after in pairwise([t for t in path if t.names < best.names] + [best])
    ]
    run.fit = best.fit
    space = best.space
    run.remainder = space.figures
    stages.append(Stage(space, run.plain))
    errors_um = nested_rmse_um(stages, run.study)
    _accept(run, groups, float(errors_um[0]))
    progress('learning what the laws leave unexplained')
    _learn(run, space, stages, errors_um)
    return _conclude(run, space, p_value)


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


def _learn(run: Run, space: Mixture, stages: Sequence[Stage], errors_um: np.ndarray) -> None:
    """Add as many laws of any form as improve the prediction of points left out.

    A law that the model cannot be fitted with is not tried again.
    """
    without: set[str] = set()
    while True:
        enough = np.flatnonzero(errors_um <= (1.0 + LEAST_GAIN) * errors_um.min())[0]
        options = [e for e in space.explanations if e.learns not in without]
        beside = NullModel.of(np.hstack([run.plain.columns, space.of_parts]), run.plain.raw)
        chosen = [(options[k], size) for k, size in choose_laws(beside, options, space.freedom)]
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


def _conclude(run: Run, space: Mixture, p_value: float) -> Diagnosis:
    """The verdict on what was found."""
    named = [c for c in run.accepted if not c.best.startswith('learned:')]
    others = _others(run, space)
    if named:
        names = ', and '.join(_in_words(c) for c in named)
        return run.diagnosis(p_value, 'effect_missing', f'The readings show {names}.', others)
    if space.inclusion(UNKNOWN) > 0.5 or not others:
        unknown = locate_unexplained(run.study, run.history[0].fit, False, run.seed)
        reason = f'Something outside the library shows against {unknown.covariate}.'
        return run.diagnosis(p_value, 'unknown_effect', reason, others, unknown)
    reason = 'These may be missing: ' + ', or '.join(
        f'{c.best} ({percent(c.probability)})' for c in others[:NAMED]
    )
    return run.diagnosis(p_value, 'undecided', reason, others)


def _others(run: Run, space: Mixture) -> tuple[EffectClass, ...]:
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
