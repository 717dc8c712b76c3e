"""Add an effect or a learned law that the user chose and fit the model with it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.special import expit, logsumexp

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_laws import LearnedLaw
from paint_deposition.errors import ModelError
from paint_deposition.inference.diagnosis.explanations import (
    ADDITION_UM,
    FACTOR,
    LENGTHS,
    Explanation,
    of_random,
)
from paint_deposition.inference.diagnosis.learning import (
    Nulls,
    by_size,
    locate_unexplained,
    null_for,
    nulls_around,
    of_readings,
)
from paint_deposition.inference.diagnosis.model_space import ALPHA, SIZES, SURE, inclusion_of
from paint_deposition.inference.diagnosis.search import EffectSet, Search
from paint_deposition.inference.diagnosis.smooth_laws import bases_over
from paint_deposition.inference.diagnosis.state import DiagnosisState, trouble_with
from paint_deposition.inference.diagnosis.verdict import Diagnosis, percent
from paint_deposition.inference.fitting.least_squares import on_one_thread
from paint_deposition.inference.fitting.parameters import Posterior
from paint_deposition.inference.readings.campaign import Campaign


@on_one_thread
def refit(
    campaign: Campaign,
    start: DepositionModel,
    added: type[Effect] | None,
    library: Mapping[str, type[Effect]] = MappingProxyType({}),
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
    known: Posterior | None = None,
) -> Diagnosis:
    """Fit the model without and with an effect, and compare the evidence of the two.

    Args:
        start: the model so far; its effects are refitted too.
        added: the effect or learned law, or None to fit what is there.
        known: what is known of the start's parameters: the prior.

    Raises:
        ModelError: the model has the effect already, or its law cannot be learned here.
    """
    law = added if added is not None and issubclass(added, LearnedLaw) else None
    if added and start.effect(added.id):
        raise ModelError(
            f'{added.id} is in the model already; add no effect to refit the model as it is, or '
            'take it out of the model'
        )
    candidates = dict(library) | ({added.id: added} if added and not law else {})
    progress('fitting the model')
    state = DiagnosisState.begin(campaign, start, candidates, seed, known)
    if trouble := trouble_with(state.study, state.fit):
        return state.diagnosis(np.nan, 'fit_broken', trouble)
    search = Search(state)
    nothing = search.nothing
    state = nothing.told_in(state)
    p_value = min(nothing.p_values)
    missing = p_value < ALPHA
    if added is None:
        reason = 'The model was fitted as it is'
        if not missing:
            return state.diagnosis(p_value, 'none_missing', f'{reason}.')
        unknown = locate_unexplained(state.study, state.fit, nothing, seed)
        reason += '; something is missing, which diagnose can tell.'
        return state.diagnosis(p_value, 'unknown_effect', reason, unknown=unknown)
    if law is not None:
        progress(f'learning {law.id}')
        return _with_learned(state, law, nothing, p_value)
    progress(f'fitting with {added.id}')
    before, with_it = state.history[-1], search.with_effect(nothing, added.id)
    probability = inclusion_of([with_it.log_evidence], [nothing.log_evidence])
    state = replace(with_it.told_in(state), amplitude_sizes=with_it.fit.parameters.amplitude_sizes)
    state = state.with_step(added.id, with_it.result)
    state = state.accepting((added.id,), probability, before)
    reason = (
        f'{added.id} was added as asked; it is missing with a probability of '
        f'{percent(probability)} against the model as it was.'
    )
    if missing and probability > SURE:
        return state.diagnosis(p_value, 'effect_missing', reason)
    return state.diagnosis(p_value, 'undecided' if missing else 'none_missing', reason)


def _with_learned(
    state: DiagnosisState, law: type[LearnedLaw], nothing: EffectSet, p_value: float
) -> Diagnosis:
    """The model with a law over the covariate, whatever its evidence beside what may vary."""
    options, nulls = _options(state, law), nulls_around(nothing, state.fit)
    weights = _log_bayes_factors(state, nulls, options)
    probability = float(expit(logsumexp(weights) - np.log(weights.size)))
    before, fit = state.history[-1], state.learned([_best(options, weights)])

    def without(out: np.ndarray) -> np.ndarray:
        # The law's kind, length and size are chosen without these readings, too.
        kept = [explanation.select(~out) for explanation in options]
        others = _log_bayes_factors(state, of_readings(nulls, ~out), kept)
        explanation, size = _best(options, others)
        return state.study.predicted_without_um(state.fit, out, size * explanation.columns)

    error_um = float(state.study.errors_left_out_um(without))
    state = state.with_step(law.id, fit, (error_um, error_um))
    state = state.accepting((law.id,), probability, before)
    reason = (
        f'A learned law over {law.over} was added as asked; the film depends on it with a '
        f'probability of {percent(probability)} against the model as it was.'
    )
    if p_value >= ALPHA:
        return state.diagnosis(p_value, 'none_missing', reason)
    unknown = locate_unexplained(state.study, state.history[0].fit, nothing, state.seed)
    return state.diagnosis(p_value, 'unknown_effect', reason, unknown=unknown)


def _options(state: DiagnosisState, law: type[LearnedLaw]) -> list[Explanation]:
    """Laws over the covariate of every kind and length of correlation."""
    found = [
        of_random(state.study, basis.random(unit, length))
        for kind in law.kinds
        for basis in bases_over(state.study, state.fit.model, law, kind)
        for length in LENGTHS.get(law.covariate, LENGTHS['covariate'])
        for unit in (FACTOR if kind == 'factor' else ADDITION_UM,)
    ]
    if not found:
        raise ModelError(
            f'{law.id}: {law.covariate} is the same at all readings; choose a covariate that '
            'differs between them'
        )
    return found


def _log_bayes_factors(
    state: DiagnosisState, nulls: Nulls, options: Sequence[Explanation]
) -> np.ndarray:
    """(n, S) log Bayes factor of each law at each size."""
    return np.array([by_size(null_for(nulls, one), one, state.freedom) for one in options])


def _best(options: Sequence[Explanation], weights: np.ndarray) -> tuple[Explanation, float]:
    """The law and the size of the greatest weight (n, S)."""
    number, size = np.unravel_index(weights.argmax(), weights.shape)
    return options[int(number)], float(SIZES[size])
