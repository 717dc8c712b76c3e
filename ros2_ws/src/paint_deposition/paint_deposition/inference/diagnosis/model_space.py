"""The space of models: every set of up to three causes, with its posterior probability.

Each cause is missing or not, independently of the others before the readings. A cause has several
explanations (laws in a few shapes, free laws, fields) at several sizes; their evidence is averaged
for one cause alone and, for sets, searched from the best ones on.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit

from paint_deposition.inference.diagnosis.evidence import NullModel, Principal, simulated
from paint_deposition.inference.diagnosis.explanations import FOOTPRINT, UNKNOWN, Explanation
from paint_deposition.inference.diagnosis.joint_evidence import (
    NEVER,
    Directions,
    log_evidence_of_each,
    refine,
)

# Prior probability that a cause is missing: an effect of the library, something outside it, and
# a pattern that is no two Gaussians. No measured pattern is exactly one.
PRIOR_EFFECT, PRIOR = 0.02, {UNKNOWN: 0.08, FOOTPRINT: 0.06}
# Sizes of the amplitudes, times their typical ones: what is typical is known to within a factor.
SIZES = np.array([0.35, 0.7, 1.4, 2.8, 5.6])
# How many sets are searched in full: pairs, pairs from which triples grow, and triples.
PAIRS, GROWN, TRIPLES = 60, 12, 20
SWEEPS = 2
# An effect acts for certain from this posterior probability of its group on.
SURE = 0.8
# Probability that a group holds the cause, if one of the alternatives is it.
CREDIBLE = 0.95
DRAWS = 2000
# Effects that could stand in one place, most probable first, and the probability of one of them.
Group = tuple[tuple[str, ...], float]
# The error of a law is at most this large beside the law; a smaller one, in standard deviations
# of the noise, may be noise.
LARGEST_ERROR, NOTICED = 0.6, 3.0
# An effect beside a stronger shapeless cause acts only if it moves the readings by this share of
# what the other does (squared): no shapeless cause is known more exactly.
LEAST_BESIDE = 0.04


@dataclass(frozen=True)
class Model:
    """A set of causes with their best explanations.

    Attributes:
        causes: names, sorted.
        chosen: numbers of their explanations. sizes: of their amplitudes.
        log_weight: logarithm of its posterior weight, that of no cause being 0.
    """

    causes: tuple[str, ...]
    chosen: tuple[int, ...] = ()
    sizes: tuple[float, ...] = ()
    log_weight: float = 0.0


class ModelSpace:
    """All models around a null model.

    Args:
        null: the null hypothesis.
        explanations: of all causes.
        freedom: degrees of freedom of the noise estimate.
    """

    def __init__(
        self, null: NullModel, explanations: Sequence[Explanation], freedom: float
    ) -> None:
        self.null, self.freedom = null, freedom
        self._simulated: dict[int, np.ndarray] = {}
        # By how much a cause's averaged log evidence, with its odds, exceeds that of its best.
        self._averaging: dict[str, float] = {}
        self.explanations = sorted(explanations, key=lambda e: e.cause)
        self.causes = tuple(dict.fromkeys(e.cause for e in self.explanations))
        names = [e.cause for e in self.explanations]
        self._first = np.array([names.index(c) for c in self.causes])
        self._last = np.append(self._first[1:], len(names))
        self.principal = [Principal.of(null.whiten(e.columns), e.sides) for e in self.explanations]
        self._directions = Directions.of(self.principal, null.deviation, freedom)
        shares = np.log([e.share / len(SIZES) for e in self.explanations])
        self._log_share = np.repeat(shares[:, np.newaxis], len(SIZES), axis=1)
        physical = np.array([self._physical_sizes(k) for k in range(len(names))])
        self._log_share_alone = np.where(physical, self._log_share, NEVER)
        odds = np.array([PRIOR.get(c, PRIOR_EFFECT) for c in self.causes])
        self._log_odds = np.log(odds / (1.0 - odds))

    @cached_property
    def models(self) -> tuple[Model, ...]:
        """The models that matter, most probable first."""
        alone = {model.causes[0]: model for model in self._alone}
        pairs = [_joined(*pair) for pair in combinations(self._alone, 2)]
        pairs = [self._refined(m) for m in self._most_probable(pairs, PAIRS)]
        grown = {
            tuple(sorted((*pair.causes, cause))): _joined(pair, single)
            for pair in self._most_probable(pairs, GROWN)
            for cause, single in alone.items()
            if cause not in pair.causes
        }
        triples = [self._refined(m) for m in self._most_probable(grown.values(), TRIPLES)]
        found = [Model((), (), (), 0.0), *self._alone, *pairs, *triples]
        return tuple(sorted(found, key=lambda m: -m.log_weight))

    @cached_property
    def probabilities(self) -> np.ndarray:
        """Posterior probability of each of ``models``."""
        weights = np.array([m.log_weight for m in self.models])
        return np.exp(weights - np.logaddexp.reduce(weights))

    def inclusion(self, *causes: str) -> float:
        """Posterior probability that at least one of these causes acts."""
        holds = [bool(set(causes) & set(m.causes)) for m in self.models]
        return float(self.probabilities[holds].sum())

    def against_nothing(self, cause: str) -> float:
        """Posterior probability of one cause against none, if both were as probable before."""
        number = self.causes.index(cause)
        return float(expit(self._alone[number].log_weight - self._log_odds[number]))

    def alternatives(self, cause: str) -> dict[str, float]:
        """What could stand in the place of one cause beside the others of its best model.

        The causes and their probabilities, which sum to one, all other causes being as they are;
        this is the single-effect posterior of Wang et al. (JRSS-B 82, 2020). Empty where the
        other causes are as many as a model can hold.
        """
        best = next((m for m in self.models if cause in m.causes), self.models[0])
        others = set(best.causes) - {cause}
        found: dict[str, float] = {}
        for model, probability in zip(self.models, self.probabilities, strict=True):
            if len(model.causes) == len(others) + 1 and others < set(model.causes):
                (other,) = set(model.causes) - others
                found[other] = found.get(other, 0.0) + float(probability)
        total = sum(found.values())
        return {name: value / total for name, value in sorted(found.items(), key=lambda i: -i[1])}

    def group(self, cause: str) -> Group:
        """The effects that could stand in the place of a cause, and how probable one of them is.

        The most probable ones that together have a chance of 95 % among all alternatives; what is
        no effect of the library is none of them.
        """
        members, total = [], 0.0
        for name, probability in self.alternatives(cause).items():
            if total >= CREDIBLE:
                break
            total += probability
            members.append(name)
        effects = tuple(name for name in members if name not in PRIOR)
        return effects, self.inclusion(*effects) if effects else 0.0

    @property
    def is_shapeless(self) -> bool:
        """Whether the most probable model has a cause from outside the library."""
        return bool(PRIOR.keys() & set(self.models[0].causes))

    def best_law(self, cause: str) -> tuple[int, float, float]:
        """The explanation of an effect by its law, its size and log evidence, if it acts alone."""
        first, last = self._first[self.causes.index(cause)], self._last[self.causes.index(cause)]
        laws = [k for k in range(first, last) if self.explanations[k].sensitivity is not None]
        values = self._factors_alone[laws]
        k, s = np.unravel_index(values.argmax(), values.shape)
        return laws[k], float(SIZES[s]), float(values[k, s])

    def _physical_sizes(self, k: int) -> np.ndarray:
        """(S,) whether an explanation, alone at each size, is what its cause can be."""
        return self._is_physical(k, self.principal[k].amplitudes(self.null.deviation, SIZES))

    def _is_physical(self, k: int, amounts: np.ndarray) -> np.ndarray:
        """(...) whether an explanation with amplitudes (..., n) is what its cause can be.

        The error of a law stays small beside the law, and a free law goes in its direction.
        """
        explanation, own = self.explanations[k], self.principal[k]
        if explanation.sensitivity is None:
            return explanation.goes_right(amounts)
        of_law = len(explanation.sensitivity.names)
        law = own.length(amounts, slice(of_law))
        error = own.length(amounts, slice(of_law, None))
        return error <= np.maximum(NOTICED, LARGEST_ERROR * law)

    @cached_property
    def accepted(self) -> list[tuple[str, int, float]]:
        """Causes of the most probable model that act with some certainty.

        Each with the number of its explanation and the size of its amplitudes.
        """
        best = self.models[0]
        if not best.causes:
            return []
        amounts, own = self.amplitudes(best), self.principal
        moved = {
            cause: own[k].length(part) ** 2
            for cause, k, part in zip(best.causes, best.chosen, amounts, strict=True)
        }
        least = LEAST_BESIDE * max((moved[c] for c in best.causes if c in PRIOR), default=0.0)
        return [
            (cause, k, size)
            for cause, k, size in zip(best.causes, best.chosen, best.sizes, strict=True)
            if cause not in PRIOR and moved[cause] >= least and self.group(cause)[1] > SURE
        ]

    def select(self, rows: np.ndarray) -> 'ModelSpace':
        """The space that some of the readings (P,) bool give, explanations in the same order."""
        few = [explanation.select(rows) for explanation in self.explanations]
        return ModelSpace(self.null.select(rows), few, self.freedom)

    def amplitudes(self, model: Model) -> list[np.ndarray]:
        """Posterior mean amplitudes of each of a model's explanations, in their own units."""
        along = self._directions.amplitudes(model.chosen, model.sizes)
        own = (self.principal[k].axes for k in model.chosen)
        return [axes @ part for axes, part in zip(own, along, strict=True)]

    def p_value(self, seed: int) -> float:
        """Probability of at least this much evidence for any cause if none acted.

        By simulation (Davison & Hinkley 1997) of the averaged evidence of all causes, which is
        computed for every draw as for the readings: nothing is chosen on the readings.
        """
        found = self.evidence(self.null.deviation[:, np.newaxis])[0]
        return float((1 + np.count_nonzero(self.null_evidence(seed) >= found)) / (1 + DRAWS))

    def null_evidence(self, seed: int) -> np.ndarray:
        """(DRAWS,) simulated evidence if no cause acted."""
        if seed not in self._simulated:
            self._simulated[seed] = self.evidence(self.null_draws(seed))
        return self._simulated[seed]

    def null_draws(self, seed: int) -> np.ndarray:
        """(P, DRAWS) whitened deviations behind ``null_evidence``."""
        return simulated(len(self.null.deviation), self.freedom, DRAWS, seed)

    def evidence(
        self,
        deviations: np.ndarray,
        chosen: Iterable[int] | None = None,
        shifts: np.ndarray | None = None,
    ) -> np.ndarray:
        """(D,) log evidence that any cause acts, averaged, for whitened deviations (P, D).

        Args:
            deviations: of the readings, or simulated.
            chosen: numbers of explanations; default: all.
            shifts: (P, R), each of which is added to all deviations: R times as many.
        """
        terms = []
        for k in range(len(self.explanations)) if chosen is None else chosen:
            explanation = self.explanations[k]
            odds = self._log_odds[self.causes.index(explanation.cause)]
            share = np.log(explanation.share / len(SIZES))
            terms.append(np.logaddexp.reduce(self._by_size(k, deviations, shifts)) + share + odds)
        return np.logaddexp.reduce(terms)

    def _by_size(
        self, k: int, deviations: np.ndarray, shifts: np.ndarray | None = None
    ) -> np.ndarray:
        """(S, D) log Bayes factors of one explanation at every size, for (P, D) deviations."""
        return self.principal[k].log_bayes_factors(deviations, SIZES, self.freedom, shifts)

    @cached_property
    def _factors_alone(self) -> np.ndarray:
        """(K, S) log Bayes factors of each explanation alone at every size."""
        shape = len(self.explanations), len(SIZES)
        chosen = np.repeat(np.arange(shape[0]), shape[1])[:, np.newaxis]
        sizes = np.tile(SIZES, shape[0])[:, np.newaxis]
        return log_evidence_of_each(self._directions, chosen, sizes).reshape(shape)

    @cached_property
    def _alone(self) -> list[Model]:
        """One cause each: its evidence averaged, and its best explanation."""
        found = []
        for number, cause in enumerate(self.causes):
            numbers = range(self._first[number], self._last[number])
            factors = self._factors_alone[numbers]
            values = factors + self._log_share_alone[numbers]
            k, s = np.unravel_index(values.argmax(), values.shape)
            weight = float(np.logaddexp.reduce(values, axis=None)) + self._log_odds[number]
            any_form = factors + self._log_share[numbers]
            best = factors.flat[any_form.argmax()]
            self._averaging[cause] = (
                float(np.logaddexp.reduce(any_form, axis=None)) + self._log_odds[number] - best
            )
            found.append(Model((cause,), (numbers[k],), (float(SIZES[s]),), weight))
        return found

    def _most_probable(self, models: Iterable[Model], count: int) -> list[Model]:
        """The best ones, weighed with the explanations that they have."""
        all_models = list(models)
        if not all_models:
            return []
        evidence = log_evidence_of_each(
            self._directions,
            np.array([model.chosen for model in all_models]),
            np.array([model.sizes for model in all_models]),
        )
        weights = [
            value + sum(self._averaging[c] for c in model.causes)
            for value, model in zip(evidence, all_models, strict=True)
        ]
        best = np.argsort(-np.array(weights), kind='stable')[:count]
        return [replace(all_models[k], log_weight=float(weights[k])) for k in best]

    def _refined(self, model: Model) -> Model:
        """The same causes with the explanations and sizes that are best together."""
        numbers = np.array([self.causes.index(c) for c in model.causes])
        # Beside other effects an explanation may be physical that is not so alone; beside what has
        # no shape it would be too easily.
        shares = (self._log_share, self._log_share_alone)
        for log_share in shares[1:] if PRIOR.keys() & set(model.causes) else shares:
            chosen, sizes = np.array(model.chosen), np.array(model.sizes)
            refine(
                self._directions, log_share, self._first[numbers], self._last[numbers], SIZES,
                chosen, sizes, SWEEPS,
            )  # fmt: skip
            amounts = self.amplitudes(Model(model.causes, tuple(chosen), tuple(sizes)))
            allowed = log_share[chosen, np.searchsorted(SIZES, sizes)].min() > NEVER
            if allowed and all(map(self._is_physical, chosen, amounts)):
                break
        else:
            return replace(model, log_weight=NEVER)
        weight = self._log_evidence(chosen, sizes)
        alone = {m.causes[0]: m for m in self._alone}
        for cause, k in zip(model.causes, chosen, strict=True):
            best = self.explanations[alone[cause].chosen[0]]
            weight += self._averaging[cause]
            weight += np.log(self.explanations[k].share / best.share)
        return Model(model.causes, tuple(map(int, chosen)), tuple(map(float, sizes)), weight)

    def _log_evidence(self, chosen: ArrayLike, sizes: ArrayLike) -> float:
        together = np.atleast_2d(chosen), np.atleast_2d(sizes)
        return float(log_evidence_of_each(self._directions, *together)[0])


def _joined(first: Model, second: Model) -> Model:
    """The causes of both with the explanations of both, sorted by cause."""
    members = sorted(
        zip(
            (*first.causes, *second.causes),
            (*first.chosen, *second.chosen),
            (*first.sizes, *second.sizes),
            strict=True,
        )
    )
    causes, chosen, sizes = zip(*members, strict=True)
    return Model(causes, chosen, sizes)
