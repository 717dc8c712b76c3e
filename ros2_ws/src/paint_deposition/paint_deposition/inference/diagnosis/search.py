"""The search for the set of missing effects, decided by the evidence of refitted models.

The evidence of what may be missing beside a model is linear around its fit, which is quick and
good enough to propose. What is accepted is decided between models that were refitted, each with
the remainder at all its sizes, and with or without something unknown beside it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import expit

from paint_deposition.effects.base import Effect
from paint_deposition.inference.diagnosis.mixture import Mixture
from paint_deposition.inference.diagnosis.model_space import (
    CREDIBLE,
    PRIOR,
    PRIOR_EFFECT,
    SURE,
    Group,
    Model,
)
from paint_deposition.inference.diagnosis.run import Run
from paint_deposition.inference.fitting.least_squares import Fit

# So many effects are added at most, and so many proposals are refitted each time.
MOST_EFFECTS, TRIALS = 4, 5
LOG_ODDS = float(np.log(PRIOR_EFFECT / (1.0 - PRIOR_EFFECT)))


@dataclass(frozen=True)
class Trial:
    """A set of effects with the model refitted to them.

    Attributes:
        names: of the effects. effects: as fitted.
        log_weight: logarithm of its evidence, with its prior odds.
    """

    run: Run
    names: frozenset[str]
    fit: Fit
    log_weight: float

    @property
    def effects(self) -> dict[str, Effect]:
        """Those of the set, as fitted."""
        return {effect.id: effect for effect in self.run.candidates_in(self.fit)}

    @cached_property
    def space(self) -> Mixture:
        """What may be missing beside them."""
        return self.run.linearise(self.fit)


class Search:
    """Sets of effects that were refitted so far."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self._trials: dict[frozenset[str], Trial] = {}
        self.nothing = self._refitted({})

    def trial(self, parent: Trial, *added: str) -> Trial:
        """A set with some more effects, whose first amplitudes are those of their laws alone."""
        names = parent.names | set(added)
        if names not in self._trials:
            more = {name: by_law_alone(parent.space, name) for name in added}
            self._refitted(parent.effects | more)
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
        weight = self.run.log_evidence(fit) + LOG_ODDS * len(effects)
        self._trials[names] = Trial(self.run, names, fit, weight)
        return self._trials[names]

    def path(self) -> list[Trial]:
        """From nothing to the best set, each with more effects than the one before."""
        found = [self.nothing]
        while len(found[-1].names) < MOST_EFFECTS:
            here = found[-1]
            tried = [self.trial(here, *names) for names in self._proposed(here)]
            if not tried:
                break
            weights = np.array([one.log_weight for one in tried])
            if expit(np.logaddexp.reduce(weights) - here.log_weight) <= SURE:
                break
            found.append(tried[int(weights.argmax())])
        return found

    def _proposed(self, trial: Trial) -> list[tuple[str, ...]]:
        space = trial.space
        free = [c for c in space.causes if c not in PRIOR]
        likely = sorted(free, key=lambda c: -space.inclusion(c))[:TRIALS]
        alone = sorted(free, key=lambda c: -space.best_law(c)[2])[:TRIALS]
        room = MOST_EFFECTS - len(trial.names)
        sets = [tuple(c for c in m.causes if c not in PRIOR) for m in space.models[: 2 * TRIALS]]
        together = [names for names in sets if 1 < len(names) <= room][:2]
        return list(dict.fromkeys([*((c,) for c in [*likely, *alone]), *together]))

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
        rivals = [names[0] for names in self._proposed(others) if len(names) == 1]
        tried = {c: self.trial(others, c).log_weight for c in dict.fromkeys([name, *rivals])}
        total = np.logaddexp.reduce(list(tried.values()))
        members, share = [], 0.0
        for cause, weight in sorted(tried.items(), key=lambda item: -item[1]):
            if share >= CREDIBLE:
                break
            members.append(cause)
            share += float(np.exp(weight - total))
        return tuple(members), float(expit(total - others.log_weight))


def by_law_alone(space: Mixture, cause: str) -> Effect:
    """An effect with the amplitudes that its law has if nothing else is missing."""
    k, size, _ = space.best_law(cause)
    law = space.explanations[k].sensitivity
    assert law is not None
    (amplitudes,) = space.amplitudes(Model((cause,), (k,), (size,)))
    return law.with_amplitudes(amplitudes[: len(law.names)])
