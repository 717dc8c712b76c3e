"""Which physical effects are missing from the model, if any: the procedure.

1. Fit the pattern; stop if the fit cannot be right.
2. Test whether anything is missing at all, beside a discrepancy of nature of every size.
3. If so, refit with the effects that the evidence around the fit proposes, and take the one whose
   refitted model has the highest evidence; look beside it until nothing more is found. Test each
   effect by leaving it out.
4. Learn what the accepted laws leave unexplained as laws of any form, if readings left out are
   predicted better.
5. Conclude what is missing, or between what it is undecided, or where the unexplained shows.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.diagnosis.discrepancy import painted_alike
from paint_deposition.inference.diagnosis.explanations import (
    nonparametric_laws_of,
    of_corrections,
    of_footprint,
    of_places,
)
from paint_deposition.inference.diagnosis.learning import (
    LeftOut,
    choose_laws,
    locate_unexplained,
    nulls_around,
)
from paint_deposition.inference.diagnosis.model_space import ALPHA
from paint_deposition.inference.diagnosis.search import EffectSet, Group, Search, SearchStage
from paint_deposition.inference.diagnosis.state import DiagnosisState, trouble_with
from paint_deposition.inference.diagnosis.testability import testability
from paint_deposition.inference.diagnosis.verdict import Diagnosis, EffectClass, percent
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import Fit, on_one_thread
from paint_deposition.inference.fitting.outliers import Outlier
from paint_deposition.inference.fitting.parameters import Posterior
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.inference.readings.readings import beyond_noise_um, is_worse

# The model is not good enough where it misses the readings, beyond gauge and texture, by this part
# of the thickest film: measured sprays of one setting differ by 0.5 to 5 %.
MOST_BEYOND = 0.03


@on_one_thread
def diagnose(
    campaign: Campaign,
    start: DepositionModel,
    library: Mapping[str, type[Effect]],
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
    known: Posterior | None = None,
    sound: frozenset[str] = frozenset(),
) -> Diagnosis:
    """Find what is missing from a model.

    Args:
        campaign: the readings and how the parts were painted.
        start: first guess of the pattern; its effects are kept and refitted.
        library: effects to consider, by id.
        seed: of starts and simulated deviations.
        progress: called with a line for each step of the work.
        known: what an earlier job told of the start's parameters: the prior.
        sound: labels of points whose readings are no outliers.
    """
    progress('fitting the model')
    state = DiagnosisState.begin(campaign, start, library, seed, known, sound)
    if trouble := trouble_with(state.study, state.fit):
        return state.diagnosis(np.nan, 'fit_broken', trouble)
    progress('computing the evidence of what may be missing')
    search = Search(state)
    nothing = search.nothing
    testable = testability(nothing.space.central, seed)
    state = replace(nothing.told_in(state), testable=testable)
    p_value = min(nothing.p_values)
    if p_value >= ALPHA:
        return _nothing_missing(state, nothing, p_value)
    progress('refitting with what may be missing')
    sought = nothing.p_values[0] < ALPHA
    stages = search.stages() if sought else [SearchStage(nothing, [])]
    best, groups = search.groups(stages[-1].here)
    state = replace(state, amplitude_sizes=best.fit.parameters.amplitude_sizes)
    fit = best.result
    options = [
        *of_corrections(state.study, fit, best.names),
        *nonparametric_laws_of(state.study, fit.model),
        *of_places(state.study, fit.model),
        *of_footprint(state.study, fit, worth=-np.inf),
    ]
    left_out = LeftOut(nothing, stages, best, options)
    state = _accept(best.told_in(state), fit, groups, left_out.errors_um())
    progress('learning what the laws leave unexplained')
    state = _learn(state, best, left_out)
    outliers = () if sound else state.study.outliers  # it is done anew once
    if explained := _explained_outliers(campaign, outliers, state.fit.model):
        progress('readings that looked wrong agree with what was found: diagnosing with them')
        return diagnose(campaign, start, library, seed, progress, known, explained)
    return _conclude(state, best, _others(state, search.beside(best, sought)), p_value)


def _explained_outliers(
    campaign: Campaign, outliers: Iterable[Outlier], model: DepositionModel
) -> frozenset[str]:
    """Labels of outliers that a model explains: by more than half, and to within their scatter."""
    readings = campaign.readings
    labels = readings.point[readings.first].tolist()
    if not {one.point for one in outliers} & {*labels}:  # none, or cells of a scan
        return frozenset()
    film_um = dict(zip(labels, Forward(campaign, model.effects).predict_um(model), strict=True))
    return frozenset(
        one.point
        for one in outliers
        if abs(one.thickness_um - film_um.get(one.point, np.inf))
        < min(3.0 * one.sigma_um, 0.5 * abs(one.thickness_um - one.expected_um))
    )


def _nothing_missing(state: DiagnosisState, nothing: EffectSet, p_value: float) -> Diagnosis:
    """The verdict where the test finds nothing; a footprint may still differ from eq. (1)."""
    first, noise_um = state.history[0], state.study.noise_floor_um
    options = of_footprint(state.study, state.fit)
    left_out = LeftOut(nothing, [SearchStage(nothing, [])], nothing, options)
    state = _learn(state, nothing, left_out)
    beyond_um = beyond_noise_um(state.history[-1].rmse_um, noise_um)
    share = beyond_um / float(np.max(state.fit.predicted_um))
    beyond = (
        f'At the fitted points the model is off by {beyond_um:.2f} µm beyond gauge and texture '
        f'({noise_um:.2f} µm), {100.0 * share:.1f} % of the thickest film'
    )
    if share > MOST_BEYOND or state.accepted:
        unknown = locate_unexplained(state.study, first.fit, nothing, state.seed)
        reason = 'The footprint differs from that of eq. (1); it was learned.'
        if share > MOST_BEYOND:
            reason = f'{beyond}; the limit is {100.0 * MOST_BEYOND:.0f} %. {unknown}'
        return state.diagnosis(p_value, 'unknown_effect', reason, (), unknown)
    reason = f'{beyond}: sprays of one setting may differ by as much.'
    # Errors this many times as large as the noise of gauge and texture need a word.
    if first.rmse_um < 1.1 * noise_um:
        reason = 'The readings agree with the model to within gauge and texture.'
    p_of_levels, doubt = state.study.level_doubt(replace(first.fit, discrepancy=state.discrepancy))
    if doubt:
        reason = f'{doubt} Beside it: {reason[0].lower()}{reason[1:]}'
        return state.diagnosis(min(p_value, p_of_levels), 'unknown_effect', reason)
    return state.diagnosis(p_value, 'none_missing', reason)


def _accept(
    state: DiagnosisState, final: Fit, groups: dict[str, Group], holdout_um: tuple[float, float]
) -> DiagnosisState:
    """Accept the effects of a fit, strongest first, each as a step of the history."""
    effects = {effect.id: effect for effect in state.candidates_in(final)}
    left = list(effects)
    accepted: list[Effect] = []
    while left:
        trials = {
            name: state.fitted_with([*accepted, effects[name]], final.model)
            for name in left
            if len(left) > 1
        }
        name = min(trials, key=lambda n: trials[n].objective) if trials else left[0]
        left.remove(name)
        accepted.append(effects[name])
        before = state.history[-1]
        members, probability = groups[name]
        members = (name, *(m for m in members if m not in effects))
        state = state.with_step(name, trials.get(name, final), None if left else holdout_um)
        state = state.accepting(members, probability, before)
    return state


def _learn(state: DiagnosisState, best: EffectSet, left_out: LeftOut) -> DiagnosisState:
    """Add as few laws of any form as improve the prediction of readings left out.

    A law that the model cannot be fitted with, or that makes a part worse, is not tried again.
    """
    without: frozenset[str] = frozenset()
    nulls = nulls_around(best, state.fit)
    while True:
        left = [option for option in left_out.options if option.learns not in without]
        laws = [(left[k], size) for k, size in choose_laws(nulls, left, state.freedom)]
        chosen = laws[: left_out.borne_out(laws, without)]
        if not chosen:
            return state
        fit = state.learned(chosen)
        parts = zip(
            *(state.study.residuals_by_experiment(f.predicted_um) for f in (state.fit, fit)),
            strict=True,
        )
        if fit.objective <= state.fit.objective and not any(is_worse(*part) for part in parts):
            break
        without |= {chosen[0][0].learns}
    learned = [
        e.id for e in fit.model.effects if e.family == 'learned' and e not in state.start.effects
    ]
    before = state.history[-1]
    state = state.with_step(' and '.join(learned), fit, left_out.errors_um(laws, without))
    for law in learned:
        state = state.accepting((law,), 1.0, before)
    return state


def _conclude(
    state: DiagnosisState, best: EffectSet, others: tuple[EffectClass, ...], p_value: float
) -> Diagnosis:
    """The verdict on what was found."""
    named = [c for c in state.accepted if not c.best.startswith('learned:')]
    possible = ', or '.join(f'{c.best} ({percent(c.probability)})' for c in others[:3])
    if named:
        alike = [', '.join(c.members[1:]) for c in named]
        names = ', and '.join(
            f'{c.best} (or, not distinguishable here, {others})' if others else c.best
            for c, others in zip(named, alike, strict=True)
        )
        reason, rest = f'The readings show {names}.', None
        # A law that was learned is the rest.
        if len(named) == len(state.accepted) and min(best.p_values) < ALPHA:
            rest = locate_unexplained(state.study, state.fit, best, state.seed)
            reason += f' They show more than that (p = {min(best.p_values):.2g}). {rest}'
            reason += f' It may be {possible}.' if others else ''
        return state.diagnosis(p_value, 'effect_missing', reason, others, rest)
    unknown = locate_unexplained(state.study, state.history[0].fit, best, state.seed)
    # Where a law was learned something unknown acts, whatever may act beside it.
    enough = 0.5 if unknown.part or unknown.p_value < ALPHA else 0.1
    if not state.accepted and sum(c.probability for c in others) >= enough:
        reason = f'These may be missing: {possible}'
        return state.diagnosis(p_value, 'undecided', reason, others)
    reason = f'Something is missing that no effect of the library explains. {unknown}'
    p_of_levels, doubt = state.study.level_doubt(replace(state.fit, discrepancy=state.discrepancy))
    # What is far less probable comes first.
    if doubt and p_of_levels < 0.1 * p_value:
        reason = f'{doubt} {reason}'
    for over in (c.best.removeprefix('learned:') for c in state.accepted):
        alike = [n for n, shapes in state.candidates.items() if over in shapes[0].covariates]
        if alike:
            reason += f' Effects that depend on {over} by another law: {", ".join(alike)}.'
    if not painted_alike(state.study.campaign.experiments).any():
        reason += (
            ' All parts were painted alike: it may belong to the part or to the spray. Spray '
            'the same part another way.'
        )
    if others:
        reason += f' Beside it these may be missing: {possible}.'
    return state.diagnosis(p_value, 'unknown_effect', reason, others, unknown)


def _others(state: DiagnosisState, probabilities: Mapping[str, float]) -> tuple[EffectClass, ...]:
    """Effects that may act beside those that were accepted, as probable as this."""
    known = {member for found in state.accepted for member in found.members}
    found = []
    for cause, probability in probabilities.items():
        # Effects that are at least this probable are listed.
        if cause in known or probability < 0.05:
            continue
        effects = [*state.candidates_in(state.fit), state.candidates[cause][0]]
        fit = state.fitted_with(effects, state.fit.model)
        found.append(state.described((cause,), probability, state.history[-1], fit))
    return tuple(found)
