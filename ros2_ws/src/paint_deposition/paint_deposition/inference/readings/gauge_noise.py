"""The gauge's noise: from repeats where there are any, else stated or assumed.

Gross outliers among repeats are left out: one of them in twenty repeats can triple the mean
square, and a noise that is overestimated by so much hides every effect.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median
from scipy.special import ndtri, stdtrit

from paint_deposition.inference.readings.readings import Readings, root_mean_square

# Fewer degrees of freedom from repeats than this are not trusted alone.
ENOUGH_REPEATS = 6
# An assumed noise counts like an estimate with these degrees of freedom: it may be off by a third.
ASSUMED_FREEDOM = 5.0


def usual_noise_um(thickness_um: np.ndarray) -> np.ndarray:
    """(N,) standard deviation of a usual magnetic or eddy-current gauge at these films [um]."""
    return np.hypot(0.7, 0.01 * thickness_um)


def gross_outliers(readings: Readings) -> np.ndarray:
    """(N,) whether a reading contradicts the others at its point.

    Of three or more readings at a point, those far from their median are outliers; where no
    majority is left, as with two that disagree, all of them. The scale is pooled over all points;
    readings with a stated noise have a scale of their own.
    """
    stated, gross = readings.sigma_um, np.zeros(len(readings), dtype=bool)
    for pool in (np.isnan(stated), np.isfinite(stated)):
        if pool.any():
            gross[pool] = _gross(readings.select(pool))
    return gross


def left_out_lines(taken: Readings, used: np.ndarray) -> list[str]:
    """A line for each point at which some of several readings were left out.

    Args:
        used: (N,) whether they are used.
    """
    lines = []
    for label in dict.fromkeys(taken.point[~used]):
        here = taken.point == label
        if np.count_nonzero(here) == 1:
            continue
        out, kept = (
            ', '.join(f'{value:.4g}' for value in taken.thickness_um[here & which])
            for which in (~used, used)
        )
        lines.append(
            f"point '{label}': {out} µm{f' beside {kept}' if kept else ' contradict each other'}; "
            f'left out of the fit, measure {"it" if kept else "there"} again'
        )
    return lines


def _gross(readings: Readings) -> np.ndarray:
    """(N,) outliers of one gauge, from a robust scale and iterated until the set stays."""
    owner = readings.owner
    count = np.bincount(owner)
    middle = median(readings.thickness_um, owner, np.arange(len(count)))[owner]
    scaled = (readings.thickness_um - middle) / np.fmax(usual_noise_um(middle), readings.sigma_um)
    # From the point's median, or from the other of two, over its usual error.
    number = count[owner]
    error = np.sqrt(number / np.maximum(number - 1, 1))
    distance = np.where(number == 2, 2.0, 1.0) * np.abs(scaled) / error

    def beyond(scale: float, freedom: float) -> np.ndarray:
        # Where the standard deviation is estimated from few repeats, the limit is the quantile of
        # Student's t that sound readings exceed once in ten thousand.
        sigmas = max(5.0, -float(stdtrit(freedom, 0.5e-4)))
        # At least this share of the usual noise: a display in whole um shows many repeats without
        # any scatter.
        far = distance > sigmas * max(scale, 0.5)
        outliers = np.bincount(owner, far)
        undecided = 2.0 * outliers >= count
        return far | ((outliers > 0.0) & undecided)[owner]

    if len(owner) - len(count) < ENOUGH_REPEATS:
        return beyond(1.0, ASSUMED_FREEDOM)
    order = np.lexsort((distance, owner))
    # At each point one distance is redundant: half of a pair, or the median of three itself.
    own = np.diff(owner[order], prepend=-1) == 0
    # The median of the distances is consistent for normal noise.
    gross = beyond(float(np.median(distance[order][own]) / ndtri(0.75)), np.inf)
    for _ in range(20):
        # The scale of the kept readings, pooled within points, and its degrees of freedom.
        kept, before = ~gross, gross
        left = np.bincount(owner, kept)
        mean = np.bincount(owner, kept * scaled) / np.maximum(left, 1.0)
        freedom = max(float(np.maximum(left - 1.0, 0.0).sum()), 1.0)
        squares = float(np.sum(kept * (scaled - mean[owner]) ** 2))
        gross = beyond(np.sqrt(squares / freedom), freedom)
        if np.array_equal(before, gross):
            break
    return gross


@dataclass(frozen=True)
class GaugeNoise:
    """Standard deviation of one reading."""

    sigma_um: np.ndarray  # (N,) of each reading [um]
    source: str  # 'repeats', 'stated', 'assumed', or of a scan 'neighbours'
    degrees_of_freedom: float  # of the estimate; inf where stated, few where assumed
    # (N,) readings that contradict others at their point; the noise is without them.
    gross: np.ndarray

    @property
    def typical_um(self) -> float:
        """Root mean square over the readings [um]."""
        return root_mean_square(self.sigma_um)

    def select(self, rows: np.ndarray) -> 'GaugeNoise':
        """The noise of some of the readings, by mask or indices."""
        return replace(self, sigma_um=self.sigma_um[rows], gross=self.gross[rows])


def gauge_noise(readings: Readings) -> GaugeNoise:
    """Noise of all readings that were taken with one gauge.

    Stated values win. For the others the shape of a usual gauge, sqrt(0.7^2 + (0.01 T)^2) um, is
    scaled to the pooled scatter of their repeats, gross outliers left out; without enough of
    those it is assumed as it is.
    """
    stated = readings.sigma_um
    gross = gross_outliers(readings)
    if np.isfinite(stated).all():
        return GaugeNoise(stated, 'stated', np.inf, gross)
    usual = usual_noise_um(readings.thickness_um)
    counted = readings.select(np.isnan(stated) & ~gross)
    film = counted.mean_um[counted.owner]
    squares = float(np.sum(((counted.thickness_um - film) / usual_noise_um(film)) ** 2))
    freedom = len(counted) - len(counted.first)
    known = freedom >= ENOUGH_REPEATS and squares > 0.0
    scaled = usual * np.sqrt(squares / freedom) if known else usual
    sigma = np.where(np.isfinite(stated), stated, scaled)
    of = ('repeats', float(freedom)) if known else ('assumed', ASSUMED_FREEDOM)
    return GaugeNoise(sigma, *of, gross)
