"""The gauge's noise: from repeats where there are any, else stated or assumed."""

from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.inference.readings.outliers import (
    ASSUMED_FREEDOM,
    ENOUGH_REPEATS,
    gross_outliers,
    usual_noise_um,
)
from paint_deposition.inference.readings.readings import PointMeans, Readings
from paint_deposition.inference.readings.residuals import root_mean_square


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
        return root_mean_square(self.sigma_um)

    def without_gross(self) -> 'GaugeNoise':
        """The noise of the readings that are no gross outliers."""
        return self.select(~self.gross)

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
    means = PointMeans.of(counted)
    film = means.mean_um[means.owner]
    squares = float(np.sum(((counted.thickness_um - film) / usual_noise_um(film)) ** 2))
    freedom = len(counted) - len(means.first)
    if freedom < ENOUGH_REPEATS or squares == 0.0:
        sigma = np.where(np.isfinite(stated), stated, usual)
        return GaugeNoise(sigma, 'assumed', ASSUMED_FREEDOM, gross)
    scaled = usual * np.sqrt(squares / freedom)
    sigma = np.where(np.isfinite(stated), stated, scaled)
    return GaugeNoise(sigma, 'repeats', float(freedom), gross)
