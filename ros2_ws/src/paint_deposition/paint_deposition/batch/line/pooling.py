"""What many parts say together: a pattern and a misfit that they share, a level of each.

The readings of part i are linear about the model,

    y_i = J_i b + f_i (l_i + g) + M_i a + e_i,

with the pattern's change b, the level l_i of the part (standard deviation tau), a misfit g of
each place of the part as a share of the film f_i, amplitudes a of effects, and noise e_i. All are
normal, so that everything but tau, the scale of the noise and the size and width of the misfit
has a closed form (Gelman et al., Bayesian Data Analysis, 2013, chapters 5 and 15). The misfit
stands for all that no effect explains: without it any error of the model, seen often enough,
would be taken for an effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve
from scipy.special import logsumexp

from paint_deposition.batch.line.measured import Measured, places
from paint_deposition.inference.fitting.pattern_vector import PatternVector

LEVELS = np.geomspace(1e-3, 0.2, 24).tolist()
NOISES = np.geomspace(0.5, 3.0, 19).tolist()
# Size of the misfit as a share of the film, and how far it reaches over the part [m].
MISFITS = tuple(product((0.005, 0.01, 0.02, 0.05, 0.1), (0.02, 0.1, 0.25)))
# Half of the belief before the readings is that there is no misfit.
NO_MISFIT = 0.5
ONE_BRUSH = PatternVector()


@dataclass(frozen=True)
class Sums:
    """The readings of all parts, summed up; K = k + F + A columns: pattern, places, effects.

    Attributes:
        gram: (K, K) columns over the noise, squared. score: (K,) columns with the residuals.
        square: of the residuals over the noise.
        level_gram: (n, K) of each part, its film with the columns; level_score: (n,) with the
            residuals; level_square: (n,) the film's square.
        count: of the readings. place_m: (F, 3) places [m].
        between_jobs: (k, k) covariance of the pattern's coordinates, of all brushes, before the
            readings.
    """

    gram: np.ndarray
    score: np.ndarray
    square: float
    level_gram: np.ndarray
    level_score: np.ndarray
    level_square: np.ndarray
    count: int
    place_m: np.ndarray
    between_jobs: np.ndarray

    @staticmethod
    def of(parts: Sequence[Measured], pattern: PatternVector = ONE_BRUSH) -> Sums:
        """Sum up; at least one part."""
        place_m, place_of = places(parts)
        first, gram = 0, np.zeros(())
        rows: dict[str, list] = {name: [] for name in ('score', 'gram', 'level', 'own', 'square')}
        for part in parts:
            here = place_of[first : first + len(part)]
            first += len(part)
            at_place = np.zeros((len(part), len(place_m)))
            at_place[np.arange(len(part)), here] = part.predicted_um
            columns = np.hstack([part.by_pattern, at_place, part.by_effect])
            columns = columns / part.sigma_um[:, np.newaxis]
            residual, film = part.residual_um / part.sigma_um, part.predicted_um / part.sigma_um
            gram = gram + columns.T @ columns
            rows['score'].append(columns.T @ residual)
            rows['gram'].append(film @ columns)
            rows['level'].append(film @ residual)
            rows['own'].append(film @ film)
            rows['square'].append(residual @ residual)
        return Sums(
            gram, np.sum(rows['score'], axis=0), float(np.sum(rows['square'])),
            np.array(rows['gram']), np.array(rows['level']), np.array(rows['own']),
            first, place_m, pattern.between_jobs,
        )  # fmt: skip

    @property
    def shared(self) -> slice:
        """Columns of the pattern and the places."""
        return slice(0, len(self.between_jobs) + len(self.place_m))

    def column(self, amplitude: int) -> int:
        """Of an amplitude of the catalogue."""
        return self.shared.stop + amplitude


@dataclass(frozen=True)
class Scales:
    """What has no closed form.

    Attributes:
        level: standard deviation of the parts' levels, as a share. noise: on the stated noise.
        misfit: size and width of the misfit, None for none.
    """

    level: float
    noise: float
    misfit: tuple[float, float] | None


@dataclass(frozen=True)
class Pool:
    """The readings with the levels of the parts integrated out, for some scales."""

    sums: Sums
    scales: Scales

    @cached_property
    def _levelled(self) -> tuple[np.ndarray, np.ndarray, float]:
        sums, precision = self.sums, 1.0 / self.scales.noise**2
        weight = self.scales.level**2 / (
            1.0 + self.scales.level**2 * precision * sums.level_square
        ) * precision**2  # fmt: skip
        weighted = weight[:, np.newaxis] * sums.level_gram
        gram = precision * sums.gram - sums.level_gram.T @ weighted
        score = precision * sums.score - weighted.T @ sums.level_score
        square = precision * sums.square - weight @ sums.level_score**2
        return gram, score, float(square)

    @cached_property
    def _prior(self) -> np.ndarray:
        """Precision of pattern and places."""
        return block_diag(np.linalg.inv(self.sums.between_jobs), np.linalg.inv(self._field))

    @cached_property
    def _field(self) -> np.ndarray:
        """(F, F) covariance of the misfit at the places."""
        size, width_m = self.scales.misfit or (1e-6, 1e-3)
        apart = np.linalg.norm(
            self.sums.place_m[:, np.newaxis] - self.sums.place_m[np.newaxis], axis=2
        )
        smooth = np.exp(-0.5 * (apart / width_m) ** 2)
        return size**2 * (smooth + 1e-3 * np.eye(len(apart)))

    def solved(self, chosen: Sequence[int] = ()) -> tuple[np.ndarray, np.ndarray, float]:
        """Mean (k,) and covariance (k, k) of pattern, places and these amplitudes; log evidence.

        Amplitudes are standard normal before the readings, in their typical sizes.
        """
        gram, score, square = self._levelled
        rows = [*range(self.sums.shared.stop), *(self.sums.column(one) for one in chosen)]
        prior = np.eye(len(rows))
        shared = self.sums.shared.stop
        prior[:shared, :shared] = self._prior
        posterior = gram[np.ix_(rows, rows)] + prior
        factor = cho_factor(posterior, lower=True)
        mean = cho_solve(factor, score[rows])
        log_det = 2.0 * np.log(np.diag(factor[0])).sum()
        log_prior = self._log_det_prior
        levels = np.log1p(
            self.scales.level**2 * self.sums.level_square / self.scales.noise**2
        ).sum()
        evidence = -0.5 * (
            square - score[rows] @ mean + log_det - log_prior + levels
            + 2.0 * self.sums.count * np.log(self.scales.noise)
        )  # fmt: skip
        return mean, cho_solve(factor, np.eye(len(rows))), float(evidence)

    @cached_property
    def _log_det_prior(self) -> float:
        blocks = (self.sums.between_jobs, self._field)
        return -sum(float(np.linalg.slogdet(block)[1]) for block in blocks)


def pools(sums: Sums) -> tuple[list[Pool], np.ndarray]:
    """A pool for each misfit that is considered, with the logarithm of its prior share.

    Level and noise are set to what makes the readings most likely, by turns.
    """
    misfits: list[tuple[float, float] | None] = [None, *MISFITS]
    scales = Scales(0.02, 1.0, None)
    for _ in range(2):
        for tried in (
            [replace(scales, misfit=misfit) for misfit in misfits],
            [replace(scales, noise=noise) for noise in NOISES],
            [replace(scales, level=level) for level in LEVELS],
        ):
            scales = max(tried, key=lambda one: Pool(sums, one).solved()[2])
    found = [Pool(sums, replace(scales, misfit=misfit)) for misfit in misfits]
    share = np.log((1.0 - NO_MISFIT) / len(MISFITS))
    return found, np.array([np.log(NO_MISFIT), *[share] * len(MISFITS)])


def evidence(found: list[Pool], log_share: np.ndarray, chosen: Sequence[int]) -> float:
    """Logarithm of the probability of the readings with these amplitudes, misfits weighed."""
    return float(logsumexp([pool.solved(chosen)[2] for pool in found] + log_share))


def likeliest(found: list[Pool], log_share: np.ndarray, chosen: Sequence[int]) -> Pool:
    """The pool with the likeliest misfit."""
    values = [pool.solved(chosen)[2] for pool in found] + log_share
    return found[int(np.argmax(values))]
