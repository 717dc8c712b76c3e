"""The gauge's noise: from repeats where there are any, else stated or assumed."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.inference.readings import PointMeans, Readings

# A usual magnetic or eddy-current gauge, for readings that say nothing of their noise.
ASSUMED_FLOOR_UM = 0.7
ASSUMED_SHARE = 0.01
# Fewer degrees of freedom from repeats than this are not trusted alone.
ENOUGH_REPEATS = 6
# An assumed noise is trusted like one from this many repeats: it may be off by a third.
ASSUMED_FREEDOM = 5.0


@dataclass(frozen=True)
class GaugeNoise:
    """Standard deviation of one reading.

    Attributes:
        sigma_um: (N,) of each reading [um].
        source: 'repeats', 'stated' or 'assumed'.
        degrees_of_freedom: of the estimate; inf where stated, few where assumed.
    """

    sigma_um: np.ndarray
    source: str
    degrees_of_freedom: float

    @property
    def typical_um(self) -> float:
        """Root mean square over the readings [um]."""
        return float(np.sqrt(np.mean(self.sigma_um**2)))


def gauge_noise(readings: list[Readings]) -> GaugeNoise:
    """Noise of all readings of a campaign, in their order, taken with one gauge.

    Stated values win. For the others the shape of a usual gauge, sqrt(0.7^2 + (0.01 T)^2) um, is
    scaled to the pooled scatter of their repeats; without enough of those it is assumed as it is.
    """
    stated = np.concatenate([r.sigma_um for r in readings])
    thickness = np.concatenate([r.thickness_um for r in readings])
    if np.isfinite(stated).all():
        return GaugeNoise(stated, 'stated', np.inf)
    usual = np.hypot(ASSUMED_FLOOR_UM, ASSUMED_SHARE * thickness)
    squares, freedom = 0.0, 0
    for part in readings:
        part = part.select(np.isnan(part.sigma_um))
        means = PointMeans.of(part)
        shape = np.hypot(ASSUMED_FLOOR_UM, ASSUMED_SHARE * means.mean_um[means.owner])
        deviations = (part.thickness_um - means.mean_um[means.owner]) / shape
        squares += float(np.sum(deviations**2))
        freedom += len(part) - len(means.first)
    if freedom < ENOUGH_REPEATS or squares == 0.0:
        sigma = np.where(np.isfinite(stated), stated, usual)
        return GaugeNoise(sigma, 'assumed', ASSUMED_FREEDOM)
    scaled = usual * np.sqrt(squares / freedom)
    return GaugeNoise(np.where(np.isfinite(stated), stated, scaled), 'repeats', float(freedom))
