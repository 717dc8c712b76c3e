"""The search for the set of missing effects, decided by the evidence of refitted models.

The evidence of what may be missing beside a model is linear around its fit, which is quick and
good enough to propose. What is accepted is decided between models that were refitted, each with
the remainder of nature at all its sizes, and with or without something unknown beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import softmax

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.diagnosis.evidence import NullModel
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, law_errors, of_effects
from paint_deposition.inference.diagnosis.learning import Nulls
from paint_deposition.inference.diagnosis.model_space import (
    COARSENED,
    CREDIBLE,
    PRIOR_EFFECT,
    PRIOR_UNKNOWN,
    SIZES,
    SURE,
    ModelSpace,
    Weighed,
    inclusion_of,
    log_odds,
    probable_sizes,
)
from paint_deposition.inference.diagnosis.remainder import Remainder, Sizes
from paint_deposition.inference.diagnosis.run import Run
from paint_deposition.inference.diagnosis.testability import testability
from paint_deposition.inference.fitting.least_squares import Fit

# So many effects are added at most, and so many proposals are refitted each time.
MOST_EFFECTS, TRIALS = 4, 5
# An effect is there by its law, off by so much as laws are, or by a law much further off: how many
# times as far, and the prior share of each.
LAWS_OFF = ((1.0, 0.7), (3.0, 0.3))
# Log evidence that two fits of one set may differ by and be the same.
SAME = 0.5
# Log evidence of an effect beyond which the pattern that was fitted without it is no guide.
MISLEADS = 12.0
# Effects that could stand in one place, most probable first, and the probability of one of them.
Group = tuple[tuple[str, ...], float]


@dataclass(frozen=True)
class Trial:
    """A set of effects with the model refitted to them.

    Attributes:
        names: of the effects.
        fit: of the model with them, what nature leaves over being allowed for.
        usual: what nature leaves over beside the model that the run began with.
        sizes: of the remainder that matter.
    """

    run: Run
    names: frozenset[str]
    fit: Fit
    usual: Remainder
    sizes: Sequence[Sizes]

    @staticmethod
    def around(run: Run, names: frozenset[str], fit: Fit) -> 'Trial':
        """A set, and what nature leaves over around its own fit, at the sizes that matter."""
        usual = Remainder.of(run.study, fit)
        laws = [*of_effects(run.study, fit, run.candidates)]
        sizes = probable_sizes(run.plain(fit), usual, laws, run.freedom)
        return Trial(run, names, fit, usual, sizes)

    @property
    def effects(self) -> dict[str, Effect]:
        """Those of the set, as fitted."""
        return {effect.id: effect for effect in self.run.candidates_in(self.fit)}

    @cached_property
    def remainder(self) -> Remainder:
        """What nature leaves over beside the model."""
        return self.usual.around(self.run.study, self.fit)

    @cached_property
    def weighed(self) -> list[Weighed]:
        """The model as the null hypothesis, its laws being off, with each size of remainder."""
        study, freedom = self.run.study, self.run.freedom
        errors = law_errors(study, self.fit, self.names, self.usual.model)
        found = []
        for times, share in LAWS_OFF if errors.any() else ((1.0, 1.0),):
            null = NullModel.around(self.fit, np.hstack([study.nuisance, times * errors]))
            found += [
                Weighed.of(null, self.remainder, sizes, freedom, share) for sizes in self.sizes
            ]
        return found

    @cached_property
    def best(self) -> Weighed:
        """That with nature's most probable remainder."""
        nature = (one for one in self.weighed if not one.sizes.is_beyond_nature)
        return max(nature, key=lambda one: one.log_weight)

    def nulls(self, fit: Fit) -> Nulls:
        """What laws that are learned must say more than.

        Args:
            fit: of the model with the set.
        """
        sizes, plain = self.best.sizes, self.run.plain(fit)
        correction = plain.with_remainder(self.remainder.covariance(sizes))
        off = law_errors(self.run.study, fit, self.names, self.usual.model)
        footprint = plain.with_remainder(self.remainder.of_parts(sizes)).beside(off)
        return Nulls(footprint, correction, correction.beside(off) if off.size else correction)

    @cached_property
    def log_weight(self) -> float:
        """Logarithm of the posterior weight of this set, something unknown acting or not."""
        run = self.run
        space = ModelSpace(self.weighed, run.any_form, self.remainder, run.freedom)
        return space.log_evidence + self.log_prior

    @cached_property
    def log_weight_alone(self) -> float:
        """The same weight if nothing unknown can act."""
        return self.log_evidence_alone + self.log_prior

    @cached_property
    def log_evidence_alone(self) -> float:
        """Its evidence then, whatever the prior of the set."""
        nature = [one.log_weight for one in self.weighed if not one.sizes.is_beyond_nature]
        return float(np.logaddexp.reduce(nature))

    @property
    def log_prior(self) -> float:
        """Logarithm of the prior odds of this set, its amplitudes being of any of the sizes.

        The fit takes each as normal with its typical size as the standard deviation.
        """
        entries = self.fit.parameters.of_effects
        amounts = self.fit.vector[len(self.fit.vector) - len(entries) :]
        found = log_odds(PRIOR_EFFECT) * len(self.names)
        for name in self.names:
            own = [amount for amount, entry in zip(amounts, entries, strict=True)
                   if entry.effect == name and not entry.is_shape]  # fmt: skip
            by_size = 0.5 * np.sum(np.square(own)) * (1.0 - SIZES**-2.0) - len(own) * np.log(SIZES)
            found += float(np.logaddexp.reduce(by_size)) - np.log(len(SIZES))
        return found

    @cached_property
    def space(self) -> ModelSpace:
        """What may be missing beside it."""
        run = self.run
        effects = of_effects(run.study, self.fit, run.candidates)
        found = [*effects, *run.any_form]
        return ModelSpace(self.weighed, found, self.remainder, run.freedom)

    @cached_property
    def proposed(self) -> tuple[str, ...]:
        """Effects that may be missing beside it, the most probable first."""
        return tuple(cause for cause in self.space.alone if cause != UNKNOWN)[:TRIALS]

    def log_weight_of(self, rows: np.ndarray) -> float:
        """The same weight with some of the readings (P,), at the best size of the remainder."""
        some = self.best.null.select(rows)
        evidence = some.log_evidence(some.deviation[:, np.newaxis], self.run.freedom)[0]
        return float(evidence + self.best.sizes.log_prior + self.log_prior)


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
            return trial.log_weight_alone if rows is None else trial.log_weight_of(rows)

        weights = [weight(trial) for trial in self.tried]
        if not weights or inclusion_of(weights, weight(self.here)) <= SURE:
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
            for pattern in (parent.fit.model, *self._patterns):
                self._refitted(effects, parent, pattern)
        return self._trials[names]

    def without(self, trial: Trial, *names: str) -> Trial:
        """A set with some effects less, refitted from where the larger one has its pattern.

        A pattern has several shapes that fit about as well: what only led to a better one is no
        effect.
        """
        fewer = {n: e for n, e in trial.effects.items() if n not in names}
        return self._refitted(fewer, trial)

    def _refitted(
        self, effects: dict[str, Effect], start: Trial, pattern: DepositionModel | None = None
    ) -> Trial:
        """A set fitted beside the remainder of another one, from its pattern or this one."""
        remainder, model = start.best.null.remainder, pattern or start.fit.model
        fit = self.run.fitted_with([*effects.values()], model=model, remainder=remainder)
        trial = replace(start, names=frozenset(effects), fit=fit)
        known = self._trials.get(trial.names)
        if known is None or trial.log_weight_alone > known.log_weight_alone + SAME:
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
        best = max(tried, key=lambda one: one.log_weight_alone, default=nothing)
        if best.log_evidence_alone <= nothing.log_evidence_alone + MISLEADS:
            return nothing
        others = self.run.fitted_from_many_starts([*best.effects.values()])
        anew = [Trial.around(self.run, best.names, fit) for fit in (best.fit, others)]
        best = max(anew, key=lambda one: one.log_evidence_alone)
        self._trials, self._tried = {best.names: best}, set()
        self._patterns = (nothing.fit.model,)
        for start in (replace(nothing, usual=best.usual, sizes=best.sizes), best):
            self.nothing = self._refitted({}, start)
        return self.nothing

    def _in_another_pattern(self, stage: Stage) -> Trial:
        """The set of a stage, where a larger one has led to a pattern that suits it better."""
        here = stage.here
        for trial in sorted(stage.tried, key=lambda one: -one.log_weight_alone):
            gain = trial.log_evidence_alone - here.log_evidence_alone
            again = self.without(trial, *(trial.names - here.names)) if gain > SAME else here
            if again is not here:
                self._tried = {names for names in self._tried if not names > here.names}
                return again
        return here

    def beside(self, trial: Trial) -> dict[str, float]:
        """Effects that may act beside a set, with their probabilities if one at the most does."""
        for name in trial.proposed:
            self.with_effect(trial, name)
        larger = [t for t in self._trials.values() if len(t.names - trial.names) == 1]
        larger = [t for t in larger if t.names > trial.names]
        weights = {name: t.log_weight for t in larger for name in t.names - trial.names}
        shares = softmax(np.array([trial.log_weight, *weights.values()]) / COARSENED)[1:]
        found = dict(zip(weights, (1.0 - PRIOR_UNKNOWN) * shares, strict=True))
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
        shares = np.cumsum(softmax([weights[cause] / COARSENED for cause in found]))
        members = found[: int(np.searchsorted(shares, CREDIBLE)) + 1]
        return tuple(members), inclusion_of([*weights.values()], others.log_weight)
