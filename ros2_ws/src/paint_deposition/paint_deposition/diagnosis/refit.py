"""Add an effect or a learned law that the user chose and fit the model with it."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from scipy.special import expit, logsumexp

from paint_deposition.diagnosis.evidence import KNOWN_NOISE, NullModel, log_bayes_factor
from paint_deposition.diagnosis.explanations import (
    FREE_ADDITION_UM,
    FREE_FACTOR,
    UNKNOWN,
    Explanation,
)
from paint_deposition.diagnosis.learning import ChosenCurve
from paint_deposition.diagnosis.model_space import SIZES, SURE
from paint_deposition.diagnosis.procedure import ALPHA
from paint_deposition.diagnosis.run import Run
from paint_deposition.diagnosis.smooth_laws import curve_basis
from paint_deposition.diagnosis.unexplained import locate_unexplained
from paint_deposition.diagnosis.verdict import Diagnosis, percent
from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned import LearnedLaw
from paint_deposition.errors import ModelError
from paint_deposition.readings.campaign import Campaign
from paint_deposition.readings.residuals import root_mean_square

ALL = slice(None)
# Lengths of correlation of a curve that is learned as asked, in standard deviations of the
# covariate.
LENGTHS = (0.35, 1.0, 2.0)


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
        added: the effect or learned law, or None to fit what is there.
        library: effects to test for beside it, by id.
        seed: of starts and simulated deviations.
        progress: called with a line for each step of the work.

    Raises:
        ModelError: the model has the effect already, or its law cannot be learned here.
    """
    law = added if added is not None and issubclass(added, LearnedLaw) else None
    if added and start.effect(added.id):
        raise ModelError(
            f'{added.id} is in the model already; to fit it anew, add none, or take it out'
        )
    known = dict(library) | ({added.id: added} if added and not law else {})
    run = Run(campaign, start, known, seed, progress)
    if run.trouble:
        return run.diagnosis(np.nan, 'fit_broken', run.trouble)
    space = run.linearise()
    p_value = space.p_value(seed)
    missing = p_value < ALPHA
    if added is None:
        reason = 'The model was fitted as it is'
        if not missing:
            return run.diagnosis(p_value, 'none_missing', f'{reason}.')
        unknown = locate_unexplained(run.study, run.fit, False, seed)
        reason += '; something is missing, which diagnose can tell.'
        return run.diagnosis(p_value, 'unknown_effect', reason, unknown=unknown)
    if law is not None:
        progress(f'learning {law.id}')
        return _with_learned(run, law, p_value)
    progress(f'fitting with {added.id}')
    fits = [run.fitted_with([shape]) for shape in run.candidates[added.id]]
    before, probability = run.history[-1], space.against_nothing(added.id)
    run.record(added.id, min(fits, key=lambda fit: fit.objective))
    run.accepted.append(run.described((added.id,), probability, before))
    reason = (
        f'{added.id} was added as asked; it is missing with a probability of '
        f'{percent(probability)} against the model as it was.'
    )
    if probability > SURE:
        return run.diagnosis(p_value, 'effect_missing', reason)
    return run.diagnosis(p_value, 'undecided' if missing else 'none_missing', reason)


def _with_learned(run: Run, law: type[LearnedLaw], p_value: float) -> Diagnosis:
    """The model with a curve over the law's covariate, whatever its evidence."""
    curves = _curves(run, law)
    null = NullModel.around(run.fit, frozenset(), run.study.nuisance)
    freedom = run.study.noise.degrees_of_freedom
    weights = _log_bayes_factors(null, curves, freedom)
    probability = float(expit(logsumexp(weights) - np.log(len(weights))))
    before = run.history[-1]
    fit = run.learned([curves[int(np.argmax(weights))]])
    run.record(law.id, fit, _holdout_um(run, null, curves))
    run.accepted.append(run.described((law.id,), probability, before))
    reason = (
        f'A learned law over {law.over} was added as asked; the film depends on it with a '
        f'probability of {percent(probability)} against the model as it was.'
    )
    if p_value >= ALPHA:
        return run.diagnosis(p_value, 'none_missing', reason)
    unknown = locate_unexplained(run.study, run.history[0].fit, False, run.seed)
    return run.diagnosis(p_value, 'unknown_effect', reason, unknown=unknown)


def _curves(run: Run, law: type[LearnedLaw]) -> list[ChosenCurve]:
    """Curves over the law's covariate of every kind, length of correlation and size."""
    found = []
    for kind in law.kinds:
        basis = curve_basis(run.study, run.fit.model, law.covariate, kind)
        if basis is None:
            raise ModelError(
                f'{law.id}: {law.covariate} is the same at all readings; choose a covariate that '
                'differs between them'
            )
        size = FREE_FACTOR if kind == 'factor' else FREE_ADDITION_UM
        for length in LENGTHS:
            at_knots = size * basis.root(length)
            columns = basis.film_um @ at_knots / run.study.sigma_um[:, np.newaxis]
            sides = np.zeros(columns.shape[1])
            curve = Explanation(UNKNOWN, columns, sides, 1.0, curve=(basis, at_knots))
            found += [ChosenCurve(curve, float(size)) for size in SIZES]
    return found


def _log_bayes_factors(
    null: NullModel, curves: Sequence[ChosenCurve], freedom: float, rows: slice | np.ndarray = ALL
) -> list[float]:
    """Log Bayes factor of each curve against the null hypothesis for some of the readings."""
    square = float(null.deviation @ null.deviation)
    found = []
    for curve in curves:
        columns = null.whiten(curve.columns[rows])
        free = np.zeros(columns.shape[1])
        scores = columns.T @ null.deviation
        found.append(
            log_bayes_factor(
                columns.T @ columns, scores, square, free, free + 1.0,
                min(freedom, 2.0 * KNOWN_NOISE), len(null.deviation),
            )
        )  # fmt: skip
    return found


def _holdout_um(run: Run, null: NullModel, curves: Sequence[ChosenCurve]) -> float:
    """Error on points left out by patches, the curve's kind, length and size chosen without them.

    In micrometres.
    """
    blocks, freedom = run.study.patches(), run.study.noise.degrees_of_freedom
    pattern = null.columns.shape[1] - run.study.nuisance.shape[1]
    deviation = np.empty(len(blocks))
    for block in np.unique(blocks):
        out = blocks == block
        weights = _log_bayes_factors(null.select(~out), curves, freedom, ~out)
        columns = np.hstack([null.columns, curves[int(np.argmax(weights))].columns])
        kept = columns[~out]
        precision = np.eye(columns.shape[1]) + kept.T @ kept
        amounts = np.linalg.solve(precision, kept.T @ null.raw[~out])
        # Like all errors, this one is without the levels of parts and other nuisance.
        amounts[pattern : null.columns.shape[1]] = 0.0
        deviation[out] = null.raw[out] - columns[out] @ amounts
    return root_mean_square(deviation * run.study.sigma_um)
