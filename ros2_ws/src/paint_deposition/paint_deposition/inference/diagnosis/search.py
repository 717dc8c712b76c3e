"""The search for the set of missing effects, decided by the evidence of refitted models.

The evidence of what may be missing beside a model is linear around its fit, which is quick and
good enough to propose. What is accepted is decided between models that were refitted, each with
the remainder of nature at all its sizes, and with or without something unknown beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import softmax

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.diagnosis.model_space import (
    CREDIBLE,
    SURE,
    inclusion_of,
)
from paint_deposition.inference.diagnosis.run import STARTS, Run
from paint_deposition.inference.diagnosis.testability import testability
from paint_deposition.inference.diagnosis.trial import Trial

# So many effects are added at most.
MOST_EFFECTS = 4
# Log evidence that two fits of one set may differ by and be the same.
SAME = 0.5
# Log evidence of an effect beyond which the pattern that was fitted without it is no guide.
MISLEADS = 12.0
# Effects that could stand in one place, most probable first, and the probability of one of them.
Group = tuple[tuple[str, ...], float]


@dataclass(frozen=True)
class Stage:
    """One step of the search: a set of effects, and larger ones that were tried.

    The search goes on as if nothing unknown could act: that follows several effects together more
    closely than the law of the first of them.
    """

    here: Trial
    tried: Sequence[Trial]

    def chosen(self, rows: np.ndarray | None = None) -> Trial:
        """The set that the readings, or some (P,), call for: one that was tried, or this."""

        def weight(trial: Trial) -> float:
            return trial.log_weight if rows is None else trial.log_weight_of(rows)

        weights = [weight(trial) for trial in self.tried]
        if not weights or inclusion_of(weights, [weight(self.here)]) <= SURE:
            return self.here
        return self.tried[int(np.argmax(weights))]


class Search:
    """Sets of effects that were refitted so far."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self._trials: dict[frozenset[str], Trial] = {}
        self._tried: set[frozenset[str]] = set()
        self._patterns: tuple[DepositionModel, ...] = ()
        self.nothing = self._refitted({}, Trial.around(run, frozenset(), run.fit))
        run.testable = testability(self.nothing.space.central, run.seed)

    def with_effect(self, parent: Trial, name: str) -> Trial:
        """A set with one effect more, whose first amplitudes are those of its law alone."""
        names = parent.names | {name}
        if names not in self._tried:
            self._tried.add(names)
            effects = parent.effects | {name: parent.space.by_law(name)}
            self._refitted(effects, parent, self._patterns)
        return self._trials[names]

    def without(self, trial: Trial, *names: str) -> Trial:
        """A set with some effects less, refitted from where the larger one has its pattern.

        A pattern has several shapes that fit about as well: what only led to a better one is no
        effect.
        """
        fewer = {n: e for n, e in trial.effects.items() if n not in names}
        return self._refitted(fewer, trial)

    def _refitted(
        self, effects: dict[str, Effect], start: Trial, others: Sequence[DepositionModel] = ()
    ) -> Trial:
        """A set fitted beside the remainder of another one, from its pattern or one of others."""
        model, remainder = start.fit.model, start.best.null.remainder
        fit = self.run.fitted_with(
            [*effects.values()], model=model, remainder=remainder, others=others
        )
        trial = replace(start, names=frozenset(effects), fit=fit)
        known = self._trials.get(trial.names)
        if known is None or trial.log_evidence > known.log_evidence + SAME:
            self._trials[trial.names] = trial
        return self._trials[trial.names]

    def stages(self) -> list[Stage]:
        """From nothing to the best set, each with one effect more than the one before."""
        found: list[Stage] = []
        here = self._around_the_best()
        while True:
            room = len(here.names) < MOST_EFFECTS
            stage = Stage(here, [self.with_effect(here, name) for name in here.proposed if room])
            again = self._in_another_pattern(stage)
            if again is not here:
                here = again
                continue
            best = stage.chosen()
            if best is here:
                return [*found, stage]
            found.append(stage)
            here = best

    def _around_the_best(self) -> Trial:
        """Nothing missing, with what nature leaves over around the best fit with one effect.

        The pattern that was fitted without a strong effect may be far from the true one, and the
        deviations of its footprint with it. All sets that are compared have the same.
        """
        nothing = self.nothing
        tried = [self.with_effect(nothing, name) for name in nothing.proposed]
        best = max(tried, key=lambda one: one.log_weight, default=nothing)
        if best.log_evidence <= nothing.log_evidence + MISLEADS:
            return nothing
        others = self.run.fitted_with(
            [*best.effects.values()], model=self.run.start, starts=STARTS
        )
        anew = [Trial.around(self.run, best.names, fit) for fit in (best.fit, others)]
        best = max(anew, key=lambda one: one.log_evidence)
        self._trials, self._tried = {best.names: best}, set()
        self._patterns = (nothing.fit.model,)
        for start in (replace(nothing, usual=best.usual, sizes=best.sizes), best):
            self.nothing = self._refitted({}, start)
        return self.nothing

    def _in_another_pattern(self, stage: Stage) -> Trial:
        """The set of a stage, where a larger one has led to a pattern that suits it better."""
        here = stage.here
        for trial in sorted(stage.tried, key=lambda one: -one.log_weight):
            gain = trial.log_evidence - here.log_evidence
            again = self.without(trial, *(trial.names - here.names)) if gain > SAME else here
            if again is not here:
                self._tried = {names for names in self._tried if not names > here.names}
                return again
        return here

    def beside(self, trial: Trial) -> dict[str, float]:
        """Effects that may act beside a set, with their probabilities if one at the most does."""
        for name in trial.proposed:
            self.with_effect(trial, name)
        weights = {
            name: larger.log_weight
            for names, larger in self._trials.items()
            if names > trial.names and len(names) == len(trial.names) + 1
            for name in names - trial.names
        }
        without = trial.log_weight, trial.log_weight_unknown
        shares = softmax([*without, *weights.values()])[len(without) :]
        found = dict(zip(weights, shares.tolist(), strict=True))
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def groups(self, trial: Trial) -> tuple[Trial, dict[str, Group]]:
        """The set without effects that do not stand, and what could stand in place of each.

        Here something unknown may have done it, too.
        """
        while True:
            found = {name: self.group(trial, name) for name in trial.names}
            better = [name for name, (members, _) in found.items() if members[0] != name]
            if better:
                others = self.without(trial, better[0])
                trial = self.with_effect(others, found[better[0]][0][0])
                continue
            if not found or min(p for _, p in found.values()) > SURE:
                return trial, found
            trial = self.without(trial, min(found, key=lambda name: found[name][1]))

    def group(self, trial: Trial, name: str) -> Group:
        """The effects that could stand in place of one, and how probable one of them is.

        None could whose model is less probable than the one without any.
        """
        others = self.without(trial, name)
        rivals = dict.fromkeys((name, *others.proposed))
        weights = {rival: self.with_effect(others, rival).log_weight for rival in rivals}
        found = sorted(weights, key=lambda cause: -weights[cause])
        found = [cause for cause in found if weights[cause] > others.log_weight] or [name]
        shares = np.cumsum(softmax([weights[cause] for cause in found]))
        members = found[: int(np.searchsorted(shares, CREDIBLE)) + 1]
        without = others.log_weight, others.log_weight_unknown
        return tuple(members), inclusion_of([*weights.values()], without)
