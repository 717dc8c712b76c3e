"""The search for the set of missing effects, decided by the evidence of refitted models.

The evidence of what may be missing beside a model is linear around its fit, which is quick and
good enough to propose. What is accepted is decided between models that were refitted, each with
the remainder of nature at all its sizes, and with or without something unknown beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.inference.diagnosis.evidence import NullModel
from paint_deposition.inference.diagnosis.explanations import UNKNOWN
from paint_deposition.inference.diagnosis.model_space import (
    CREDIBLE,
    PRIOR_EFFECT,
    SURE,
    ModelSpace,
    inclusion_of,
    log_odds,
)
from paint_deposition.inference.diagnosis.run import Run
from paint_deposition.inference.fitting.least_squares import Fit

# So many effects are added at most, and so many proposals are refitted each time.
MOST_EFFECTS, TRIALS = 4, 5
# Effects that could stand in one place, most probable first, and the probability of one of them.
Group = tuple[tuple[str, ...], float]


@dataclass(frozen=True)
class Trial:
    """A set of effects with the model refitted to them.

    Attributes:
        names: of the effects.
        fit: of the model with them.
        space: what may be missing beside it.
        log_weight: logarithm of its evidence, with its prior odds.
    """

    run: Run
    names: frozenset[str]
    fit: Fit

    @property
    def effects(self) -> dict[str, Effect]:
        """Those of the set, as fitted."""
        return {effect.id: effect for effect in self.run.candidates_in(self.fit)}

    @cached_property
    def null(self) -> NullModel:
        """The model as the null hypothesis, without a remainder; its laws may be off."""
        return self.run.null(self.fit)

    @cached_property
    def log_weight(self) -> float:
        """Logarithm of the posterior weight of this set."""
        return self.run.log_evidence(self.null) + log_odds(PRIOR_EFFECT) * len(self.names)

    @cached_property
    def space(self) -> ModelSpace:
        """What may be missing beside it."""
        return self.run.space(self.fit, self.null)

    @cached_property
    def proposed(self) -> tuple[str, ...]:
        """Effects that may be missing beside it, the most probable first."""
        return tuple(cause for cause in self.space.alone if cause != UNKNOWN)[:TRIALS]

    def log_weight_of(self, rows: np.ndarray) -> float:
        """The same with some of the readings (P,), at the best size of the remainder."""
        best = max(self.run.weighed(self.null), key=lambda one: one.log_weight)
        some = best.null.select(rows)
        freedom = self.run.study.noise.degrees_of_freedom
        evidence = some.log_evidence(some.deviation[:, np.newaxis], freedom)[0]
        return float(evidence + best.sizes.log_prior + log_odds(PRIOR_EFFECT) * len(self.names))


@dataclass(frozen=True)
class Stage:
    """One step of the search: a set of effects, and larger ones that were tried."""

    here: Trial
    tried: Sequence[Trial]

    def chosen(self, rows: np.ndarray | None = None) -> Trial:
        """The set that the readings, or some (P,), call for: one that was tried, or this."""

        def weight(trial: Trial) -> float:
            return trial.log_weight if rows is None else trial.log_weight_of(rows)

        weights = [weight(trial) for trial in self.tried]
        if not weights or inclusion_of(weights, weight(self.here)) <= SURE:
            return self.here
        return self.tried[int(np.argmax(weights))]


class Search:
    """Sets of effects that were refitted so far."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self._trials: dict[frozenset[str], Trial] = {}
        self.nothing = self._refitted({})

    def with_effect(self, parent: Trial, name: str) -> Trial:
        """A set with one effect more, whose first amplitudes are those of its law alone."""
        names = parent.names | {name}
        if names not in self._trials:
            self._refitted(parent.effects | {name: parent.space.by_law(name)})
        return self._trials[names]

    def without(self, trial: Trial, name: str) -> Trial:
        """A set with one effect less."""
        names = trial.names - {name}
        if names not in self._trials:
            self._refitted({n: e for n, e in trial.effects.items() if n != name})
        return self._trials[names]

    def _refitted(self, effects: dict[str, Effect]) -> Trial:
        fit = self.run.fitted_with(list(effects.values())) if effects else self.run.fit
        names = frozenset(effects)
        self._trials[names] = Trial(self.run, names, fit)
        return self._trials[names]

    def stages(self) -> list[Stage]:
        """From nothing to the best set, each with one effect more than the one before."""
        found, here = [], self.nothing
        while True:
            room = len(here.names) < MOST_EFFECTS
            tried = [self.with_effect(here, name) for name in here.proposed if room]
            found.append(Stage(here, tried))
            best = found[-1].chosen()
            if best is here:
                return found
            here = best

    def groups(self, trial: Trial) -> tuple[Trial, dict[str, Group]]:
        """The set without effects that do not stand, and what could stand in place of each."""
        while True:
            found = {name: self.group(trial, name) for name in trial.names}
            if not found or min(p for _, p in found.values()) > SURE:
                return trial, found
            trial = self.without(trial, min(found, key=lambda name: found[name][1]))

    def group(self, trial: Trial, name: str) -> Group:
        """The effects that could stand in place of one, and how probable one of them is."""
        others = self.without(trial, name)
        rivals = dict.fromkeys((name, *others.proposed))
        weights = {rival: self.with_effect(others, rival).log_weight for rival in rivals}
        total = float(np.logaddexp.reduce([*weights.values()]))
        members, share = [], 0.0
        for cause, weight in sorted(weights.items(), key=lambda item: -item[1]):
            if share >= CREDIBLE:
                break
            members.append(cause)
            share += float(np.exp(weight - total))
        return tuple(members), inclusion_of([total], others.log_weight)
