"""The gauge's noise: from repeats where there are any, else stated or assumed."""

from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.readings.outliers import (
    ASSUMED_FREEDOM,
    ENOUGH_REPEATS,
    gross_outliers,
    usual_noise_um,
)
from paint_deposition.readings.readings import PointMeans, Readings


@dataclass(frozen=True)
class GaugeNoise:
    """Standard deviation of one reading.

    Attributes:
        sigma_um: (N,) of each reading [um].
        source: 'repeats', 'stated' or 'assumed'.
        degrees_of_freedom: of the estimate; inf where stated, few where assumed.
        gross: (N,) readings that contradict others at their point; the noise is without them.
    """

    sigma_um: np.ndarray
    source: str
    degrees_of_freedom: float
    gross: np.ndarray

    @property
    def typical_um(self) -> float:
        """Root mean square over the readings [um]."""
        return float(np.sqrt(np.mean(self.sigma_um**2)))

    def without_gross(self) -> 'GaugeNoise':
        """Of the other readings."""
        kept = ~self.gross
        return replace(self, sigma_um=self.sigma_um[kept], gross=self.gross[kept])


def gauge_noise(readings: list[Readings]) -> GaugeNoise:
    """Noise of all readings of a campaign, in their order, taken with one gauge.

    Stated values win. For the others the shape of a usual gauge, sqrt(0.7^2 + (0.01 T)^2) um, is
    scaled to the pooled scatter of their repeats, gross outliers left out; without enough of
    those it is assumed as it is.
    """
    stated = np.concatenate([r.sigma_um for r in readings])
    thickness = np.concatenate([r.thickness_um for r in readings])
    gross = gross_outliers(readings)
    if np.isfinite(stated).all():
        return GaugeNoise(stated, 'stated', np.inf, gross)
    usual = usual_noise_um(thickness)
    squares, freedom, start = 0.0, 0, 0
    for part in readings:
        counted = np.isnan(part.sigma_um) & ~gross[start : start + len(part)]
        start += len(part)
        part = part.select(counted)
        means = PointMeans.of(part)
        shape = usual_noise_um(means.mean_um[means.owner])
        deviations = (part.thickness_um - means.mean_um[means.owner]) / shape
        squares += float(np.sum(deviations**2))
        freedom += len(part) - len(means.first)
    if freedom < ENOUGH_REPEATS or squares == 0.0:
        sigma = np.where(np.isfinite(stated), stated, usual)
        return GaugeNoise(sigma, 'assumed', ASSUMED_FREEDOM, gross)
    scaled = usual * np.sqrt(squares / freedom)
    sigma = np.where(np.isfinite(stated), stated, scaled)
    return GaugeNoise(sigma, 'repeats', float(freedom), gross)
