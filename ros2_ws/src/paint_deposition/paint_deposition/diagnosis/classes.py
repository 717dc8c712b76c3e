"""Effects that the readings cannot tell apart, and how probable it is that one of them acts."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import norm

from paint_deposition.diagnosis.evidence import Hypothesis, Judge
from paint_deposition.diagnosis.hypotheses import posterior
from paint_deposition.diagnosis.judgement import Judgement
from paint_deposition.diagnosis.sensitivities import Signature
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.fitting.parameters import PATTERN, Unknowns
from paint_deposition.fitting.study import Study

# Effects whose marks on these readings are parallel to within this cosine are rivals.
ALIKE = 0.9
# ... with amplitudes up to this many times their typical size.
PLAUSIBLE = 4.0
# Hypotheses this far behind the best by the linear evidence are not refitted.
REFITTED_WITHIN = 7.0
MOST_REFITTED = 10
# An effect beside an unknown cause is the answer if it gives this share of their evidence.
SUFFICIENT = 0.75
WORTH_LISTING = 0.02
# An effect of a pair acts if it raises the pair's log evidence by this much.
NEEDED = 1.0


@dataclass(frozen=True)
class Candidate:
    """A class of effects with the refitted model of its best member.

    Attributes:
        members: ids, most probable first.
        probability: that one of them is missing.
        fit: of the model with the best member, each part at a level of its own.
    """

    members: tuple[str, ...]
    probability: float
    fit: Fit

    @property
    def best(self) -> str:
        """Id of the most probable member."""
        return self.members[0]


@dataclass(frozen=True)
class Ranking:
    """How probable each answer is; what is left of one is that nothing is missing.

    Attributes:
        classes: most probable first; as two may be missing, they may sum to more than one.
        named: probability that effects of the library explain it.
        unknown: probability that the library does not explain it.
        footprint: probability that the pattern itself deviates from eq. (1).
    """

    classes: tuple[Candidate, ...]
    named: float
    unknown: float
    footprint: float


def rank(study: Study, judged: Judgement) -> Ranking:
    """Refit the most probable hypotheses and sum probabilities by class.

    Args:
        study: the readings.
        judged: the model so far and the linear evidence around it.
    """
    hypotheses = judged.weighing.hypotheses
    factors, fits = _refit(study, judged)
    alone = _alone(hypotheses, factors)
    weights = posterior(hypotheses, factors)
    answers = np.array(
        [
            bool(h.effects)
            and (
                not h.other or max(factors[alone[e]] for e in h.effects) >= SUFFICIENT * factors[k]
            )
            for k, h in enumerate(hypotheses)
        ]
    )
    other = np.array([h.other for h in hypotheses])
    active = [_active(h, factors[k], factors, alone) for k, h in enumerate(hypotheses)]
    classes = []
    left = list(alone)
    while left:
        members = alike(judged, left)
        left = [effect_id for effect_id in left if effect_id not in members]
        holds = np.array([bool(set(members) & acting) for acting in active])
        probability = float(weights[holds & answers].sum())
        if probability >= WORTH_LISTING:
            first = alone[members[0]]
            near = fits.get(first) or _fit_with(study, judged, hypotheses[first])
            classes.append(Candidate(members, min(probability, 1.0), near))
    return Ranking(
        tuple(sorted(classes, key=lambda c: -c.probability)),
        float(weights[answers].sum()),
        float(weights[(other == 'unknown') & ~answers].sum()),
        float(weights[(other == 'footprint') & ~answers].sum()),
    )


def _refit(study: Study, judged: Judgement) -> tuple[np.ndarray, dict[int, Fit]]:
    """Evidence (H,), that of the most probable hypotheses by full refits, and those refits."""
    hypotheses = judged.weighing.hypotheses
    factors = judged.weighing.log_factors.copy()
    freedom = study.noise.degrees_of_freedom
    base = _log_evidence(judged.fit, freedom)
    weights = factors + np.log([h.prior for h in hypotheses])
    order = [k for k in np.argsort(-weights) if hypotheses[k].effects or hypotheses[k].other]
    near = [k for k in order if weights[k] > weights[order[0]] - REFITTED_WITHIN]
    singles = [k for k in order if _is_single(hypotheses[k])]
    shapeless = [k for k in order if not hypotheses[k].effects]
    fits = {}
    for k in dict.fromkeys([*near[:MOST_REFITTED], *singles[:3], *shapeless[:2]]):
        fits[k] = _fit_with(study, judged, hypotheses[k])
        factors[k] = _log_evidence(fits[k], freedom) - base
    return factors, fits


def _alone(hypotheses: list[Hypothesis], factors: np.ndarray) -> dict[str, int]:
    """Number of the best hypothesis of each effect alone, best effect first."""
    found: dict[str, int] = {}
    for k in np.argsort(-factors, kind='stable'):
        if _is_single(hypotheses[k]):
            found.setdefault(hypotheses[k].effects[0], int(k))
    return found


def _active(
    hypothesis: Hypothesis, factor: float, factors: np.ndarray, alone: dict[str, int]
) -> set[str]:
    """Effects that the hypothesis needs: of a pair in which one does all, only that one."""
    needed = {
        effect_id
        for effect_id in hypothesis.effects
        for rest in set(hypothesis.effects) - {effect_id}
        if factor > factors[alone[rest]] + NEEDED
    }
    return needed or set(hypothesis.effects)


def _is_single(hypothesis: Hypothesis) -> bool:
    return len(hypothesis.effects) == 1 and not hypothesis.other


def _mark(judged: Judgement, hypothesis: Hypothesis, effect_id: str) -> Signature:
    """The signature that stands for an effect of the hypothesis, in its shape."""
    return next(
        s for s in judged.signatures if s.id == effect_id and set(s.shape) <= set(hypothesis.shape)
    )


def _fit_with(study: Study, judged: Judgement, hypothesis: Hypothesis) -> Fit:
    """The model as the hypothesis has it, from where the linear evidence sees its effects."""
    amplitudes = Judge(hypothesis).amplitudes(judged.base.deviation)
    effects, used = [], 0
    for effect_id in hypothesis.effects:
        mark = _mark(judged, hypothesis, effect_id)
        info = type(mark.effect).parameters()
        values = {}
        for name, amount in zip(mark.names, amplitudes[used:], strict=False):
            wanted = info[name]['neutral'] + info[name]['typical'] * float(amount)
            values[name] = min(max(wanted, info[name]['low']), info[name]['high'])
        used += len(mark.names)
        effects.append(mark.effect.model_copy(update=values))
    start = judged.fit.model
    for effect in effects:
        start = start.with_effect(effect)
    free = judged.base.lower @ hypothesis.columns[:, used:]
    if study.levels is not None:
        free = np.hstack([free, study.levels])
    return study.fit(Unknowns.of(start, *start.effects), extra=free if free.size else None)


def _log_evidence(fit: Fit, freedom: float) -> float:
    """Laplace's approximation; the pattern's priors are the same in every model."""
    misfit = fit.chi_square + fit.penalty
    if np.isfinite(freedom):
        count = freedom + len(fit.residual)
        value = -0.5 * count * np.log1p(misfit / freedom)
    else:
        value = -0.5 * misfit
    value -= 0.5 * (np.linalg.slogdet(fit.precision)[1] + fit.extra_log_det)
    low, high = fit.unknowns.bounds
    spread = np.sqrt(np.diag(fit.covariance))
    for k in range(len(PATTERN), len(fit.vector)):
        if low[k] >= 0.0 or high[k] <= 0.0:
            side = 1.0 if low[k] >= 0.0 else -1.0
            value += np.log(2.0) + norm.logcdf(side * fit.vector[k] / spread[k])
    return float(value)


def alike(judged: Judgement, ordered: list[str]) -> tuple[str, ...]:
    """The first effect and those that could have left the same mark on these readings."""
    hypotheses = judged.weighing.hypotheses
    best = _alone(hypotheses, judged.weighing.log_factors)
    first = hypotheses[best[ordered[0]]]
    mark = first.columns @ Judge(first).amplitudes(judged.base.deviation)
    length = np.linalg.norm(mark)
    members = [ordered[0]]
    for effect_id in ordered[1:]:
        other = hypotheses[best[effect_id]]
        limits = _mark(judged, other, effect_id)
        low, high = np.maximum(limits.low, -PLAUSIBLE), np.minimum(limits.high, PLAUSIBLE)
        solved = lsq_linear(other.columns, mark, bounds=(low, high)).x
        rest = np.linalg.norm(mark - other.columns @ solved)
        if length > 0.0 and np.sqrt(max(0.0, 1.0 - (rest / length) ** 2)) > ALIKE:
            members.append(effect_id)
    return tuple(members)
