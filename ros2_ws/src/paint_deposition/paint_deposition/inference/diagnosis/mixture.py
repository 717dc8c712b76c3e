"""What may be missing, whatever the size of what nature leaves over.

How large the remainder is and how far it reaches is not known before: every hypothesis is weighed
at several sizes, and its evidence is averaged over them. Sizes that neither the null hypothesis
nor any effect's law makes probable are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from paint_deposition.inference.diagnosis.evidence import NullModel
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, Explanation
from paint_deposition.inference.diagnosis.model_space import (
    DRAWS,
    PRIOR_EFFECT,
    SIZES,
    Model,
    ModelSpace,
    Sets,
)
from paint_deposition.inference.diagnosis.remainder import Remainder, Sizes

# So many sizes are kept at most, and none whose share of the posterior is smaller.
MOST, LEAST_SHARE = 4, 0.02


class _Weighed(NamedTuple):
    """Sizes of the remainder, the null model with it, and the logarithm of its evidence."""

    sizes: Sizes
    null: NullModel
    log_weight: float


@dataclass(frozen=True)
class RemainderFigures:
    """What nature leaves over in a campaign, as far as its readings show it.

    Attributes:
        setting_share, part_share: by how much the film of a setting differs from any law, and
            parts of one setting from each other, as shares of the thickest film.
        length_m: over which neighbours differ alike [m].
        footprint_of_peak: largest deviation of the footprint from eq. (1), over its peak.
    """

    setting_share: float
    part_share: float
    length_m: float
    footprint_of_peak: float

    def __str__(self) -> str:
        setting, peak = 100.0 * self.setting_share, 100.0 * self.footprint_of_peak
        parts = f', parts painted alike by {100.0 * self.part_share:.1f} %'
        return (
            f'What no law explains: the film of a setting is off by {setting:.1f} % of its peak'
            f'{parts if self.part_share else ""}, alike over about {1e3 * self.length_m:.0f} mm; '
            f'the footprint differs from two Gaussians by {peak:.0f} % of its peak.'
        )


class Mixture(Sets):
    """The spaces of models at several sizes of the remainder, weighed by their evidence.

    Args:
        null: the null hypothesis without a remainder.
        remainder: what may be left over.
        explanations: of all causes.
        freedom: degrees of freedom of the noise estimate.
    """

    def __init__(
        self,
        null: NullModel,
        remainder: Remainder,
        explanations: Sequence[Explanation],
        freedom: float,
    ) -> None:
        self.remainder, self.freedom = remainder, freedom
        tried = []
        for sizes in remainder.choices():
            columns = np.hstack([null.columns, remainder.columns(sizes)])
            given = NullModel.of(columns, null.raw)
            weight = _log_evidence(given, freedom) + sizes.log_prior
            tried.append(_Weighed(sizes, given, weight))
        self._log_null = float(np.logaddexp.reduce([one.log_weight for one in tried]))
        self._of(_probable(tried, explanations, freedom), explanations)

    def _of(self, chosen: Sequence[_Weighed], explanations: Sequence[Explanation]) -> None:
        self.sizes = [one.sizes for one in chosen]
        self.spaces = [ModelSpace(one.null, explanations, self.freedom) for one in chosen]
        weights = np.array([one.log_weight for one in chosen])
        self.log_weights = weights - np.logaddexp.reduce(weights)

    def select(self, rows: np.ndarray) -> 'Mixture':
        """The mixture that some of the readings (P,) bool give, at the same sizes."""
        few = object.__new__(Mixture)
        few.remainder, few.freedom = self.remainder, self.freedom
        nulls = [space.null.select(rows) for space in self.spaces]
        chosen = [
            _Weighed(sizes, null, _log_evidence(null, self.freedom) + sizes.log_prior)
            for sizes, null in zip(self.sizes, nulls, strict=True)
        ]
        few._log_null = float(np.logaddexp.reduce([one.log_weight for one in chosen]))
        few._of(chosen, [explanation.select(rows) for explanation in self.explanations])
        return few

    @property
    def _best(self) -> int:
        return int(np.argmax(self.log_weights))

    @property
    def central(self) -> ModelSpace:
        """The space at the most probable sizes, for what needs no average."""
        return self.spaces[self._best]

    @property
    def explanations(self) -> Sequence[Explanation]:
        """Of all causes, in the order of all spaces."""
        return self.central.explanations

    @property
    def causes(self) -> tuple[str, ...]:
        """Their names."""
        return self.central.causes

    @property
    def of_parts(self) -> np.ndarray:
        """(P, n) remainder of parts and settings at the most probable sizes, over the noise."""
        return self.remainder.of_parts(self.sizes[self._best])

    @property
    def figures(self) -> RemainderFigures:
        """What is left over: sizes on average over their posterior, the footprint's mean."""
        share = np.exp(self.log_weights)
        sizes, null = self.sizes[self._best], self.central.null
        columns, of_peak = self.remainder.footprints[sizes.footprint]
        amplitudes = null.whiten(columns).T @ null.deviation
        return RemainderFigures(
            float(share @ [one.setting for one in self.sizes]),
            float(share @ [one.part for one in self.sizes]),
            float(share @ [self.remainder.lengths_m[one.length] for one in self.sizes]),
            float(np.abs(of_peak @ amplitudes).max()),
        )

    @property
    def log_evidence(self) -> float:
        """Log evidence of the null model at all sizes, with or without an unknown cause."""
        unknown = [
            weight + model.log_weight
            for space, weight in zip(self.spaces, self.log_weights, strict=True)
            for model in space.alone
            if model.causes == (UNKNOWN,)
        ]
        return float(self._log_null + np.logaddexp.reduce([0.0, *unknown]))

    @cached_property
    def models(self) -> tuple[Model, ...]:
        """The models that matter, most probable first, each with its best explanations."""
        found: dict[tuple[str, ...], list[Model]] = {}
        for number, space in enumerate(self.spaces):
            for model in space.models:
                weight = model.log_weight + float(self.log_weights[number])
                here = replace(model, log_weight=weight, at=number)
                found.setdefault(model.causes, []).append(here)
        joined = []
        for models in found.values():
            weight = float(np.logaddexp.reduce([model.log_weight for model in models]))
            best = max(models, key=lambda model: model.log_weight)
            joined.append(replace(best, log_weight=weight))
        return tuple(sorted(joined, key=lambda model: -model.log_weight))

    def best_law(self, cause: str) -> tuple[int, float, float]:
        """The explanation of an effect by its law, its size and log evidence, if it acts alone."""
        return max((space.best_law(cause) for space in self.spaces), key=lambda found: found[2])

    def amplitudes(self, model: Model) -> list[np.ndarray]:
        """Posterior mean amplitudes of each of a model's explanations, in their own units."""
        return self.spaces[model.at].amplitudes(model)

    def p_value(self, seed: int) -> float:
        """Probability of at least this much evidence for any cause if none acted.

        By simulation (Davison & Hinkley 1997) of the averaged evidence of all causes at all sizes,
        which is computed for every draw as for the readings: nothing is chosen on the readings.
        """
        random = np.random.default_rng(seed)
        draws = []
        for space, count in zip(
            self.spaces, random.multinomial(DRAWS, np.exp(self.log_weights)), strict=True
        ):
            noise = random.normal(size=(len(space.null.raw), count))
            if np.isfinite(self.freedom):
                noise /= np.sqrt(random.chisquare(self.freedom, count) / self.freedom)
            draws.append(space.null.lower @ noise)
        found = self._evidence(self.central.null.raw[:, np.newaxis])[0]
        by_chance = self._evidence(np.hstack(draws))
        return float((1 + np.count_nonzero(by_chance >= found)) / (1 + DRAWS))

    def _evidence(self, raw: np.ndarray) -> np.ndarray:
        """(D,) log evidence that any cause acts against none, for deviations (P, D)."""
        nulls, causes = [], []
        for space, sizes in zip(self.spaces, self.sizes, strict=True):
            deviations = space.null.whiten(raw)
            null = space.null.log_evidence(deviations, self.freedom) + sizes.log_prior
            nulls.append(null)
            causes.append(null + space.evidence(deviations))
        return np.logaddexp.reduce(causes) - np.logaddexp.reduce(nulls)


def _log_evidence(null: NullModel, freedom: float) -> float:
    return float(null.log_evidence(null.deviation[:, np.newaxis], freedom)[0])


def _probable(
    tried: Sequence[_Weighed], explanations: Sequence[Explanation], freedom: float
) -> list[_Weighed]:
    """The sizes that matter where nothing or any one law acts."""
    laws = [e.sensitivity.columns for e in explanations if e.sensitivity is not None]
    totals = np.array([one.log_weight for one in tried])
    if laws:
        columns, log_odds = np.hstack(laws), np.log(PRIOR_EFFECT)
        for k, (_, null, weight) in enumerate(tried):
            law = null.whiten(columns)
            score, square = law.T @ null.deviation, np.sum(law**2, axis=0)
            precision = 1.0 + np.multiply.outer(SIZES**2, square)
            explained = (SIZES**2)[:, np.newaxis] * score**2 / precision
            if np.isfinite(freedom):
                count, whole = freedom + len(null.raw), freedom + null.deviation @ null.deviation
                gain = -0.5 * count * np.log1p(-explained / whole)
            else:
                gain = 0.5 * explained
            best = float(np.max(gain - 0.5 * np.log(precision)))
            totals[k] = np.logaddexp(weight, weight + log_odds + best)
    order = np.argsort(-totals)[:MOST]
    least = np.logaddexp.reduce(totals) + np.log(LEAST_SHARE)
    return [tried[k] for k in order if totals[k] > least] or [tried[order[0]]]
