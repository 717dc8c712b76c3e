"""The search for the set of missing effects, decided by the evidence of refitted models.

The evidence of what may be missing beside a model is linear around its fit, which is quick and
good enough to propose. What is accepted is decided between models that were refitted, each with
the discrepancy of nature at all its sizes, and with or without something unknown beside it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import softmax

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.diagnosis.discrepancy import (
    DiscrepancyHyperparameters,
    ModelDiscrepancy,
)
from paint_deposition.inference.diagnosis.explanations import (
    UNKNOWN,
    of_effects,
    ways_off,
)
from paint_deposition.inference.diagnosis.gaussian import NullModel
from paint_deposition.inference.diagnosis.model_space import (
    COARSENED,
    CREDIBLE,
    PRIOR_EFFECT,
    SURE,
    SURE_BESIDE,
    ModelSpace,
    WeightedNull,
    best_amplitude_sizes,
    gain_of_sizes,
    inclusion_of,
    log_odds,
    probable_hyperparameters,
)
from paint_deposition.inference.diagnosis.state import STARTS, DiagnosisState
from paint_deposition.inference.diagnosis.verdict import Step
from paint_deposition.inference.fitting.least_squares import Fit

# So many effects are tried beside an effect.
TRIALS = 5
# Around so many of the single effects that fit best another pattern and a second effect are tried.
LEADING = 3
# Log evidence that two fits of one set may differ by and be the same.
SAME = 0.5
# Log evidence of an effect beyond which the pattern that was fitted without it is no guide.
MIN_LOG_EVIDENCE_GAIN = 12.0
# Odds that something outside the library acts just as an effect of it would: of the effects named
# with certainty, in campaigns of which a fifth hid something else, about a tenth were not there.
ALIKE = 0.1
# An effect alone in its group that is less probable, and makes the error on parts left out so many
# times as large, is none: of real sprays a gauge zero of -6 um was.
SETTLED, MOST_WORSE = 0.9, 1.15
# Effects that could stand in one place, most probable first, and the probability of one of them.
Group = tuple[tuple[str, ...], float]


@dataclass(frozen=True)
class EffectSet:
    """A set of effects with the model refitted to them."""

    state: DiagnosisState
    names: frozenset[str]  # of the effects
    fit: Fit  # of the model with them, the discrepancy being allowed for
    discrepancy: ModelDiscrepancy  # around the one fit that all compared sets share
    sizes: Sequence[DiscrepancyHyperparameters]  # of the discrepancy that matter

    @staticmethod
    def around(state: DiagnosisState, names: frozenset[str], fit: Fit) -> 'EffectSet':
        """A set, and the discrepancy around its own fit, at the sizes that matter."""
        discrepancy = ModelDiscrepancy.of(state.study, fit)
        laws = [*of_effects(state.study, fit, state.candidates)]
        plain = NullModel.around(fit, state.study.nuisance)
        sizes = probable_hyperparameters(plain, discrepancy, laws, state.freedom)
        return EffectSet(state, names, fit, discrepancy, sizes)

    @property
    def effects(self) -> dict[str, Effect]:
        """The effects of the set, as fitted."""
        return {effect.id: effect for effect in self.state.candidates_in(self.fit)}

    @cached_property
    def result(self) -> Fit:
        """The pattern and the effects fitted to the readings alone, from either pattern."""
        return self.state.fitted_with(
            [*self.effects.values()],
            self.fit.model,
            others=(self.state.fit.model,),
            amplitude_sizes=self.fit.parameters.amplitude_sizes,
        )

    @cached_property
    def error_um(self) -> float:
        """Of the result on parts left out, refitted without them [um]."""
        return Step.of(self.state.study, '', self.result).holdout_rmse_um

    @cached_property
    def weighed(self) -> list[WeightedNull]:
        """The model as the null hypothesis, its laws being off, with each size of discrepancy."""
        study, freedom = self.state.study, self.state.freedom
        found = []
        for columns, share in ways_off(study, self.fit, self.names, self.discrepancy.model):
            null = NullModel.around(self.fit, np.hstack([study.nuisance, columns]))
            found += [
                WeightedNull.of(null, self.discrepancy, sizes, freedom, share)
                for sizes in self.sizes
            ]
        return found

    @cached_property
    def best(self) -> WeightedNull:
        """The null hypothesis with nature's most probable discrepancy."""
        nature = (one for one in self.weighed if not one.sizes.is_beyond_nature)
        return max(nature, key=lambda one: one.log_weight)

    def told_in(self, state: DiagnosisState) -> DiagnosisState:
        """A state with the discrepancy beside this set, and its figures."""
        return replace(state, figures=self.space.figures, discrepancy=self.best.null.discrepancy)

    @cached_property
    def p_values(self) -> tuple[float, float]:
        """Of causes, and of fields on the parts, if nothing acted; see ``ModelSpace``."""
        return self.space.p_values(self.state.seed)

    @cached_property
    def log_weight(self) -> float:
        """Logarithm of the posterior weight of this set, nothing unknown acting."""
        return self.log_evidence + self.log_prior

    @cached_property
    def of_unknown(self) -> ModelSpace:
        """What is outside the library and may be missing beside it."""
        state = self.state
        return ModelSpace(self.weighed, state.nonparametric_laws, self.discrepancy, state.freedom)

    @cached_property
    def log_evidence(self) -> float:
        """Its evidence, nothing unknown acting, the amplitudes being of any of the sizes.

        The fit takes each as normal with one size as the standard deviation.
        """
        nature = [one.log_weight for one in self.weighed if not one.sizes.is_beyond_nature]
        return float(np.logaddexp.reduce(nature)) + self._gain_of_sizes

    @cached_property
    def _gain_of_sizes(self) -> float:
        return gain_of_sizes(self.fit, self.names, self.state.freedom)

    @property
    def log_prior(self) -> float:
        """Logarithm of the prior odds of this set."""
        return log_odds(PRIOR_EFFECT) * len(self.names)

    @cached_property
    def space(self) -> ModelSpace:
        """What may be missing beside it."""
        state = self.state
        effects = of_effects(state.study, self.fit, state.candidates)
        found = [*effects, *state.nonparametric_laws]
        return ModelSpace(self.weighed, found, self.discrepancy, state.freedom)

    @cached_property
    def proposed(self) -> tuple[str, ...]:
        """Effects to try beside it, the most probable first; of single ones all.

        A pattern that was fitted without any may imitate the one that acts.
        """
        causes = [cause for cause in self.space.alone if cause != UNKNOWN]
        return tuple(causes[: TRIALS if self.names else None])

    def log_weight_of(self, rows: np.ndarray) -> float:
        """Logarithm of the weight by some readings (P,), at the best sizes of the discrepancy.

        The laws may be off in every way.
        """
        there = [one for one in self.weighed if one.sizes == self.best.sizes]
        weights = [one.select(rows, self.state.freedom).log_weight for one in there]
        evidence = float(np.logaddexp.reduce(weights))
        return evidence + self._gain_of_sizes + self.log_prior


@dataclass(frozen=True)
class SearchStage:
    """One step of the search: a set of effects, and larger ones that were tried.

    The search goes on as if nothing unknown could act: that follows several effects together more
    closely than the law of the first of them.
    """

    here: EffectSet
    tried: Sequence[EffectSet]

    def chosen(self, rows: np.ndarray | None = None) -> EffectSet:
        """The set that the readings, or some (P,), call for: one that was tried, or this."""
        here, *weights = (
            one.log_weight if rows is None else one.log_weight_of(rows)
            for one in (self.here, *self.tried)
        )
        if not weights or inclusion_of(weights, [here]) <= SURE:
            return self.here
        return self.tried[int(np.argmax(weights))]


class Search:
    """Sets of effects that were refitted so far."""

    def __init__(self, state: DiagnosisState) -> None:
        self.state = state
        self._trials: dict[frozenset[str], EffectSet] = {}
        self._tried: set[frozenset[str]] = set()
        self._patterns: tuple[DepositionModel, ...] = ()
        self.nothing = self._refitted({}, EffectSet.around(state, frozenset(), state.fit))

    def with_effect(self, parent: EffectSet, name: str) -> EffectSet:
        """A set with one effect more, whose first amplitudes are those of its law alone."""
        names = parent.names | {name}
        if names not in self._tried:
            self._tried.add(names)
            effects = parent.effects | {name: parent.space.by_law(name)}
            # A set that is there was fitted from these patterns.
            others = () if names in self._trials else self._patterns
            self._refitted(effects, parent, others)
        return self._trials[names]

    def without(self, trial: EffectSet, *names: str) -> EffectSet:
        """A set with some effects less, refitted from where the larger one has its pattern.

        A pattern has several shapes that fit about as well: what only led to a better one is no
        effect.
        """
        fewer = {n: e for n, e in trial.effects.items() if n not in names}
        return self._refitted(fewer, trial)

    def _refitted(
        self, effects: dict[str, Effect], start: EffectSet, others: Sequence[DepositionModel] = ()
    ) -> EffectSet:
        """A set fitted beside the discrepancy of another, from its pattern or one of others."""
        model, discrepancy = start.fit.model, start.best.null.discrepancy
        fit = self.state.fitted_with(
            [*effects.values()], model, discrepancy=discrepancy, others=others
        )
        trial = replace(start, names=frozenset(effects), fit=fit)
        sizes = best_amplitude_sizes(fit, effects, self.state.freedom)
        if any(size != 1.0 for size in sizes.values()):
            fit = self.state.fitted_with(
                [*trial.effects.values()],
                fit.model,
                discrepancy=discrepancy,
                amplitude_sizes=sizes,
            )
            trial = replace(trial, fit=fit)
        known = self._trials.get(trial.names)
        if known is None or trial.log_evidence > known.log_evidence + SAME:
            self._trials[trial.names] = trial
        return self._trials[trial.names]

    def stages(self) -> list[SearchStage]:
        """From nothing to the best set, each with one effect more than the one before."""
        found: list[SearchStage] = []
        here = self._near_best()
        while True:
            room = len(here.names) < 4  # so many effects at the most
            proposals = here.proposed if room else ()
            stage = SearchStage(here, [self.with_effect(here, name) for name in proposals])
            again = self._in_another_pattern(stage)
            if again is not here:
                here = again
                continue
            if not here.names and stage.chosen() is not here:
                # Two effects together: alone, each of them may fit worse than a third one.
                leading = sorted(stage.tried, key=lambda one: -one.log_weight)[:LEADING]
                pairs = [self.with_effect(one, name) for one in leading for name in one.proposed]
                stage = replace(stage, tried=[*stage.tried, *pairs])
            best = stage.chosen()
            if best is here:
                return [*found, stage]
            found.append(stage)
            here = best

    def _near_best(self) -> EffectSet:
        """Nothing missing, with the discrepancy around the best fit with one effect.

        The pattern that was fitted without a strong effect may be far from the true one, and the
        deviations of its footprint with it. All sets that are compared have the same.
        """
        nothing = self.nothing
        tried = {name: self.with_effect(nothing, name) for name in nothing.proposed}
        order = sorted(tried, key=lambda name: -tried[name].log_weight)
        least = nothing.log_evidence + MIN_LOG_EVIDENCE_GAIN
        near: list[EffectSet] = []
        for one in (tried[name] for name in order[:LEADING]):
            if one.log_evidence > least:
                anew = self.state.fitted_with(
                    [*one.effects.values()], self.state.start, starts=STARTS,
                    amplitude_sizes=one.fit.parameters.amplitude_sizes,
                )  # fmt: skip
                near += [EffectSet.around(self.state, one.names, fit) for fit in (one.fit, anew)]
        if not near:
            return nothing
        best = max(near, key=lambda one: one.log_evidence)
        self._trials, self._tried = {best.names: best}, set()
        self._patterns = (nothing.fit.model, *(one.fit.model for one in near))
        for start in (replace(nothing, discrepancy=best.discrepancy, sizes=best.sizes), best):
            self.nothing = self._refitted({}, start)
        return self.nothing

    def _in_another_pattern(self, stage: SearchStage) -> EffectSet:
        """The set of a stage, where a larger one has led to a pattern that suits it better."""
        here = stage.here
        for trial in sorted(stage.tried, key=lambda one: -one.log_weight):
            gain = trial.log_evidence - here.log_evidence
            again = self.without(trial, *(trial.names - here.names)) if gain > SAME else here
            if again is not here:
                self._tried = {names for names in self._tried if not names > here.names}
                return again
        return here

    def beside(self, trial: EffectSet, something: bool) -> dict[str, float]:
        """Effects that may act beside a set, with their probabilities if one at the most does.

        Where the test has shown that ``something`` acts and the set is empty, one does.
        """
        for name in trial.proposed:
            self.with_effect(trial, name)
        larger = {
            name: one
            for names, one in self._trials.items()
            if names > trial.names and len(names) == len(trial.names) + 1
            for name in names - trial.names
        }
        odds = self._log_odds(trial, larger)
        if trial.names or not something:
            odds[''] = 0.0  # nothing more
        shares = softmax([*odds.values()]).tolist()
        found = {n: p for n, p in zip(odds, shares, strict=True) if n not in (UNKNOWN, '')}
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def groups(self, trial: EffectSet) -> tuple[EffectSet, dict[str, Group]]:
        """The set without effects that do not stand, and what could stand in place of each.

        Here something unknown may have done it, too. What an effect is remains as it was judged
        beside one that something unknown replaces.
        """
        judged: dict[str, tuple[str, ...]] = {}
        while True:
            found = {name: self.group(trial, name) for name in trial.names}
            found = {n: (judged.get(n, members), p) for n, (members, p) in found.items()}
            better = [name for name, (members, _) in found.items() if members[0] != name]
            if better:
                others = self.without(trial, better[0])
                trial = self.with_effect(others, found[better[0]][0][0])
                continue
            if not found:
                return trial, found
            weakest = min(found, key=lambda name: found[name][1])
            if found[weakest][1] > (SURE_BESIDE if len(found) > 1 else SURE):
                doubted = [n for n, (like, p) in found.items() if p < SETTLED and like == (n,)]
                fewer = {n: self.without(trial, n).error_um for n in doubted}
                worse = [n for n in doubted if trial.error_um > MOST_WORSE * fewer[n]]
                if not worse:
                    return trial, found
                weakest = min(worse, key=fewer.__getitem__)
            trial = self.without(trial, weakest)
            unknown = self._log_odds(trial, {})[UNKNOWN] > 0.0
            judged = {name: members for name, (members, _) in found.items()} if unknown else {}

    def group(self, trial: EffectSet, name: str) -> Group:
        """The effects that could stand in place of one, and how probable one of them is.

        None could whose model is less probable than the one without any.
        """
        others = self.without(trial, name)
        rivals = dict.fromkeys((name, *others.proposed))
        tried = {rival: self.with_effect(others, rival) for rival in rivals}
        weights = {rival: one.log_weight for rival, one in tried.items()}
        found = sorted(weights, key=lambda cause: -weights[cause])
        found = [cause for cause in found if weights[cause] > others.log_weight] or [name]
        shares = np.cumsum(softmax([weights[cause] / COARSENED for cause in found]))
        members = found[: int(np.searchsorted(shares, CREDIBLE)) + 1]
        if len(members) > 1:
            # The discrepancy may stand for most of what the first is to explain: it gives way to
            # one that by itself takes twice as much away.
            taken = [others.result.objective - tried[one].result.objective for one in members]
            most = int(np.argmax(taken))
            if taken[most] > 2.0 * max(taken[0], SAME):
                members.insert(0, members.pop(most))
        odds = self._log_odds(others, tried)
        own = [odds.pop(member) for member in members]
        return tuple(members), inclusion_of(own, [0.0, *odds.values()])

    def _log_odds(self, trial: EffectSet, larger: Mapping[str, EffectSet]) -> dict[str, float]:
        """Logarithm of the odds of each larger set against one, and of something unknown in it."""
        effect = log_odds(PRIOR_EFFECT) - trial.log_evidence
        found = {name: one.log_evidence + effect for name, one in larger.items()}
        beyond = trial.of_unknown.alone[UNKNOWN]
        alike = np.logaddexp.reduce([*found.values(), -np.inf]) + np.log(ALIKE)
        return found | {UNKNOWN: float(np.logaddexp(beyond, alike))}
