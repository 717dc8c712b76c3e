"""Pooling of many parts: a shared pattern, misfit and effects, and a level for each part.

The readings of part i are linear about the model,

    y_i = J_i b + f_i (l_i + g) + M_i a + e_i,

with the pattern's change b, the level l_i of the part (standard deviation tau), a misfit g of
each place of the part as a share of the film f_i, amplitudes a of effects, and noise e_i. All are
normal, so that everything but the scales, tau, the noise and the size and width of the misfit, has
a closed form (Gelman et al., Bayesian Data Analysis, 2013, chapters 5 and 15). The misfit stands
for all that no effect explains: without it any error of the model, seen often enough, would be
taken for an effect.

Effects are found one after the other, by their evidence. Each set of effects is evaluated with the
scales that are the most probable with it: those fitted without an effect would take it for noise.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve
from scipy.special import logsumexp

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.fitting.pattern_vector import PatternVector
from paint_deposition.report.words import effect_name, parameter_words, unit_words, with_others

# Readings within a cell of this size are at one place of the part.
PLACE_SIZE_M = 0.05
LEVELS = np.geomspace(1e-3, 0.2, 24).tolist()
NOISES = np.geomspace(0.5, 3.0, 19).tolist()
# Size of the misfit as a share of the film, and how far it reaches over the part [m].
MISFITS = tuple(product((0.005, 0.01, 0.02, 0.05, 0.1), (0.02, 0.1, 0.25)))
# Prior probability that there is no misfit.
NO_MISFIT = 0.5
# An effect is accepted if some effect of the catalogue acts with this probability.
ACCEPTANCE = 0.99
MOST_ACCEPTED = 3
# Effects whose log evidence is this close to the best are not distinguished (odds of 20 to 1).
INDISTINGUISHABLE = 3.0
# Columns of a row that pooling takes.
COLUMNS = (
    'measured_um', 'predicted_um', 'sigma_um', 'x_m', 'y_m', 'z_m', 'by_pattern', 'by_effect',
)  # fmt: skip
ONE_BRUSH = PatternVector()


@dataclass(frozen=True)
class Measured:
    """One part and its P points."""

    name: str  # of the part
    time_s: float  # when it was painted, seconds since 1970
    # (P,) measured minus predicted; standard deviation; predicted [um].
    residual_um: np.ndarray
    sigma_um: np.ndarray
    predicted_um: np.ndarray
    positions_m: np.ndarray  # (P, 3)
    # (P, k) derivatives by the coordinates of the pattern, of all brushes [um].
    by_pattern: np.ndarray
    by_effect: np.ndarray  # (P, A) by each amplitude of the catalogue in its typical size [um]

    def __len__(self) -> int:
        return len(self.residual_um)


def amplitudes() -> list[tuple[str, str]]:
    """(effect, parameter) of every amplitude of the catalogue, in its order."""
    return [(e.id, name) for e in EFFECTS.values() for name in e.amplitudes()]


def measured_parts(rows: Iterable[Mapping[str, Any]]) -> list[Measured]:
    """The measured parts among the rows of all runs, oldest first."""
    rows_of: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for row in rows:
        if row.get('measured_um') is not None:
            rows_of[row['part']].append(row)
    found = []
    for part, own in rows_of.items():
        taken = {name: np.array([row[name] for row in own]) for name in COLUMNS}
        found.append(Measured(
            part, own[0]['time_s'], taken['measured_um'] - taken['predicted_um'],
            taken['sigma_um'], taken['predicted_um'],
            np.column_stack([taken[f'{axis}_m'] for axis in 'xyz']), taken['by_pattern'],
            taken['by_effect'],
        ))  # fmt: skip
    return sorted(found, key=lambda part: part.time_s)


def places(parts: Sequence[Measured]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Places at which the line is measured: (F, 3) [m], and (P,) that of each point, by part."""
    positions_m = np.concatenate([part.positions_m for part in parts])
    cells = np.round(positions_m / PLACE_SIZE_M).astype(int)
    unique, place_of = np.unique(cells, axis=0, return_inverse=True)
    ends = np.cumsum([len(part) for part in parts])[:-1]
    return unique * PLACE_SIZE_M, np.split(place_of.ravel(), ends)


@dataclass(frozen=True)
class SufficientStatistics:
    """Of the readings of all parts, for K = k + F + A columns: pattern, places, effects."""

    gram: np.ndarray  # (K, K) Gram matrix of the columns over the noise
    score: np.ndarray  # (K,) their products with the residuals
    square: float  # sum of squared residuals over the noise
    level_gram: np.ndarray  # (n, K) of each part, its film with the columns
    level_score: np.ndarray  # (n,) with the residuals
    level_square: np.ndarray  # (n,) the film's square
    count: int  # of the readings
    place_m: np.ndarray  # (F, 3) places [m]
    # (k, k) covariance of the pattern's coordinates, of all brushes, before the readings.
    between_jobs: np.ndarray

    @staticmethod
    def of(
        parts: Sequence[Measured], pattern: PatternVector = ONE_BRUSH
    ) -> 'SufficientStatistics':
        """Of at least one part."""
        place_m, place_of = places(parts)
        rows = []
        for part, here in zip(parts, place_of, strict=True):
            at_place = np.zeros((len(part), len(place_m)))
            at_place[np.arange(len(part)), here] = part.predicted_um
            columns = np.hstack([part.by_pattern, at_place, part.by_effect])
            columns = columns / part.sigma_um[:, np.newaxis]
            residual, film = part.residual_um / part.sigma_um, part.predicted_um / part.sigma_um
            rows.append((
                columns.T @ columns, columns.T @ residual, residual @ residual, film @ columns,
                film @ residual, film @ film,
            ))  # fmt: skip
        gram, score, square, *levels = zip(*rows, strict=True)
        level_gram, level_score, level_square = map(np.array, levels)
        return SufficientStatistics(
            sum(gram), np.sum(score, axis=0), float(np.sum(square)), level_gram, level_score,
            level_square, sum(map(len, parts)), place_m, pattern.between_jobs,
        )  # fmt: skip

    @property
    def shared(self) -> int:
        """Number of columns of pattern and places; those of the effects follow."""
        return len(self.between_jobs) + len(self.place_m)


@dataclass(frozen=True)
class Scales:
    """The hyperparameters, which have no closed form."""

    level: float  # standard deviation of the parts' levels, as a share
    noise: float  # factor on the stated noise
    misfit: tuple[float, float] | None  # size and width of the misfit, None for none


@dataclass(frozen=True)
class LinePosterior:
    """The posterior for given scales, the levels of the parts integrated out."""

    statistics: SufficientStatistics
    scales: Scales

    @cached_property
    def _without_levels(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Gram matrix, score and square of the residuals without what the levels explain."""
        sums, precision = self.statistics, 1.0 / self.scales.noise**2
        variance = self.scales.level**2
        weight = variance / (1.0 + variance * precision * sums.level_square) * precision**2
        weighted = weight[:, np.newaxis] * sums.level_gram
        gram = precision * sums.gram - sums.level_gram.T @ weighted
        score = precision * sums.score - weighted.T @ sums.level_score
        square = precision * sums.square - weight @ sums.level_score**2
        return gram, score, float(square)

    @cached_property
    def _prior(self) -> tuple[np.ndarray, float]:
        """Precision of pattern and places before the readings, and its log determinant."""
        size, width_m = self.scales.misfit or (1e-6, 1e-3)
        place_m = self.statistics.place_m
        apart = np.linalg.norm(place_m[:, np.newaxis] - place_m[np.newaxis], axis=2)
        smooth = np.exp(-0.5 * (apart / width_m) ** 2)
        blocks = (self.statistics.between_jobs, size**2 * (smooth + 1e-3 * np.eye(len(apart))))
        log_det = -sum(float(np.linalg.slogdet(block)[1]) for block in blocks)
        return block_diag(*map(np.linalg.inv, blocks)), log_det

    def solve(self, chosen: Sequence[int] = ()) -> tuple[np.ndarray, np.ndarray, float]:
        """Mean (k,) and covariance (k, k) of pattern, places and these amplitudes; log evidence.

        Amplitudes are standard normal before the readings, in their typical sizes.
        """
        gram, score, square = self._without_levels
        precision, log_prior = self._prior
        shared, scales = self.statistics.shared, self.scales
        rows = [*range(shared), *(shared + one for one in chosen)]
        prior = np.eye(len(rows))
        prior[:shared, :shared] = precision
        factor = cho_factor(gram[np.ix_(rows, rows)] + prior, lower=True)
        mean = cho_solve(factor, score[rows])
        log_det = 2.0 * np.log(np.diag(factor[0])).sum()
        levels = np.log1p(scales.level**2 * self.statistics.level_square / scales.noise**2).sum()
        log_evidence = -0.5 * (
            square - score[rows] @ mean + log_det - log_prior + levels
            + 2.0 * self.statistics.count * np.log(scales.noise)
        )  # fmt: skip
        return mean, cho_solve(factor, np.eye(len(rows))), float(log_evidence)


@dataclass(frozen=True)
class MisfitMixture:
    """A posterior for each size and width of the misfit, with its log prior probability."""

    posteriors: tuple[LinePosterior, ...]
    log_prior: np.ndarray

    @staticmethod
    def fitted(statistics: SufficientStatistics, chosen: Sequence[int]) -> 'MisfitMixture':
        """With the most probable level and noise given these amplitudes."""
        misfits: list[tuple[float, float] | None] = [None, *MISFITS]
        grids: dict[str, Any] = {'misfit': misfits, 'noise': NOISES, 'level': LEVELS}
        scales = Scales(0.02, 1.0, None)
        for _ in range(2):
            for name, values in grids.items():
                scales = max(
                    (replace(scales, **{name: value}) for value in values),
                    key=lambda one: LinePosterior(statistics, one).solve(chosen)[2],
                )
        share = np.log((1.0 - NO_MISFIT) / len(MISFITS))
        return MisfitMixture(
            tuple(LinePosterior(statistics, replace(scales, misfit=one)) for one in misfits),
            np.array([np.log(NO_MISFIT), *[share] * len(MISFITS)]),
        )

    def evidence(self, chosen: Sequence[int]) -> float:
        """Log evidence of these amplitudes, the misfit summed out."""
        return float(logsumexp(self._log_joint(chosen)))

    def most_probable(self, chosen: Sequence[int]) -> LinePosterior:
        """The posterior with the most probable misfit."""
        return self.posteriors[int(np.argmax(self._log_joint(chosen)))]

    def _log_joint(self, chosen: Sequence[int]) -> np.ndarray:
        return np.array([one.solve(chosen)[2] for one in self.posteriors]) + self.log_prior


@dataclass(frozen=True)
class Cause:
    """An effect that the parts share."""

    # Which.
    effect: str
    parameter: str
    unit: str
    # Its amplitude and the standard deviation of it.
    value: float
    sd: float
    probability: float  # that one of ``members`` acts, given what was accepted before
    # Effects that these readings cannot distinguish from it, itself first.
    members: tuple[str, ...]
    all_parts: float  # its distance from zero in standard deviations, all parts together

    @property
    def sentence(self) -> str:
        """The cause in a line."""
        name = with_others(list(map(effect_name, self.members)))
        size = f'{self.value:.3g} ± {self.sd:.2g} {unit_words(self.unit)}'.rstrip()
        return (
            f'{name}: {parameter_words(self.parameter, self.unit)} {size}; '
            f'{self.all_parts:.1f} standard deviations over all parts'
        )


@dataclass(frozen=True)
class Pooled:
    """What the parts share."""

    causes: tuple[Cause, ...]  # accepted effects, in the order found
    posterior: LinePosterior  # with the most probable scales given them
    chosen: tuple[int, ...]  # numbers of their amplitudes

    @cached_property
    def _mean(self) -> np.ndarray:
        return self.posterior.solve(self.chosen)[0]

    @property
    def amplitude_means(self) -> np.ndarray:
        """Mean of the chosen amplitudes, in their typical sizes."""
        return self._mean[self.posterior.statistics.shared :]

    def shared_um(self, part: Measured, place_of: np.ndarray) -> np.ndarray:
        """(P,) what of a part's residuals is shared [um], for the places of its points."""
        pattern, misfit = np.split(
            self._mean[: self.posterior.statistics.shared], [part.by_pattern.shape[1]]
        )
        effects = part.by_effect[:, list(self.chosen)] @ self.amplitude_means
        return part.by_pattern @ pattern + part.predicted_um * misfit[place_of] + effects


def pooled(parts: Sequence[Measured], pattern: PatternVector = ONE_BRUSH) -> Pooled:
    """Find the effects that the parts share; ``pattern`` is that of the model, of all brushes."""
    statistics = SufficientStatistics.of(parts, pattern)
    names = amplitudes()
    chosen: tuple[int, ...] = ()
    mixture = MisfitMixture.fitted(statistics, chosen)
    causes: list[Cause] = []
    while len(causes) < MOST_ACCEPTED:
        left = [k for k, (e, _) in enumerate(names) if e not in {names[c][0] for c in chosen}]
        best = max(left, key=lambda k: mixture.evidence((*chosen, k)))
        fitted = MisfitMixture.fitted(statistics, (*chosen, best))
        each = np.array([fitted.evidence((*chosen, k)) for k in left])
        # Prior: nothing (more) acts with probability 1/2, else one of the effects, all alike.
        log_odds = logsumexp(each) - np.log(len(left)) - mixture.evidence(chosen)
        probability = float(1.0 / (1.0 + np.exp(-log_odds)))
        if probability < ACCEPTANCE:
            break
        order = np.argsort(-each)
        near = [left[k] for k in order if each[k] > each[order[0]] - INDISTINGUISHABLE]
        chosen = (*chosen, near[0])
        mixture = fitted if near[0] == best else MisfitMixture.fitted(statistics, chosen)
        members = tuple(dict.fromkeys(names[k][0] for k in near))
        posterior = mixture.most_probable(chosen)
        causes.append(_cause(posterior, chosen, probability, members))
    return Pooled(tuple(causes), mixture.most_probable(chosen), chosen)


def _cause(
    posterior: LinePosterior, chosen: tuple[int, ...], probability: float, members: tuple[str, ...]
) -> Cause:
    mean, covariance, _ = posterior.solve(chosen)
    value, sd = float(mean[-1]), float(np.sqrt(covariance[-1, -1]))
    effect, parameter = amplitudes()[chosen[-1]]
    info = EFFECTS[effect].parameters()[parameter]
    return Cause(
        effect, parameter, info['unit'], info['neutral'] + info['typical'] * value,
        info['typical'] * sd, probability, members, abs(value) / sd,
    )  # fmt: skip
