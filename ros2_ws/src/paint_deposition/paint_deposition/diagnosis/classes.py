"""Effects that the readings cannot tell apart, and how probable each such class is."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import norm

from paint_deposition.diagnosis.evidence import Evidence, Hypothesis
from paint_deposition.diagnosis.linearisation import Linearisation
from paint_deposition.diagnosis.sensitivities import Sensitivity
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.fitting.parameters import PATTERN, FreeParameters
from paint_deposition.fitting.study import Study

# Effects are confounded if their sensitivities are parallel to within this cosine ...
CONFOUNDED_COSINE = 0.9
# ... with amplitudes up to this many times their typical size.
PLAUSIBLE = 4.0
# Hypotheses whose log posterior in the linear approximation is further behind are not refitted.
REFITTED_WITHIN = 7.0
MOST_REFITTED = 10
# An effect beside an unknown cause counts as named if it has this share of their log evidence.
SUFFICIENT = 0.75
# Classes with a smaller probability are not listed.
WORTH_LISTING = 0.02
# An effect of a pair is needed if it raises the pair's log evidence by this much.
NEEDED = 1.0


@dataclass(frozen=True)
class ConfoundedClass:
    """Effects that the readings cannot tell apart, with a refit of the best one.

    Attributes:
        members: ids, most probable first.
        probability: that one of them is missing.
        fit: of the model with the best member.
    """

    members: tuple[str, ...]
    probability: float
    fit: Fit

    @property
    def best(self) -> str:
        """Id of the most probable member."""
        return self.members[0]


@dataclass(frozen=True)
class Posterior:
    """Posterior probabilities; what is left of one is that nothing is missing.

    Attributes:
        classes: most probable first; as two may be missing, they may sum to more than one.
        named: probability that effects of the library explain the readings.
        unknown: probability that something is missing that the library does not explain.
        footprint: probability that the pattern itself deviates from eq. (1).
    """

    classes: tuple[ConfoundedClass, ...]
    named: float
    unknown: float
    footprint: float


def class_posterior(study: Study, linear: Linearisation) -> Posterior:
    """Refit the most probable hypotheses and sum their posterior probabilities by class.

    Args:
        study: the readings.
        linear: the model so far and the evidence in the linear approximation around it.
    """
    hypotheses = linear.space.hypotheses
    factors, fits = _refit(study, linear)
    alone = _best_alone(hypotheses, factors)
    weights = linear.space.posterior(factors)
    named = np.array(
        [
            bool(h.effects)
            and (
                not h.other or max(factors[alone[e]] for e in h.effects) >= SUFFICIENT * factors[k]
            )
            for k, h in enumerate(hypotheses)
        ]
    )
    other = np.array([h.other for h in hypotheses])
    needed = [_needed(h, factors[k], factors, alone) for k, h in enumerate(hypotheses)]
    classes = []
    left = list(alone)
    while left:
        members = confounded(linear, left)
        left = [effect_id for effect_id in left if effect_id not in members]
        holds = np.array([bool(set(members) & effects) for effects in needed])
        probability = float(weights[holds & named].sum())
        if probability >= WORTH_LISTING:
            first = alone[members[0]]
            fit = fits.get(first) or _fit_hypothesis(study, linear, hypotheses[first])
            classes.append(ConfoundedClass(members, min(probability, 1.0), fit))
    return Posterior(
        tuple(sorted(classes, key=lambda c: -c.probability)),
        float(weights[named].sum()),
        float(weights[(other == 'unknown') & ~named].sum()),
        float(weights[(other == 'footprint') & ~named].sum()),
    )


def confounded(linear: Linearisation, ordered: list[str]) -> tuple[str, ...]:
    """The first effect, and those of the others that change the readings in the same way."""
    hypotheses = linear.space.hypotheses
    best = _best_alone(hypotheses, linear.space.log_bayes_factors)
    first = hypotheses[best[ordered[0]]]
    change = first.columns @ Evidence(first).posterior_mean(linear.null.deviation)
    length = np.linalg.norm(change)
    members = [ordered[0]]
    for effect_id in ordered[1:]:
        other = hypotheses[best[effect_id]]
        limits = _sensitivity_of(linear, other, effect_id)
        low, high = np.maximum(limits.low, -PLAUSIBLE), np.minimum(limits.high, PLAUSIBLE)
        solved = lsq_linear(other.columns, change, bounds=(low, high)).x
        rest = np.linalg.norm(change - other.columns @ solved)
        if length > 0.0 and np.sqrt(max(0.0, 1.0 - (rest / length) ** 2)) > CONFOUNDED_COSINE:
            members.append(effect_id)
    return tuple(members)


def _refit(study: Study, linear: Linearisation) -> tuple[np.ndarray, dict[int, Fit]]:
    """Log Bayes factors (H,), refined by refits of the most probable hypotheses; the refits."""
    hypotheses, factors = linear.space.hypotheses, linear.space.log_bayes_factors.copy()
    freedom = study.noise.degrees_of_freedom
    base = _log_evidence(linear.fit, freedom)
    log_weights = factors + linear.space.log_prior
    order = [k for k in np.argsort(-log_weights) if hypotheses[k].effects or hypotheses[k].other]
    near = [k for k in order if log_weights[k] > log_weights[order[0]] - REFITTED_WITHIN]
    singles = [k for k in order if _is_single(hypotheses[k])]
    shapeless = [k for k in order if not hypotheses[k].effects]
    fits = {}
    for k in dict.fromkeys([*near[:MOST_REFITTED], *singles[:3], *shapeless[:2]]):
        fits[k] = _fit_hypothesis(study, linear, hypotheses[k])
        factors[k] = _log_evidence(fits[k], freedom) - base
    return factors, fits


def _best_alone(hypotheses: list[Hypothesis], factors: np.ndarray) -> dict[str, int]:
    """Number of the best hypothesis of each effect alone, best effect first."""
    found: dict[str, int] = {}
    for k in np.argsort(-factors, kind='stable'):
        if _is_single(hypotheses[k]):
            found.setdefault(hypotheses[k].effects[0], int(k))
    return found


def _needed(
    hypothesis: Hypothesis, factor: float, factors: np.ndarray, alone: dict[str, int]
) -> set[str]:
    """The effects without which the hypothesis explains less; all where none is indispensable."""
    needed = {
        effect_id
        for effect_id in hypothesis.effects
        for rest in set(hypothesis.effects) - {effect_id}
        if factor > factors[alone[rest]] + NEEDED
    }
    return needed or set(hypothesis.effects)


def _is_single(hypothesis: Hypothesis) -> bool:
    return len(hypothesis.effects) == 1 and not hypothesis.other


def _sensitivity_of(linear: Linearisation, hypothesis: Hypothesis, effect_id: str) -> Sensitivity:
    """The sensitivity to an effect in the shape that the hypothesis gives it."""
    return next(
        s
        for s in linear.sensitivities
        if s.id == effect_id and set(s.shape) <= set(hypothesis.shape)
    )


def _fit_hypothesis(study: Study, linear: Linearisation, hypothesis: Hypothesis) -> Fit:
    """Fit the model of a hypothesis, starting from the amplitudes of the linear approximation."""
    amplitudes = Evidence(hypothesis).posterior_mean(linear.null.deviation)
    start, used = linear.fit.model, 0
    for effect_id in hypothesis.effects:
        found = _sensitivity_of(linear, hypothesis, effect_id)
        info = type(found.effect).parameters()
        values = {}
        for name, amount in zip(found.names, amplitudes[used:], strict=False):
            wanted = info[name]['neutral'] + info[name]['typical'] * float(amount)
            values[name] = min(max(wanted, info[name]['low']), info[name]['high'])
        used += len(found.names)
        start = start.with_effect(found.effect.model_copy(update=values))
    shapeless = linear.null.lower @ hypothesis.columns[:, used:]
    nuisance = np.hstack([shapeless, study.nuisance])
    return study.fit(FreeParameters.of(start, *start.effects), nuisance=nuisance)


def _log_evidence(fit: Fit, freedom: float) -> float:
    """Laplace's approximation; the pattern's priors are the same in every model."""
    marginal, misfit = fit.marginal, fit.objective
    if np.isfinite(freedom):
        count = freedom + len(fit.residual)
        value = -0.5 * count * np.log1p(misfit / freedom)
    else:
        value = -0.5 * misfit
    value -= 0.5 * (np.linalg.slogdet(marginal.precision)[1] + fit.nuisance_log_det)
    low, high = fit.parameters.bounds
    spread = np.sqrt(np.diag(marginal.covariance))
    for k in range(len(PATTERN), len(fit.vector)):
        if low[k] >= 0.0 or high[k] <= 0.0:
            side = 1.0 if low[k] >= 0.0 else -1.0
            value += np.log(2.0) + norm.logcdf(side * fit.vector[k] / spread[k])
    return float(value)
