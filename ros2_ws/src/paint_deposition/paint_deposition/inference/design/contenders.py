"""The explanations that compete for a diagnosis, and how far further readings set them apart.

Each is a model that was refitted to the readings at hand, with its own discrepancy: what it gives
further readings is normal, with what the first readings say of its parameters and of the
discrepancy. How much the logarithm of the odds between two of them will change is then known
beforehand: on average by their Kullback-Leibler divergence (Lindley, Ann. Math. Stat. 27:986,
1956).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import ndtr, softmax

from paint_deposition.effects.base import Effect
from paint_deposition.inference.diagnosis.discrepancy import (
    DiscrepancyHyperparameters,
    ModelDiscrepancy,
)
from paint_deposition.inference.diagnosis.explanations import (
    FACTOR,
    FOOTPRINT,
    LAW_LENGTH,
    UNKNOWN,
    neutral_shapes,
    of_effects,
    standardised,
    ways_off,
)
from paint_deposition.inference.diagnosis.gaussian import NullModel
from paint_deposition.inference.diagnosis.model_space import (
    COARSENED,
    CREDIBLE,
    LOG_ODDS_UNKNOWN,
    PRIOR_EFFECT,
    SIZES,
    SURE,
    best_amplitude_sizes,
    gain_of_sizes,
    log_odds,
    space_around,
)
from paint_deposition.inference.diagnosis.smooth_laws import NEGLIGIBLE
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.random_effects import root_of_field
from paint_deposition.inference.fitting.study import Study

# Effects that compete at the most.
MOST_CONTENDERS = 6
# Logarithm of the prior odds of what is no effect of the library.
LOG_PRIOR = {UNKNOWN: LOG_ODDS_UNKNOWN, FOOTPRINT: 0.0}


@dataclass(frozen=True)
class Contender:
    """One explanation that competes."""

    name: str  # effect id, ``UNKNOWN`` or ``FOOTPRINT``
    fit: Fit  # of the model refitted to it
    sizes: DiscrepancyHyperparameters  # of the discrepancy beside it
    covariate: str = ''  # of which something unknown is any smooth function
    # How its laws are off: the number among ``ways_off``, and its prior share.
    off: int = 0
    share: float = 1.0

    @property
    def is_effect(self) -> bool:
        """Whether it is an effect of the library."""
        return self.name not in LOG_PRIOR

    def null(
        self, study: Study, discrepancy: ModelDiscrepancy, errors: np.ndarray | None = None
    ) -> NullModel:
        """What it gives the readings of a study, among them those that it was fitted to.

        Args:
            discrepancy: theirs, around one model of all contenders.
            errors: (P, n) by which its laws are off, if they are known, see ``ways_off``.
        """
        fit = study.beside(self.fit.parameters, self.fit.vector)
        if errors is None:
            errors, _ = ways_off(study, fit, None, discrepancy.model)[self.off]
        columns = [study.nuisance, errors]
        if self.covariate:
            values = standardised(study, discrepancy.model)[self.covariate]
            law = SIZES[-1] * FACTOR * root_of_field(values, LAW_LENGTH, NEGLIGIBLE)
            columns.append((fit.predicted_um / study.sigma_um)[:, np.newaxis] * law)
        return NullModel.around(fit, np.hstack(columns), discrepancy.covariance(self.sizes))

    def log_weight(self, null: NullModel, freedom: float) -> float:
        """Logarithm of its posterior weight, for what it gives readings."""
        evidence = float(null.log_evidence(null.deviation[:, np.newaxis], freedom)[0])
        if not self.is_effect:
            return evidence + LOG_PRIOR[self.name]
        prior = log_odds(PRIOR_EFFECT) + float(np.log(self.share))
        return evidence + gain_of_sizes(self.fit, [self.name], freedom) + prior


def contenders_of(
    diagnosis: Diagnosis, library: Mapping[str, type[Effect]]
) -> tuple[Contender, ...]:
    """What competes for a diagnosis: nothing if fewer than two explanations do.

    These are the members of the first group that has several; else, where nothing is accepted or
    something is missing beside it, the leading effects and the shapeless cause, if that is what
    the verdict names. A pattern that is no two Gaussians may always stand in their place.
    """
    names = _competing(diagnosis, library)
    if not names:
        return ()
    study, fit = diagnosis.study, diagnosis.history[-1].fit
    # Laws that were learned beside one of them would hide what tells them apart.
    left_out = {*names, *(name for name in diagnosis.accepted if name not in library)}
    rest = tuple(effect for effect in fit.model.effects if effect.id not in left_out)
    without = fit.model.model_copy(update={'effects': rest})

    def fitted(
        *effects: Effect,
        discrepancy: np.ndarray | None = None,
        sizes: Mapping[str, float] = MappingProxyType({}),
    ) -> Fit:
        model = without.model_copy(update={'effects': (*rest, *effects)})
        sizes = {**fit.parameters.amplitude_sizes, **sizes}
        parameters = FreeParameters.of(
            model, *model.effects, known=fit.parameters.known, amplitude_sizes=sizes
        )
        return study.fit(parameters, nuisance=study.nuisance, discrepancy=discrepancy)

    base = fitted()
    shapes = {name: neutral_shapes(library[name]) for name in names}
    space = space_around(study, base, [*of_effects(study, base, shapes)])
    best, discrepancy, freedom = space.best, space.discrepancy, space.freedom
    base, found = fitted(discrepancy=best.null.discrepancy), []
    for name in names:
        effect = fit.model.effect(name) or space.central.by_law(name)[1]
        rough = fitted(effect, discrepancy=best.null.discrepancy)
        sizes = best_amplitude_sizes(rough, [name], freedom)
        there = fitted(effect, discrepancy=best.null.discrepancy, sizes=sizes)
        weights, ways = [], []
        for k, (errors, share) in enumerate(ways_off(study, there, None, discrepancy.model)):
            way = Contender(name, there, best.sizes, off=k, share=share)
            weights.append(way.log_weight(way.null(study, discrepancy, errors), freedom))
            ways.append(way)
        found.append(ways[int(np.argmax(weights))])
    if diagnosis.unknown is not None:
        found.append(Contender(UNKNOWN, base, best.sizes, diagnosis.unknown.covariate))
    return (*found, Contender(FOOTPRINT, base, best.sizes))


def _competing(diagnosis: Diagnosis, library: Mapping[str, type[Effect]]) -> tuple[str, ...]:
    several = [
        tuple(m for m in found.members if m in library)
        for found in diagnosis.classes
        if len(found.members) > 1
    ]
    if several:
        return several[0][:MOST_CONTENDERS]
    accepted = diagnosis.accepted
    if diagnosis.unknown is None and any(found in library for found in accepted):
        return ()
    left = [c.best for c in diagnosis.classes if c.best in library and c.best not in accepted]
    return tuple(left[:MOST_CONTENDERS])


@dataclass(frozen=True)
class Forecast:
    """What contenders give the last Q readings of a study, given the others, over their noise."""

    contenders: Sequence[Contender]
    log_weight: np.ndarray  # (n,) logarithm of the posterior weight of each by the others
    means: np.ndarray  # (n, Q)
    factors: np.ndarray  # (n, Q, Q) lower Cholesky factors of their covariances

    @staticmethod
    def of(
        contenders: Sequence[Contender], study: Study, order: np.ndarray, known: int
    ) -> 'Forecast':
        """Forecast readings of a study.

        Args:
            study: all readings; what those that are to be forecast measured has no influence.
            order: (P,) rows of the study, those that are known first.
            known: how many are.
        """
        base = contenders[-1].fit
        discrepancy = ModelDiscrepancy.of(study, study.beside(base.parameters, base.vector))
        weights, means, factors = [], [], []
        for contender in contenders:
            null = contender.null(study, discrepancy).select(order)
            mean, factor = null.predicted(known)
            expected = (study.measured_um / study.sigma_um)[order] - null.scaled_deviation
            freedom = study.noise.degrees_of_freedom
            weights.append(contender.log_weight(null.first(known), freedom))
            means.append(expected[known:] + mean)
            factors.append(factor)
        return Forecast(contenders, np.array(weights), np.array(means), np.array(factors))

    @cached_property
    def odds(self) -> np.ndarray:
        """(n, n) logarithm of the odds of each against each other by the known readings."""
        return self.log_weight[:, np.newaxis] - self.log_weight

    @cached_property
    def gains(self) -> np.ndarray:
        """(2, n, n) mean and variance of what the readings add to the log odds of the true one."""
        count = len(self.contenders)
        found = np.zeros((2, count, count))
        for true, other in np.ndindex(count, count):
            if true == other:
                continue
            factor, away = self.factors[true], self.means[other] - self.means[true]
            both = np.column_stack([factor, away])
            seen = solve_triangular(self.factors[other], both, lower=True)
            turned, shift = seen[:, :-1], seen[:, -1]
            scale = np.log(np.diag(self.factors[other]) / np.diag(factor)).sum()
            excess = turned.T @ turned - np.eye(len(factor))
            found[0, true, other] = scale + 0.5 * (np.trace(excess) + shift @ shift)
            found[1, true, other] = 0.5 * np.sum(excess**2) + np.sum((turned.T @ shift) ** 2)
        return found

    @cached_property
    def leading(self) -> int:
        """Number of the most probable effect."""
        effects = np.array([contender.is_effect for contender in self.contenders])
        return int(np.where(effects, self.log_weight, -np.inf).argmax())

    @property
    def separations(self) -> tuple[float, float]:
        """Standard deviations from the leading effect to the nearest of the others.

        By the known readings and with all: two normal distributions so many standard deviations
        apart have on average half the square of it as log odds.
        """
        mean, others = self.gains[0], np.arange(len(self.contenders)) != self.leading
        now = np.abs(self.odds)[self.leading, others]
        then = now + 0.5 * (mean + mean.T)[self.leading, others]
        return float(np.sqrt(2.0 * now.min())), float(np.sqrt(2.0 * then.min()))

    @property
    def chance(self) -> float:
        """Probability that the true effect is left alone, averaged over which it probably is."""
        mean, variance = self.gains
        effect = np.array([contender.is_effect for contender in self.contenders])
        # Log odds between two effects beyond which one of them leaves the group, and against what
        # is no effect, beyond which it is accepted.
        needed = np.where(effect, COARSENED * log_odds(CREDIBLE), log_odds(SURE))
        with np.errstate(divide='ignore', invalid='ignore'):
            left = np.nan_to_num(ndtr((self.odds + mean - needed) / np.sqrt(variance)))
        np.fill_diagonal(left, 1.0)
        probable = softmax(self.log_weight[effect] / COARSENED)
        return float(probable @ left[effect].prod(axis=1))


def one_by_one(
    forecast: Forecast, usable: np.ndarray
) -> Iterator[tuple[int, tuple[int, int], tuple[float, float]]]:
    """Readings one after the other, each where it tells the leading effect most from its rival.

    That is the explanation from which the readings so far tell it least. With each reading come
    the two, and the standard deviations between them before and after it.

    Args:
        usable: (Q,) bool, readings that may be taken; who takes them may exclude more meanwhile.
    """
    leading, apart = forecast.leading, np.abs(forecast.odds)  # log odds between each two
    others = np.arange(len(apart)) != leading
    covariances = forecast.factors @ forecast.factors.transpose(0, 2, 1)
    away = forecast.means - forecast.means[:, np.newaxis]  # n true, n others, Q
    while usable.any():
        pair = leading, int(np.where(others, apart[leading], np.inf).argmin())
        # (n, n, Q) by how much each further reading adds to the log odds between each two.
        variance = np.diagonal(covariances, axis1=1, axis2=2)
        ratio = variance[:, np.newaxis] / variance
        gain = 0.5 * (ratio + away**2 / variance - 1.0 - np.log(ratio))
        gain = 0.5 * (gain + gain.transpose(1, 0, 2))
        reading = int(np.argmax(np.where(usable, gain[pair], -1.0)))
        before, apart = apart, apart + gain[:, :, reading]
        yield reading, pair, (np.sqrt(2.0 * before[pair]), np.sqrt(2.0 * apart[pair]))
        column = covariances[:, :, reading]
        slope = column / column[:, [reading]]
        away = away - away[:, :, [reading]] * slope
        covariances = covariances - slope[:, :, np.newaxis] * column[:, np.newaxis]
        # Of a reading that was taken the noise is left: the same place, read again.
        covariances[:, reading, reading] += 1.0
