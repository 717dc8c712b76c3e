"""Everything that may be missing, weighed against each other."""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from paint_deposition.diagnosis.discrepancy import PATTERN_DEVIATIONS, SIZES
from paint_deposition.diagnosis.evidence import (
    BaseSpace,
    Hypothesis,
    Judge,
    log_sum,
    simulated,
)
from paint_deposition.diagnosis.sensitivities import Signature

# Probabilities before the readings: half that nothing is missing, the rest by kind. No measured
# pattern is exactly a pair of Gaussians.
PRIOR = {'none': 0.5, 'one': 0.26, 'two': 0.06, 'unknown': 0.06, 'footprint': 0.08, 'mixed': 0.04}
DRAWS = 2000
# Pairs are made of the effects that explain most; the rest hardly matter.
PAIRED = 14
# Fields over the part that are weighed together with an effect.
MIXED_FIELDS = 2


@dataclass(frozen=True)
class Weighing:
    """The hypotheses with their evidence.

    Attributes:
        hypotheses: all of them; the first is that nothing is missing.
        log_factors: (H,) log Bayes factors against the first.
        p_value: probability of at least this much evidence if nothing were missing.
    """

    hypotheses: list[Hypothesis]
    log_factors: np.ndarray
    p_value: float

    @property
    def posterior(self) -> np.ndarray:
        """(H,) probability of each hypothesis."""
        return posterior(self.hypotheses, self.log_factors)


def posterior(hypotheses: list[Hypothesis], log_factors: np.ndarray) -> np.ndarray:
    """(H,) probabilities from log Bayes factors and priors."""
    log_weights = log_factors + np.log([h.prior for h in hypotheses])
    return np.exp(log_weights - log_sum(log_weights))


def weigh(
    base: BaseSpace,
    signatures: list[Signature],
    fields: list[np.ndarray],
    deviations: list[np.ndarray],
    freedom: float,
    seed: int,
) -> Weighing:
    """Weigh all hypotheses and test the first.

    Args:
        base: deviations with the base model's freedom taken out.
        signatures: of the effects, several shapes of one effect each on its own.
        fields: (P, n) square roots of the random fields' covariances, whitened by the noise.
        deviations: (P, n) pattern deviations of each kind, whitened by the noise.
        freedom: degrees of freedom behind the noise's size.
        seed: of the simulated deviations for the p-value.
    """
    count = len(base.deviation)
    nothing = Hypothesis((), np.empty((count, 0)), np.empty(0), '', PRIOR['none'])
    singles = _singles(base, signatures)
    shapeless = _shapeless(base, fields, deviations)
    tested = [*singles, *shapeless]
    evidence = [Judge(h, freedom).log_factor(base.deviation) for h in tested]
    best = _best_shapes(singles, np.array(evidence[: len(singles)]))
    pairs = _pairs(best)
    tested += pairs
    evidence += [Judge(h, freedom).log_factor(base.deviation) for h in pairs]
    mixed = _mixed(base, best, fields)
    beside = [Judge(h, freedom).log_factor(base.deviation) for h in mixed]
    return Weighing(
        [nothing, *tested, *mixed],
        np.array([0.0, *evidence, *beside]),
        _p_value(base, tested, np.array(evidence), freedom, seed),
    )


def _singles(base: BaseSpace, signatures: list[Signature]) -> list[Hypothesis]:
    ids = [s.id for s in signatures]
    effects = len(set(ids))
    return [
        Hypothesis(
            (s.id,),
            base.project(s.columns),
            s.sides,
            '',
            PRIOR['one'] / effects / ids.count(s.id),
            s.shape,
        )
        for s in signatures
    ]


def _shapeless(
    base: BaseSpace, fields: list[np.ndarray], deviations: list[np.ndarray]
) -> list[Hypothesis]:
    chosen = []
    projected = [base.project(field) for field in fields]
    for root, size in product(projected, SIZES):
        prior = PRIOR['unknown'] / (len(fields) * len(SIZES))
        chosen.append(_field((), size * root, 'unknown', prior))
    for kind, size in product(map(base.project, deviations), PATTERN_DEVIATIONS):
        prior = PRIOR['footprint'] / (len(deviations) * len(PATTERN_DEVIATIONS))
        chosen.append(_field((), size * kind, 'footprint', prior))
    return chosen


def _field(effects: tuple[str, ...], columns: np.ndarray, other: str, prior: float) -> Hypothesis:
    return Hypothesis(effects, columns, np.zeros(columns.shape[1]), other, prior)


def _best_shapes(singles: list[Hypothesis], evidence: np.ndarray) -> list[Hypothesis]:
    """The best shape of each effect, strongest effects first."""
    best: dict[str, Hypothesis] = {}
    for k in np.argsort(-evidence):
        best.setdefault(singles[k].effects[0], singles[k])
    return list(best.values())


def _pairs(best: list[Hypothesis]) -> list[Hypothesis]:
    couples = list(combinations(best[:PAIRED], 2))
    return [
        Hypothesis(
            (a.effects[0], b.effects[0]),
            np.hstack([a.columns, b.columns]),
            np.concatenate([a.sides, b.sides]),
            '',
            PRIOR['two'] / len(couples),
            a.shape + b.shape,
        )
        for a, b in couples
    ]


def _mixed(base: BaseSpace, best: list[Hypothesis], fields: list[np.ndarray]) -> list[Hypothesis]:
    chosen = best[:PAIRED]
    roots = [base.project(field) for field in fields[:MIXED_FIELDS]]
    prior = PRIOR['mixed'] / max(len(chosen) * len(roots) * len(SIZES), 1)
    return [
        Hypothesis(
            h.effects,
            np.hstack([h.columns, size * root]),
            np.concatenate([h.sides, np.zeros(root.shape[1])]),
            'unknown',
            prior,
            h.shape,
        )
        for h, root, size in product(chosen, roots, SIZES)
    ]


def _p_value(
    base: BaseSpace, tested: list[Hypothesis], evidence: np.ndarray, freedom: float, seed: int
) -> float:
    draws = simulated(len(base.deviation), freedom, DRAWS, seed)
    log_prior = np.log([h.prior for h in tested])
    by_chance = np.stack([Judge(h, freedom).log_factor(draws) for h in tested])
    null = log_sum(by_chance + log_prior[:, np.newaxis])
    observed = log_sum(evidence + log_prior)
    return float((1 + np.count_nonzero(null >= observed)) / (1 + DRAWS))
