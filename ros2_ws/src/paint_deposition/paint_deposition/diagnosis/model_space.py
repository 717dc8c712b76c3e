"""The model space: every hypothesis about what is missing, with prior, evidence and posterior."""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from scipy.special import logsumexp

from paint_deposition.diagnosis.discrepancy import PATTERN_DEVIATIONS, SIZES
from paint_deposition.diagnosis.evidence import (
    Evidence,
    Hypothesis,
    NullModel,
    simulated,
)
from paint_deposition.diagnosis.sensitivities import Sensitivity

# Prior probabilities: half that nothing is missing, the rest by kind. No measured pattern is
# exactly a pair of Gaussians.
PRIOR = {'none': 0.5, 'one': 0.26, 'two': 0.06, 'unknown': 0.06, 'footprint': 0.08, 'mixed': 0.04}
DRAWS = 2000
# Pairs are formed of this many effects with the highest evidence; other pairs hardly matter.
PAIRED = 14
# Random fields over the part that are considered beside an effect.
MIXED_FIELDS = 2


@dataclass(frozen=True)
class ModelSpace:
    """All hypotheses with their evidence.

    Attributes:
        hypotheses: the first is the null hypothesis that nothing is missing.
        log_bayes_factors: (H,) against the null hypothesis.
        p_value: probability of at least this much evidence under the null hypothesis.
    """

    hypotheses: list[Hypothesis]
    log_bayes_factors: np.ndarray
    p_value: float

    @staticmethod
    def of(
        null: NullModel,
        sensitivities: list[Sensitivity],
        fields: list[np.ndarray],
        deviations: list[np.ndarray],
        freedom: float,
        seed: int,
    ) -> 'ModelSpace':
        """Compute the evidence of all hypotheses and test the null hypothesis.

        Args:
            null: the null hypothesis, with the deviations of the readings.
            sensitivities: to the effects; each shape of an effect is a hypothesis of its own.
            fields: (P, n) square roots of the random fields' covariances, over the noise.
            deviations: (P, n) pattern deviations of each kind, over the noise.
            freedom: degrees of freedom of the noise estimate.
            seed: of the simulated deviations for the p-value.
        """
        nothing = Hypothesis(
            (), np.empty((len(null.deviation), 0)), np.empty(0), '', PRIOR['none']
        )
        singles = _singles(null, sensitivities)
        tested = [Evidence(h, freedom) for h in singles]
        best = _best_shapes(singles, _log_bayes_factors(tested, null))
        more = [*_shapeless(null, fields, deviations), *_pairs(best)]
        tested += [Evidence(h, freedom) for h in more]
        mixed = _mixed(null, best, fields)
        untested = [Evidence(h, freedom) for h in mixed]
        return ModelSpace(
            [nothing, *singles, *more, *mixed],
            np.concatenate([[0.0], _log_bayes_factors([*tested, *untested], null)]),
            _p_value(tested, null, freedom, seed),
        )

    def posterior(self, log_bayes_factors: np.ndarray | None = None) -> np.ndarray:
        """(H,) probability of each hypothesis, for its own or for refined log Bayes factors."""
        factors = self.log_bayes_factors if log_bayes_factors is None else log_bayes_factors
        log_weights = factors + self.log_prior
        return np.exp(log_weights - logsumexp(log_weights))

    @property
    def log_prior(self) -> np.ndarray:
        """(H,) logarithm of the prior probabilities."""
        return np.log([h.prior for h in self.hypotheses])


def _log_bayes_factors(evidence: list[Evidence], null: NullModel) -> np.ndarray:
    return np.array([float(e.log_bayes_factor(null.deviation)) for e in evidence])


def _singles(null: NullModel, sensitivities: list[Sensitivity]) -> list[Hypothesis]:
    ids = [s.id for s in sensitivities]
    effects = len(set(ids))
    return [
        Hypothesis(
            (s.id,),
            null.whiten(s.columns),
            s.sides,
            '',
            PRIOR['one'] / effects / ids.count(s.id),
            s.shape,
        )
        for s in sensitivities
    ]


def _shapeless(
    null: NullModel, fields: list[np.ndarray], deviations: list[np.ndarray]
) -> list[Hypothesis]:
    chosen = []
    for root, size in product(map(null.whiten, fields), SIZES):
        prior = PRIOR['unknown'] / (len(fields) * len(SIZES))
        chosen.append(_field(size * root, 'unknown', prior))
    for kind, size in product(map(null.whiten, deviations), PATTERN_DEVIATIONS):
        prior = PRIOR['footprint'] / (len(deviations) * len(PATTERN_DEVIATIONS))
        chosen.append(_field(size * kind, 'footprint', prior))
    return chosen


def _field(columns: np.ndarray, other: str, prior: float) -> Hypothesis:
    return Hypothesis((), columns, np.zeros(columns.shape[1]), other, prior)


def _best_shapes(singles: list[Hypothesis], evidence: np.ndarray) -> list[Hypothesis]:
    """The shape of each effect with the highest evidence, effects in order of evidence."""
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


def _mixed(null: NullModel, best: list[Hypothesis], fields: list[np.ndarray]) -> list[Hypothesis]:
    chosen = best[:PAIRED]
    roots = [null.whiten(field) for field in fields[:MIXED_FIELDS]]
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


def _p_value(tested: list[Evidence], null: NullModel, freedom: float, seed: int) -> float:
    """Monte-Carlo p-value of the evidence of all hypotheses together (Davison & Hinkley 1997)."""
    draws = simulated(len(null.deviation), freedom, DRAWS, seed)
    log_prior = np.log([e.hypothesis.prior for e in tested])
    by_chance = np.stack([e.log_bayes_factor(draws) for e in tested])
    under_null = logsumexp(by_chance + log_prior[:, np.newaxis], axis=0)
    observed = logsumexp(_log_bayes_factors(tested, null) + log_prior)
    return float((1 + np.count_nonzero(under_null >= observed)) / (1 + DRAWS))
