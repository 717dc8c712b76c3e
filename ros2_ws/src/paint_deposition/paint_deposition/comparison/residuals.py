"""What readings and a film differ by, in figures."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM


@dataclass(frozen=True)
class Residuals:
    """Readings against predictions; residual = measured minus predicted.

    Attributes:
        positions_m: (N, 3) of the readings [m].
        predicted_um: (N,) [um].
        residual_um: (N,) [um].
        sigma_um: (N,) standard deviation of each reading [um].
    """

    positions_m: np.ndarray
    predicted_um: np.ndarray
    residual_um: np.ndarray
    sigma_um: np.ndarray

    @property
    def painted(self) -> np.ndarray:
        """(N,) whether the model predicts paint there."""
        return self.predicted_um > DEFAULT_PAINTED_ABOVE_UM

    @property
    def bias_um(self) -> float:
        """Mean residual [um]."""
        return float(self.residual_um.mean())

    @property
    def rmse_um(self) -> float:
        """Root mean square residual [um]."""
        return _root_mean_square(self.residual_um)

    @property
    def rmse_painted_um(self) -> float:
        """Root mean square residual where the model predicts paint [um], 0 if nowhere."""
        return _root_mean_square(self.residual_um[self.painted])

    @property
    def chi_square_per_reading(self) -> float:
        """Mean square of residual over sigma; 1 is the gauge's noise alone."""
        return float(np.mean((self.residual_um / self.sigma_um) ** 2))

    @property
    def worst(self) -> int:
        """Row of the residual that is largest in magnitude."""
        return int(np.argmax(np.abs(self.residual_um)))


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
