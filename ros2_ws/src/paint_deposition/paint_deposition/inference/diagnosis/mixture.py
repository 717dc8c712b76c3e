"""What may be missing, whatever the size of what nature leaves over.

How large the remainder is and how far it reaches is not known before: every hypothesis is weighed
at several sizes, and its evidence is averaged over them. Sizes that neither the null hypothesis
nor any effect's law makes probable are left out.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from paint_deposition.inference.diagnosis.evidence import NullModel
from paint_deposition.inference.diagnosis.explanations import Explanation
from paint_deposition.inference.diagnosis.model_space import (
    DRAWS,
    LEAST_BESIDE,
    PRIOR,
    SIZES,
    SURE,
    Model,
    ModelSpace,
)
from paint_deposition.inference.fitting.remainder import Remainder

# So many sizes are kept at most, and none whose share of the posterior is smaller.
MOST, LEAST_SHARE = 4, 0.02
# Prior odds with which an effect's law counts when sizes are chosen.
LAW_ODDS = np.log(0.02)


class Mixture:
    def __init__(self, null: NullModel, remainder: Remainder, explanations: Sequence[Explanation],
                 freedom: float) -> None:
        self.plain, self.remainder, self.freedom = null, remainder, freedom
        chosen, log_null = _probable(null, remainder, explanations, freedom)
        self.sizes = [s for s, _, _ in chosen]
        self.spaces = [ModelSpace(n, explanations, freedom) for _, n, _ in chosen]
        weights = np.array([w for _, _, w in chosen])
        self.log_weights = weights - np.logaddexp.reduce(weights)
        self.log_null = log_null

    @property
    def log_evidence(self) -> float:
        """Log evidence of the null model at all sizes, with or without an unknown cause."""
        log_unknown = np.logaddexp.reduce([
            w + m.log_weight for space, w in zip(self.spaces, self.log_weights, strict=True)
            for m in space._alone if m.causes == ('unknown',)
        ])
        return float(self.log_null + np.logaddexp(0.0, log_unknown))

    # -- the central one, for what needs no average
    @property
    def central(self) -> ModelSpace:
        return self.spaces[int(np.argmax(self.log_weights))]

    @property
    def of_parts(self) -> np.ndarray:
        return self.remainder.of_parts(self.sizes[int(np.argmax(self.log_weights))])

    @property
    def null(self): return self.central.null
    @property
    def explanations(self): return self.spaces[0].explanations
    @property
    def causes(self): return self.spaces[0].causes
    @property
    def principal(self): return self.central.principal

    @cached_property
    def models(self) -> tuple[Model, ...]:
        found: dict[tuple[str, ...], list[Model]] = {}
        for k, (space, log_weight) in enumerate(zip(self.spaces, self.log_weights, strict=True)):
            for model in space.models:
                found.setdefault(model.causes, []).append(replace(model, log_weight=model.log_weight + float(log_weight), at=k))
        joined = []
        for models in found.values():
            best = max(models, key=lambda m: m.log_weight)
            joined.append(replace(best, log_weight=float(np.logaddexp.reduce([m.log_weight for m in models]))))
        return tuple(sorted(joined, key=lambda m: -m.log_weight))

    probabilities = cached_property(ModelSpace.probabilities.func)
    inclusion = ModelSpace.inclusion
    alternatives = ModelSpace.alternatives
    group = ModelSpace.group
    is_shapeless = ModelSpace.is_shapeless

    def against_nothing(self, cause): return self.central.against_nothing(cause)

    def best_law(self, cause):
        return max((s.best_law(cause) for s in self.spaces), key=lambda f: f[2])

    def amplitudes(self, model):
        return self.spaces[model.at].amplitudes(model)

    @cached_property
    def accepted(self):
        best = self.models[0]
        if not best.causes:
            return []
        own = self.spaces[best.at].principal
        amounts = self.amplitudes(best)
        moved = {c: own[k].length(part) ** 2 for c, k, part in zip(best.causes, best.chosen, amounts, strict=True)}
        least = LEAST_BESIDE * max((moved[c] for c in best.causes if c in PRIOR), default=0.0)
        return [(c, k, s) for c, k, s in zip(best.causes, best.chosen, best.sizes, strict=True)
                if c not in PRIOR and moved[c] >= least and self.group(c)[1] > SURE]

    def select(self, rows):
        new = object.__new__(Mixture)
        new.plain, new.remainder, new.freedom, new.sizes = self.plain, self.remainder, self.freedom, self.sizes
        new.spaces = [s.select(rows) for s in self.spaces]
        w = np.array([_null_log_evidence(s.null, self.freedom) + z.log_prior for s, z in zip(new.spaces, self.sizes)])
        new.log_weights = w - np.logaddexp.reduce(w)
        return new

    def p_value(self, seed: int) -> float:
        found = self._statistic(self.spaces[0].null.raw[:, np.newaxis])[0]
        return float((1 + np.count_nonzero(self._by_chance(seed) >= found)) / (1 + DRAWS))

    def _by_chance(self, seed):
        random = np.random.default_rng(seed)
        counts = random.multinomial(DRAWS, np.exp(self.log_weights))
        parts = []
        for space, n in zip(self.spaces, counts):
            eps = random.normal(size=(len(space.null.raw), n))
            if np.isfinite(self.freedom):
                eps /= np.sqrt(random.chisquare(self.freedom, n) / self.freedom)
            parts.append(space.null.lower @ eps)
        return self._statistic(np.hstack(parts))

    def _statistic(self, raw):
        terms, nulls = [], []
        for space, size in zip(self.spaces, self.sizes):
            dev = space.null.whiten(raw)
            null = _null_log(space.null, np.sum(dev**2, axis=0), self.freedom) + size.log_prior
            nulls.append(null); terms.append(null + space.evidence(dev))
        return np.logaddexp.reduce(terms) - np.logaddexp.reduce(nulls)

    def null_evidence(self, seed): return self.central.null_evidence(seed)
    def null_draws(self, seed): return self.central.null_draws(seed)
    def evidence(self, *a, **k): return self.central.evidence(*a, **k)


def _null_log(null, square, freedom):
    log_det = 2.0 * np.log(np.diag(null.lower)).sum()
    if np.isfinite(freedom):
        return -0.5 * log_det - 0.5 * (freedom + len(null.raw)) * np.log1p(square / freedom)
    return -0.5 * (log_det + square)


def _null_log_evidence(null, freedom):
    return float(_null_log(null, null.deviation @ null.deviation, freedom))


def _probable(null, remainder, explanations, freedom):
    laws = [e.sensitivity.columns for e in explanations if e.sensitivity is not None]
    columns = np.hstack(laws) if laws else np.zeros((len(null.raw), 0))
    tried = []
    for sizes in remainder.sizes():
        given = NullModel.of(np.hstack([null.columns, remainder.columns(sizes)]), null.raw)
        weight = _null_log_evidence(given, freedom) + sizes.log_prior
        white = given.whiten(columns)
        score, square = white.T @ given.deviation, np.sum(white**2, axis=0)
        total = given.deviation @ given.deviation
        best = [weight]
        for size in SIZES:
            precision = 1.0 + size**2 * square
            explained = size**2 * score**2 / precision
            if np.isfinite(freedom):
                gain = -0.5 * (freedom + len(given.raw)) * np.log1p(-explained / (freedom + total))
            else:
                gain = 0.5 * explained
            best.append(weight + LAW_ODDS + np.max(gain - 0.5 * np.log(precision), initial=-np.inf))
        tried.append((sizes, given, weight, float(np.logaddexp.reduce(best))))
    tried.sort(key=lambda t: -t[3])
    total = np.logaddexp.reduce([t[3] for t in tried])
    kept = [t for t in tried[:MOST] if t[3] - total > np.log(LEAST_SHARE)] or tried[:1]
    log_null = float(np.logaddexp.reduce([t[2] for t in tried]))
    return [(s, n, w) for s, n, w, _ in kept], log_null
