"""Add an effect that the user chose and fit the model with it."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from scipy.special import expit, logsumexp

from paint_deposition.diagnosis.classes import ConfoundedClass
from paint_deposition.diagnosis.linearisation import Linearisation
from paint_deposition.diagnosis.run import ALPHA, SURE, Run
from paint_deposition.diagnosis.unexplained import locate_unexplained
from paint_deposition.diagnosis.verdict import Diagnosis, percent
from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError
from paint_deposition.fitting.parameters import FreeParameters
from paint_deposition.readings.campaign import Campaign


def refit(
    campaign: Campaign,
    start: DepositionModel,
    added: type[Effect] | None,
    library: Mapping[str, type[Effect]] = MappingProxyType({}),
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
) -> Diagnosis:
    """Fit the model without and with an effect, and compare the evidence of the two.

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
    known = dict(library) | ({added.id: added} if added else {})
    run = Run(campaign, start, known, seed, progress)
    if run.trouble:
        return run.diagnosis(None, 'fit_broken', run.trouble)
    linear = run.linearise()
    missing = linear.space.p_value < ALPHA
    if added is None:
        reason = 'The model was fitted as it is'
        if not missing:
            return run.diagnosis(linear, 'none_missing', f'{reason}.')
        unknown = locate_unexplained(run.study, run.fit, False, seed)
        reason += '; something is missing, which diagnose can tell.'
        return run.diagnosis(linear, 'unknown_effect', reason, unknown=unknown)
    progress(f'fitting with {added.id}')
    fits = [
        run.study.fit(
            FreeParameters.of(run.fit.model.with_effect(shape), *start.effects, shape),
            nuisance=run.study.nuisance,
        )
        for shape in run.candidates[added.id]
    ]
    probability = _probability(linear, added.id)
    best = min(fits, key=lambda fit: fit.objective)
    run.add(ConfoundedClass((added.id,), probability, best), linear)
    reason = (
        f'{added.id} was added as asked; it is missing with a probability of '
        f'{percent(probability)} against the model as it was.'
    )
    if probability > SURE:
        return run.diagnosis(linear, 'effect_missing', reason)
    return run.diagnosis(linear, 'undecided' if missing else 'none_missing', reason)


def _probability(linear: Linearisation, effect_id: str) -> float:
    """Posterior probability of the effect against the null hypothesis, with equal priors."""
    hypotheses = linear.space.hypotheses
    shapes = [k for k, h in enumerate(hypotheses) if h.effects == (effect_id,) and not h.other]
    factors = linear.space.log_bayes_factors[shapes]
    return float(expit(logsumexp(factors, b=1.0 / len(shapes))))
