"""The evidence of what may be missing beside one fitted model.

Each cause is missing or not, independently of the others before the readings; its laws in a few
shapes and at several sizes are averaged. How large the discrepancy of nature is and how far it
reaches is not known before either: every hypothesis is weighed at several of its sizes, and its
evidence is averaged over them, too. All of it is linear around the fit, which is quick and good
enough to test whether anything is missing, and to propose what.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from paint_deposition.effects.base import Effect
from paint_deposition.effects.learned_laws import WAVES
from paint_deposition.inference.diagnosis.discrepancy import (
    PRIOR,
    DiscrepancyHyperparameters,
    ModelDiscrepancy,
)
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, Explanation
from paint_deposition.inference.diagnosis.gaussian import (
    NullModel,
    OrthogonalDirections,
    simulated,
)
from paint_deposition.inference.fitting.estimates import DiscrepancyFigures, FootprintProfile
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.study import Study

# Prior probability that a cause is missing: an effect of the library; and, as one effect more,
# something outside it, half of which shows over a covariate and half as a setting that differs
# beyond nature.
PRIOR_EFFECT, PRIOR_UNKNOWN = 0.02, 0.02
# Sizes of the amplitudes, times their typical ones: what is typical is known to within a factor.
SIZES = np.array([0.5, 1.0, 2.0])
# An effect acts for certain from this posterior probability of its group on; beside another one,
# whose law may be off in more ways than the model allows for, from the second.
SURE, SURE_BESIDE = 0.7, 0.8
# Between rivals, whose laws are true to their form no better than that, differences of log weight
# count as so many times smaller (a coarsened posterior, Miller and Dunson 2019).
COARSENED = 2.0
# Probability that a group holds the cause, if one of the alternatives is it.
CREDIBLE = 0.95
# Between sizes of the footprint that are three times as large as the next none is tried: standard
# deviation of the logarithm within each.
WITHIN_SIZE = np.log(3.0) / np.sqrt(12.0)
# Significance level of the test that something is missing, the share of it that the test for
# causes has, and simulations behind a p-value.
ALPHA, OF_CAUSES = 0.05, 0.9
DRAWS = 1000
# Of each size of the footprint so many sizes of fields are kept at most, and none whose share of
# the posterior is smaller: with more effects another footprint may be the more probable one.
MOST_SIZES, LEAST_SHARE = 2, 0.02


def log_odds(probability: float) -> float:
    """Logarithm of the odds of a probability."""
    return float(np.log(probability / (1.0 - probability)))


# Of something unknown over a covariate, and of a setting beyond nature.
LOG_ODDS_UNKNOWN = log_odds(PRIOR_UNKNOWN) - float(np.log(2.0))


class EffectEvidence:
    """Log evidence of each explanation alone, against one null model.

    ``freedom`` are the degrees of freedom of the noise estimate.
    """

    def __init__(
        self, null: NullModel, explanations: Sequence[Explanation], freedom: float
    ) -> None:
        self.null, self.explanations, self.freedom = null, explanations, freedom
        self.principal = [
            OrthogonalDirections.of(null.whiten(e.columns), e.sides) for e in explanations
        ]

    @cached_property
    def of_readings(self) -> np.ndarray:
        """(K, S) log Bayes factors of each explanation at every size."""
        deviation = self.null.deviation[:, np.newaxis]
        factors = [
            turned.log_bayes_factors(deviation, SIZES, self.freedom)[:, 0]
            for turned in self.principal
        ]
        return np.array(factors).reshape(len(self.principal), len(SIZES))

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
        numbers = range(len(self.explanations)) if chosen is None else chosen
        terms = []
        for k in numbers:
            by_size = self.principal[k].log_bayes_factors(deviations, SIZES, self.freedom, shifts)
            terms.append(np.logaddexp.reduce(by_size) + log_share(self.explanations[k]))
        return np.logaddexp.reduce(terms)

    def by_law(self, cause: str) -> tuple[float, Effect]:
        """An effect in its best shape, with its log evidence there and its mean amplitudes."""
        own = [k for k, explanation in enumerate(self.explanations) if explanation.cause == cause]
        k = max(own, key=lambda k: float(self.of_readings[k].max()))
        size = int(self.of_readings[k].argmax())
        amounts = self.principal[k].amplitudes(self.null.deviation, SIZES[[size]])[0]
        law = self.explanations[k].law
        assert law is not None
        return float(self.of_readings[k, size]), law.with_amplitudes(amounts)

    def null_draws(self, seed: int) -> np.ndarray:
        """(P, DRAWS) whitened deviations if no cause acted."""
        return simulated(len(self.null.deviation), self.freedom, DRAWS, seed)


def log_share(explanation: Explanation) -> float:
    """Logarithm of the prior odds of an explanation at one size against nothing missing."""
    odds = LOG_ODDS_UNKNOWN if explanation.cause == UNKNOWN else log_odds(PRIOR_EFFECT)
    return float(odds + np.log(explanation.share / len(SIZES)))


class WeightedNull(NamedTuple):
    """Sizes of the discrepancy, the null model with it, its log prior and log weight."""

    sizes: DiscrepancyHyperparameters
    null: NullModel
    log_prior: float
    log_weight: float

    @staticmethod
    def of(
        plain: NullModel,
        discrepancy: ModelDiscrepancy,
        sizes: DiscrepancyHyperparameters,
        freedom: float,
        share: float = 1.0,
    ) -> 'WeightedNull':
        """Weigh one choice by its evidence and its prior, of which this hypothesis has a share."""
        null = plain.with_discrepancy(discrepancy.covariance(sizes))
        evidence = float(null.log_evidence(null.deviation[:, np.newaxis], freedom)[0])
        prior = sizes.log_prior + float(np.log(share))
        if sizes.is_beyond_nature:
            prior += LOG_ODDS_UNKNOWN
        return WeightedNull(sizes, null, prior, evidence + prior)

    def select(self, rows: np.ndarray, freedom: float) -> 'WeightedNull':
        """The same by some readings (P,) only."""
        some = self.null.select(rows)
        evidence = float(some.log_evidence(some.deviation[:, np.newaxis], freedom)[0])
        return self._replace(null=some, log_weight=self.log_prior + evidence)


class ModelSpace:
    """What may be missing beside a model, whatever the size of the discrepancy.

    Args:
        weighed: the null hypothesis at the sizes of the discrepancy that matter.
        discrepancy: what the sizes are of.
        freedom: degrees of freedom of the noise estimate.
    """

    def __init__(
        self,
        weighed: Sequence[WeightedNull],
        explanations: Sequence[Explanation],
        discrepancy: ModelDiscrepancy,
        freedom: float,
    ) -> None:
        self.explanations, self.discrepancy, self.freedom = explanations, discrepancy, freedom
        self.weighed = weighed
        self.nature = [one for one in weighed if not one.sizes.is_beyond_nature]
        self.beyond = [one for one in weighed if one.sizes.is_beyond_nature]
        self.evidences = [EffectEvidence(one.null, explanations, freedom) for one in self.nature]
        log_weights = [one.log_weight for one in self.nature]
        self.log_null = float(np.logaddexp.reduce(log_weights))
        # Posterior probability of each of nature's sizes if nothing is missing.
        self.share = np.exp(np.array(log_weights) - self.log_null)

    def select(self, rows: np.ndarray) -> 'ModelSpace':
        """What may be missing by some readings (P,) only."""
        return ModelSpace(
            [one.select(rows, self.freedom) for one in self.weighed],
            [explanation.select(rows) for explanation in self.explanations],
            self.discrepancy.select(rows),
            self.freedom,
        )

    @property
    def best(self) -> WeightedNull:
        """The null hypothesis at nature's most probable sizes."""
        return self.nature[int(self.share.argmax())]

    @cached_property
    def central(self) -> EffectEvidence:
        """The evidence at nature's most probable sizes, for what needs no average."""
        return self.evidences[int(self.share.argmax())]

    @cached_property
    def alone(self) -> dict[str, float]:
        """Logarithm of each cause's odds against nothing missing, most probable first."""
        terms: dict[str, list[float]] = {}
        for k, explanation in enumerate(self.explanations):
            factors = np.array([e.of_readings[k] for e in self.evidences])
            averaged = np.logaddexp.reduce(factors + np.log(self.share)[:, np.newaxis], axis=None)
            terms.setdefault(explanation.cause, []).append(averaged + log_share(explanation))
        beyond = [one.log_weight - self.log_null for one in self.beyond]
        terms[UNKNOWN] = [*terms.get(UNKNOWN, []), *beyond, -np.inf]
        found = {cause: float(np.logaddexp.reduce(values)) for cause, values in terms.items()}
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def by_law(self, cause: str) -> Effect:
        """An effect in its best shape with the amplitudes that it has if nothing else acts."""
        return max((evidence.by_law(cause) for evidence in self.evidences), key=lambda e: e[0])[1]

    def p_values(self, seed: int) -> tuple[float, float]:
        """Probabilities of so much evidence for a cause, and of so large fields on the parts.

        Two tests are made, each with its share of the significance level (Bonferroni).
        """
        of_causes = self.p_value(seed) / OF_CAUSES
        of_size = self.p_value_of_size(seed) / (1.0 - OF_CAUSES)
        return min(1.0, of_causes), min(1.0, of_size)

    def p_value(self, seed: int) -> float:
        """Probability of at least this much evidence for any cause if none acted.

        By simulation (Davison & Hinkley 1997) of the averaged evidence of all causes at all sizes,
        which is computed for every draw as for the readings. The fit, and the sizes of the
        discrepancy with their shares among the draws, are those of the readings.
        """
        random = np.random.default_rng(seed)
        draws = []
        for one, count in zip(self.nature, random.multinomial(DRAWS, self.share), strict=True):
            noise = simulated(len(one.null.scaled_deviation), self.freedom, count, random)
            draws.append(one.null.lower @ noise)
        found = self._evidence(self.nature[0].null.scaled_deviation[:, np.newaxis])[0]
        by_chance = self._evidence(np.hstack(draws))
        return float((1 + np.count_nonzero(by_chance >= found)) / (1 + DRAWS))

    def p_value_of_size(self, seed: int) -> float:
        """Probability of fields this large over the parts if sprays differed as usual ones do.

        The less of two, doubled: of the score of such fields (Rao), summed over their lengths, and
        of the largest deviation of any point, where a field is as narrow as a stripe.
        """
        sizes = self.best.sizes
        usual = self.discrepancy.covariance(self.discrepancy.usual(sizes))
        null = self.central.null.with_discrepancy(usual)
        score = np.zeros_like(usual)
        for settings, parts in zip(self.discrepancy.settings, self.discrepancy.parts, strict=True):
            field = null.whiten(null.whiten(settings + parts).T)
            score += field / np.trace(field)
        draws = simulated(len(usual), self.freedom, DRAWS, seed)
        every = np.column_stack([null.deviation, draws])
        statistics = np.einsum('pd,pq,qd->d', every, score, every), np.abs(every).max(axis=0)
        as_large = [np.count_nonzero(each >= each[0]) for each in statistics]
        return float(2.0 * min(as_large) / (1 + DRAWS))

    def _evidence(self, raw: np.ndarray) -> np.ndarray:
        """(D,) log evidence that any cause acts against none, for deviations (P, D)."""
        nulls, causes = [], []
        for one, evidence in zip(self.nature, self.evidences, strict=True):
            deviations = one.null.whiten(raw)
            null = self._log_weight(one, deviations)
            nulls.append(null)
            causes.append(null + evidence.evidence(deviations))
        causes += [self._log_weight(one, one.null.whiten(raw)) for one in self.beyond]
        return np.logaddexp.reduce(causes) - np.logaddexp.reduce(nulls)

    def _log_weight(self, one: WeightedNull, deviations: np.ndarray) -> np.ndarray:
        """(D,) what the weight of one choice of sizes would be for whitened deviations (P, D)."""
        return one.log_prior + one.null.log_evidence(deviations, self.freedom)

    @property
    def figures(self) -> DiscrepancyFigures:
        """What is left over: sizes on average over their posterior, the footprint's mean."""
        null = self.central.null
        size = self.best.sizes.footprint
        footprint = self.discrepancy.footprint
        seen, of_peak = null.whiten(footprint.columns[size]), footprint.of_peak[size]
        mean = of_peak @ (seen.T @ null.deviation)
        spread = np.eye(seen.shape[1]) - seen.T @ seen
        sd = np.sqrt(np.einsum('kn,nm,km->k', of_peak, spread, of_peak))
        found = [one.sizes for one in self.nature]
        logs = np.log([PRIOR.footprints[one.footprint] for one in found])
        middle = self.share @ logs
        spread_of_logs = np.sqrt(self.share @ (logs - middle) ** 2 + WITHIN_SIZE**2)
        # Of a hundred knots one is as many standard deviations off by chance once in twenty times.
        return DiscrepancyFigures(
            float(self.share @ [one.setting for one in found]),
            float(self.share @ [one.part for one in found]),
            float(self.share @ [self.discrepancy.lengths_m[one.length] for one in found]),
            float(np.max(np.abs(mean), where=np.abs(mean) > 3.5 * sd, initial=0.0)),
            (float(np.exp(middle)), float(np.exp(spread_of_logs))),
            FootprintProfile(
                footprint.radius_m,
                footprint.flux,
                np.maximum(footprint.flux + mean[::WAVES], 0.0),
                sd[::WAVES],
            ),
        )


def probable_hyperparameters(
    plain: NullModel,
    discrepancy: ModelDiscrepancy,
    explanations: Sequence[Explanation],
    freedom: float,
) -> list[DiscrepancyHyperparameters]:
    """The sizes that matter where nothing, or the law of any one effect, acts."""
    laws = [e.columns for e in explanations if e.law is not None]
    columns = np.hstack(laws) if laws else plain.columns[:, :0]
    found: list[tuple[float, DiscrepancyHyperparameters]] = []
    for sizes in discrepancy.choices():
        one = WeightedNull.of(plain, discrepancy, sizes, freedom)
        law = one.null.whiten(columns)
        score, square = law.T @ one.null.deviation, np.sum(law**2, axis=0)
        precision = 1.0 + np.multiply.outer(SIZES**2, square)
        explained = (SIZES**2)[:, np.newaxis] * score**2 / precision
        if np.isfinite(freedom):
            count = freedom + len(plain.scaled_deviation)
            whole = freedom + one.null.deviation @ one.null.deviation
            gain = -0.5 * count * np.log1p(-explained / whole)
        else:
            gain = 0.5 * explained
        best = np.max(gain - 0.5 * np.log(precision), initial=0.0)
        with_law = one.log_weight + log_odds(PRIOR_EFFECT) + float(best)
        found.append((float(np.logaddexp(one.log_weight, with_law)), sizes))
    kept = []
    for kind in dict.fromkeys((s.is_beyond_nature, s.footprint) for _, s in found):
        here = [(w, s) for w, s in found if (s.is_beyond_nature, s.footprint) == kind]
        least = float(np.logaddexp.reduce([weight for weight, _ in here])) + np.log(LEAST_SHARE)
        most = sorted(here, key=lambda one: -one[0])[: 1 if kind[0] else MOST_SIZES]
        kept += [sizes for weight, sizes in most if weight > least]
    return kept


def space_around(study: Study, fit: Fit, explanations: Sequence[Explanation] = ()) -> ModelSpace:
    """What may be missing beside a fitted model, its laws being as they are."""
    plain, discrepancy = NullModel.around(fit, study.nuisance), ModelDiscrepancy.of(study, fit)
    freedom = study.noise.degrees_of_freedom
    sizes = probable_hyperparameters(plain, discrepancy, [], freedom)
    weighed = [WeightedNull.of(plain, discrepancy, size, freedom) for size in sizes]
    return ModelSpace(weighed, explanations, discrepancy, freedom)


def best_amplitude_sizes(fit: Fit, names: Iterable[str], freedom: float) -> dict[str, float]:
    """The most probable size of each effect's amplitudes, times their typical ones.

    With the typical size an effect that is stronger would be drawn towards none.
    """
    return {name: float(SIZES[_by_size(fit, name, freedom).argmax()]) for name in names}


def gain_of_sizes(fit: Fit, names: Iterable[str], freedom: float) -> float:
    """Log evidence of a fit averaged over ``SIZES`` of the amplitudes, minus that at the fitted.

    Each effect by itself. The fit takes its amplitudes as normal with one size as the standard
    deviation.
    """
    gain = 0.0
    for name in names:
        sized, fitted = _by_size(fit, name, freedom), fit.parameters.amplitude_sizes.get(name, 1.0)
        gain += float(np.logaddexp.reduce(sized) - sized[np.searchsorted(SIZES, fitted)])
    return gain - len([*names]) * float(np.log(len(SIZES)))


def _by_size(fit: Fit, name: str, freedom: float) -> np.ndarray:
    """(S,) log evidence of a fit if the amplitudes of one of its effects had each of the sizes."""
    found = []
    for size in SIZES:
        sizes = {**fit.parameters.amplitude_sizes, name: float(size)}
        sized = replace(fit, parameters=replace(fit.parameters, amplitude_sizes=sizes))
        null = NullModel.around(sized, fit.nuisance, fit.discrepancy)
        found.append(null.log_evidence(null.deviation[:, np.newaxis], freedom)[0])
    return np.array(found)


def inclusion_of(log_weights: Sequence[float], others: Sequence[float]) -> float:
    """Probability of any of some refitted models against others without what they have more."""
    return float(expit(np.logaddexp.reduce(log_weights) - np.logaddexp.reduce(others)))
