"""A set of effects that may be missing, with the model refitted to them, and its evidence."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.inference.diagnosis.evidence import NullModel
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, law_errors, of_effects
from paint_deposition.inference.diagnosis.learning import Nulls
from paint_deposition.inference.diagnosis.model_space import (
    PRIOR_EFFECT,
    PRIOR_UNKNOWN,
    SIZES,
    ModelSpace,
    Weighed,
    log_odds,
    probable_sizes,
    weight_of,
)
from paint_deposition.inference.diagnosis.remainder import Remainder, Sizes
from paint_deposition.inference.diagnosis.run import Run
from paint_deposition.inference.fitting.least_squares import Fit

# So many proposals are refitted each time.
TRIALS = 5
# An effect is there by its law, off by so much as laws are, or by a law much further off: how many
# times as far, and the prior share of each.
LAWS_OFF = ((1.0, 0.7), (3.0, 0.3))


@dataclass(frozen=True)
class Trial:
    """A set of effects with the model refitted to them."""

    run: Run
    names: frozenset[str]  # of the effects
    fit: Fit  # of the model with them, what nature leaves over being allowed for
    usual: Remainder  # what nature leaves over, around the one fit that all compared sets share
    sizes: Sequence[Sizes]  # of the remainder that matter

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
        sizes, plain, left_over = self.best.sizes, self.run.plain(fit), self.remainder
        off = law_errors(self.run.study, fit, self.names, self.usual.model)
        correction = plain.with_remainder(left_over.covariance(sizes))
        return Nulls(
            plain.with_remainder(left_over.of_parts(sizes)).beside(off),
            correction,
            plain.with_remainder(left_over.covariance(left_over.usual(sizes))).beside(off),
            correction.beside(off),
        )

    @cached_property
    def p_value_of_causes(self) -> float:
        """Probability of at least this much evidence for any cause if none acted beside it."""
        return min(1.0, 2.0 * self.space.p_value(self.run.seed))

    @property
    def p_value(self) -> float:
        """The same, or of fields over the parts larger than those of usual sprays.

        Two tests were made, so that each counts twice (Bonferroni).
        """
        of_size = min(1.0, 2.0 * self.space.p_value_of_size(self.run.seed))
        return min(self.p_value_of_causes, of_size)

    @cached_property
    def log_weight(self) -> float:
        """Logarithm of the posterior weight of this set, nothing unknown acting."""
        return weight_of(self.log_evidence, self.log_prior)

    @cached_property
    def log_weight_unknown(self) -> float:
        """The same if something unknown acts beside it."""
        unknown = self.of_unknown.alone[UNKNOWN] - log_odds(PRIOR_UNKNOWN)
        prior = self.log_prior + log_odds(PRIOR_UNKNOWN)
        return weight_of(self.log_evidence + unknown, prior)

    @cached_property
    def of_unknown(self) -> ModelSpace:
        """What is outside the library and may be missing beside it."""
        run = self.run
        return ModelSpace(self.weighed, run.any_form, self.remainder, run.freedom)

    @cached_property
    def log_evidence(self) -> float:
        """Its evidence, nothing unknown acting, the amplitudes being of any of the sizes.

        The fit takes each as normal with its typical size as the standard deviation.
        """
        nature = [one.log_weight for one in self.weighed if not one.sizes.is_beyond_nature]
        return float(np.logaddexp.reduce(nature)) + self._of_sizes

    @property
    def _of_sizes(self) -> float:
        """What the mixture of sizes changes of the log evidence."""
        entries, found = self.fit.parameters.of_effects, 0.0
        amounts = self.fit.vector[len(self.fit.vector) - len(entries) :]
        for name in self.names:
            own = [amount for amount, entry in zip(amounts, entries, strict=True)
                   if entry.effect == name and not entry.is_shape]  # fmt: skip
            by_size = 0.5 * np.sum(np.square(own)) * (1.0 - SIZES**-2.0) - len(own) * np.log(SIZES)
            found += float(np.logaddexp.reduce(by_size)) - np.log(len(SIZES))
        return found

    @property
    def log_prior(self) -> float:
        """Logarithm of the prior odds of this set."""
        return log_odds(PRIOR_EFFECT) * len(self.names)

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
        return weight_of(evidence + self.best.sizes.log_prior + self._of_sizes, self.log_prior)
