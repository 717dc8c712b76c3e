"""Outliers among single readings, and how readings scatter about anything smooth.

A typing error, a display misread, a reading on bare metal contradicts all that its neighbours and
the model say. A point that was read several times agrees with itself or is checked by its repeats.

Nothing is assumed of what the model lacks but that neighbours share it: neighbours on the part, or
readings alike in one covariate. The misfit of the pattern, of every size of such a field, and of
every texture of the film together form a mixture of normal models (a Gaussian process with its
hyperparameters integrated over a grid). Each predicts every reading from all the others in
closed form (Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, section 5.4.2).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.special import expit, logsumexp
from scipy.stats import norm

from paint_deposition.inference.fitting.random_effects import root_of_field
from paint_deposition.inference.readings.covariates import varies

# The film's texture, as a share of it: what is usual, within a factor of two, and what may be.
USUAL_TEXTURE = 0.01
TEXTURES = np.array([0.001, 0.003, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.03, 0.045])
# Sizes of a field as a share of the film.
SHARES = (0.03, 0.1, 0.3)
# Directions of a field below this share of the largest variance are left out.
NEGLIGIBLE = 1e-3


@dataclass(frozen=True)
class FittedPoints:
    """Readings beside a fitted model, and each of them as M models predict it from the others."""

    residual_um: np.ndarray  # (P,) measured minus predicted
    predicted_um: np.ndarray  # (P,)
    gauge_um: np.ndarray  # (P,) standard deviation of the points without the film's texture
    free_um: np.ndarray  # (P, n) directions in which the model may be off, for unit amplitudes
    experiment_of: np.ndarray  # (P,) part of each point
    positions_m: np.ndarray  # (P, 3)
    covariates: Mapping[str, np.ndarray]  # (P,) each, by name

    @cached_property
    def leave_one_out(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(M,) logarithm of prior share times likelihood, and (M,) texture of each model.

        Then (M, P) residual that the other readings predict, and its standard deviation [um].
        """
        log_prior = norm.logpdf(np.log(TEXTURES / USUAL_TEXTURE) / np.log(2.0))
        found, residual = [], self.residual_um
        for field, log_share in _fields(self):
            directions = np.hstack([self.free_um, field])
            for texture, log_texture in zip(TEXTURES, log_prior, strict=True):
                variance = self.gauge_um**2 + (texture * self.predicted_um) ** 2
                solved, log_det = _solved(variance, directions)
                weighted = residual / variance - solved.T @ (solved @ residual)
                diagonal = 1.0 / variance - np.sum(solved**2, axis=0)
                likelihood = float(-0.5 * (residual @ weighted + log_det))
                mean, sigma = residual - weighted / diagonal, diagonal**-0.5
                found.append((likelihood + log_share + log_texture, texture, mean, sigma))
        log_weight, textures, mean, sigma = (np.array(of) for of in zip(*found, strict=True))
        return log_weight, textures, mean, sigma

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the likelihood of the readings, averaged over the models."""
        return float(logsumexp(self.leave_one_out[0]))

    @property
    def texture_share(self) -> float:
        """Posterior mean of the texture, as a share of the film."""
        log_weight, texture, *_ = self.leave_one_out
        return float(np.sum(np.exp(log_weight - self.log_likelihood) * texture))

    @property
    def log_density(self) -> np.ndarray:
        """(P,) logarithm of the density that the other readings predict for each [1/um]."""
        log_weight, _, expected_um, sigma_um = self.leave_one_out
        own = norm.logpdf(self.residual_um, expected_um, sigma_um)
        return self.log_likelihood - logsumexp(log_weight[:, np.newaxis] - own, axis=0)

    def predicted_by_others(self, row: int) -> tuple[float, float]:
        """Residual that the other readings predict for one, and its standard deviation [um]."""
        log_weight, _, expected_um, sigma_um = self.leave_one_out
        expected_um, sigma_um = expected_um[:, row], sigma_um[:, row]
        log_weight = log_weight - norm.logpdf(self.residual_um[row], expected_um, sigma_um)
        weight = np.exp(log_weight - logsumexp(log_weight))
        mean = float(weight @ expected_um)
        square = float(weight @ (sigma_um**2 + expected_um**2))
        return mean, float(np.sqrt(square - mean**2))

    def select(self, rows: np.ndarray) -> 'FittedPoints':
        """Some of the readings."""
        names = [one.name for one in fields(self) if one.name != 'covariates']
        arrays: dict[str, Any] = {name: getattr(self, name)[rows] for name in names}
        some = {name: values[rows] for name, values in self.covariates.items()}
        return replace(self, covariates=some, **arrays)


def _solved(variance: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, float]:
    """What their product (P, P) takes off the inverse variances, (n, P), and the determinant."""
    over = directions / variance[:, np.newaxis]
    factor = cholesky(np.eye(directions.shape[1]) + directions.T @ over, lower=True)
    log_det = np.log(variance).sum() + 2.0 * np.log(np.diag(factor)).sum()
    return solve_triangular(factor, over.T, lower=True), float(log_det)


def _fields(misfit: FittedPoints) -> Iterator[tuple[np.ndarray, float]]:
    """Directions (P, n) of what may be missing [um], and the logarithm of its prior share.

    Nothing; a field over the part; over one covariate; over all of them at once.
    """
    # Where the pattern is thin, a field is as large as where the film is this share of the mean.
    film = np.hypot(misfit.predicted_um, 0.2 * np.mean(misfit.predicted_um))[:, np.newaxis]
    # Places on parts so far from each other have nothing in common [m].
    apart = np.column_stack([misfit.positions_m, 1e6 * misfit.experiment_of])
    # Lengths of correlation: over the part [m], over a covariate in its standard deviations.
    over_part = [root_of_field(apart, length, NEGLIGIBLE) for length in (0.1, 0.25)]
    differing = [values for values in misfit.covariates.values() if varies(values)]
    scaled = [(values - values.mean()) / values.std() for values in differing]
    over = [root_of_field(values, 0.5, NEGLIGIBLE) for values in scaled]
    every = np.hstack([over_part[-1], *over])
    roots = [*over_part, *over, every]
    yield np.empty((len(film), 0)), np.log(0.5)
    for root in roots:
        for share in SHARES:
            yield share * film * root, np.log(0.5 / len(roots) / len(SHARES))


# Prior probability of an outlier, and the posterior one from which a reading counts as one.
PRIOR_PROBABILITY, LEAST_PROBABILITY = 0.01, 0.9
# Fewer points predict each other too poorly.
FEWEST_POINTS = 20
# A corrected value is proposed if it is within this many standard deviations of the expected one.
GUESS_SIGMAS = 3.0
# A neighbour that is off the same way by more standard deviations shows a feature of the part.
NEIGHBOUR_SIGMAS = 3.0


@dataclass(frozen=True)
class Outlier:
    """A reading that was left out, and what model and other readings predict there."""

    point: str  # its label, which names the part
    thickness_um: float  # as it was given
    # What the model and the other readings predict there.
    expected_um: float
    sigma_um: float
    # Label and reading of the point that it looks swapped with, if it does.
    swapped_with: str | None = None
    swapped_um: float | None = None

    @property
    def guess_um(self) -> float | None:
        """What was probably read: another point's, or a decimal point or two digits are wrong."""
        if self.swapped_um is not None:
            return self.swapped_um
        guess = min(_miswritten(self.thickness_um), key=lambda v: abs(v - self.expected_um))
        return guess if abs(guess - self.expected_um) < GUESS_SIGMAS * self.sigma_um else None

    def __str__(self) -> str:
        meant = '' if self.guess_um is None else f' ({self.guess_um:.4g}?)'
        which, remedy = f"point '{self.point}'", 'measure there again'
        if self.swapped_with is not None:
            which = f"points '{self.point}' and '{self.swapped_with}' look swapped"
            remedy = 'exchange them, or measure there again'
        return (
            f'{which}: {self.thickness_um:.4g} µm where model and neighbours say '
            f'{self.expected_um:.4g} ± {self.sigma_um:.2g} µm{meant}; left out of the fit, '
            f'{remedy}'
        )

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``left_out`` in the files of results."""
        names = ('point', 'thickness_um', 'expected_um', 'sigma_um', 'guess_um', 'swapped_with')
        return {name: getattr(self, name) for name in names}


Expected = tuple[float, float, int | None]


def find_outliers(misfit: FittedPoints, single: np.ndarray) -> dict[int, Expected]:
    """Outliers by their row: the residual that the others predict, its error [um], and the row of
    the point whose reading stands there, if two look swapped.

    The most certain one is taken out first, since outliers hide each other and widen what is
    expected of sound readings.

    Args:
        single: (P,) whether a point was read only once.
    """
    count = len(single)
    kept = np.arange(count)
    found: dict[int, Expected] = {}
    if count < FEWEST_POINTS:
        return {}
    film, left = np.mean(misfit.predicted_um), misfit
    prior = np.log(PRIOR_PROBABILITY / (1.0 - PRIOR_PROBABILITY))
    while True:
        # Nothing is known of an outlier but that it is a number of the size of the film.
        wild = -np.log(np.pi * film * (1.0 + (left.residual_um / film) ** 2))  # Cauchy's.
        wild = np.where(single[kept], prior + wild, -np.inf)
        log_odds = wild - left.log_density
        worst = int(np.argmax(log_odds))
        out: dict[int, Expected] = {
            row: (*expected, int(kept[other]))
            for row, (expected, other) in _swapped(left, wild, log_odds).items()
        }
        if not out and expit(log_odds[worst]) >= LEAST_PROBABILITY:
            out = {worst: (*left.predicted_by_others(worst), None)}
        if not out:
            return _without_features(misfit, found, left, kept)
        # A greater share of outliers means that the model is at fault.
        if len(found) + len(out) > max(0.05 * count, len(out)):
            return {}
        found |= {int(kept[row]): expected for row, expected in out.items()}
        kept = np.delete(kept, list(out))
        left = misfit.select(kept)


def _without_features(
    misfit: FittedPoints, found: dict[int, Expected], left: FittedPoints, kept: np.ndarray
) -> dict[int, Expected]:
    """Outliers by their row, without those beside which the part is off the same way.

    Slips do not lie next to each other: there the part has a feature, such as a stripe. What is
    off by more than half the film is a slip wherever it lies.

    Args:
        left: the others, which are the rows ``kept`` of all.
    """
    slips = found
    for row, (mean_um, _, other) in found.items():
        off_um = misfit.residual_um[row] - mean_um
        if abs(off_um) > 0.5 * misfit.predicted_um[row]:
            continue
        own = np.flatnonzero(misfit.experiment_of == misfit.experiment_of[row])
        away_m = np.linalg.norm(misfit.positions_m[own] - misfit.positions_m[row], axis=1)
        # Its four nearest neighbours on the part, after itself.
        for near in own[np.argsort(away_m)[1:5]]:
            if near in found:
                expected_um, sigma_um, _ = found[near]
            else:
                there = int(np.searchsorted(kept, near))
                expected_um, sigma_um = left.predicted_by_others(there)
            away = (misfit.residual_um[near] - expected_um) / sigma_um
            if away * np.sign(off_um) > NEIGHBOUR_SIGMAS:
                slips = {k: v for k, v in slips.items() if k not in (row, other)}
    return slips


def _swapped(
    misfit: FittedPoints, wild: np.ndarray, log_odds: np.ndarray
) -> dict[int, tuple[tuple[float, float], int]]:
    """Two rows of a part whose readings more probably stand in each other's place, or none.

    Args:
        wild: (P,) logarithm of prior and density of each as an outlier.
        log_odds: (P,) that each is one.

    Returns:
        Of each what the others predict, as ``predicted_by_others``, and the other row.
    """
    gain, i, j = _best_swap(misfit)
    if gain < 8.0:
        return {}
    residual_um = misfit.residual_um.copy()
    more_um = misfit.predicted_um[j] + residual_um[j] - misfit.predicted_um[i] - residual_um[i]
    residual_um[[i, j]] += more_um, -more_um
    swapped = replace(misfit, residual_um=residual_um)
    found = {i: (swapped.predicted_by_others(i), j), j: (swapped.predicted_by_others(j), i)}
    for row, ((mean, sigma), _) in found.items():
        if abs(swapped.residual_um[row] - mean) > GUESS_SIGMAS * sigma:
            return {}
    pairs = 0.5 * len(wild) * (len(wild) - 1)
    likelihood = misfit.log_likelihood
    others = misfit.select(np.delete(np.arange(len(wild)), [i, j])).log_likelihood
    both_out = wild[i] + wild[j] + np.log(2.0 * np.pi) + others - likelihood
    # Prior probability that two readings of a campaign are swapped.
    as_swapped = np.log(0.02 / pairs) + swapped.log_likelihood - likelihood
    slips = log_odds[i], log_odds[j], both_out
    # Whatever is wrong with the two, both are left out; what is most probable is said.
    sure = expit(logsumexp([as_swapped, *slips])) >= LEAST_PROBABILITY
    return found if sure and as_swapped > max(slips) else {}


def _best_swap(misfit: FittedPoints) -> tuple[float, int, int]:
    """By how much the logarithm of the likelihood gains most if two readings swap, and which.

    The texture is the usual one; the field may be another one after the swap than before.
    """
    film, residual = misfit.predicted_um + misfit.residual_um, misfit.residual_um
    variance = misfit.gauge_um**2 + (USUAL_TEXTURE * misfit.predicted_um) ** 2
    more = film - film[:, np.newaxis]  # what each row would gain from each column
    same_part = misfit.experiment_of == misfit.experiment_of[:, np.newaxis]
    before, best = -np.inf, (-np.inf, 0, 0)
    for field, log_share in _fields(misfit):
        solved, log_det = _solved(variance, np.hstack([misfit.free_um, field]))
        weighted = residual / variance - solved.T @ (solved @ residual)
        precision = np.diag(1.0 / variance) - solved.T @ solved
        own = np.diag(precision)
        apart = own[:, np.newaxis] + own - 2.0 * precision
        gain = -more * (weighted[:, np.newaxis] - weighted) - 0.5 * more**2 * apart
        i, j = np.unravel_index(np.argmax(np.where(same_part, gain, -np.inf)), gain.shape)
        likelihood = log_share - 0.5 * (residual @ weighted + log_det)
        before = max(before, likelihood)
        best = max(best, (float(likelihood + gain[i, j]), int(i), int(j)))
    return best[0] - float(before), *best[1:]


def _miswritten(value: float) -> list[float]:
    """Numbers that become this one by a shifted decimal point or two digits exchanged."""
    text = f'{value:.6g}'
    exchanged = [
        text[:k] + text[k + 1] + text[k] + text[k + 2 :]
        for k in range(len(text) - 1)
        if text[k : k + 2].isdigit()
    ]
    return [value / 10.0, value * 10.0, value / 100.0, value * 100.0, *map(float, exchanged)]
