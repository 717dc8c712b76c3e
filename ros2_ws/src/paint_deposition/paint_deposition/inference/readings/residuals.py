"""Residuals of gauge readings and the statistics of them that every result quotes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import chdtrc

from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM


def root_mean_square(values: np.ndarray) -> float:
    """Root mean square of some values, 0 if there are none."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def beyond_noise_um(rmse_um: float, noise_um: float) -> float:
    """What an error is without the noise in it [um], 0 if that explains all of it."""
    return float(np.sqrt(max(rmse_um**2 - noise_um**2, 0.0)))


@dataclass(frozen=True)
class Residuals:
    """Measured and predicted film; residual = measured minus predicted."""

    # (N,) films [um].
    measured_um: np.ndarray
    predicted_um: np.ndarray
    sigma_um: np.ndarray  # (N,) standard deviations of the measurements [um]

    def __len__(self) -> int:
        return len(self.measured_um)

    def select(self, rows: np.ndarray | slice) -> 'Residuals':
        """The chosen rows, by mask or indices."""
        return Residuals(self.measured_um[rows], self.predicted_um[rows], self.sigma_um[rows])

    @property
    def residual_um(self) -> np.ndarray:
        """(N,) measured minus predicted [um]."""
        return self.measured_um - self.predicted_um

    @property
    def bias_um(self) -> float:
        """Mean residual [um]."""
        return float(self.residual_um.mean())

    @property
    def rmse_um(self) -> float:
        """Root mean square residual [um]."""
        return root_mean_square(self.residual_um)

    @property
    def painted(self) -> np.ndarray:
        """(N,) whether the model predicts paint there."""
        return self.predicted_um > DEFAULT_PAINTED_ABOVE_UM

    @property
    def rmse_painted_um(self) -> float:
        """Root mean square residual where the model predicts paint [um], 0 if nowhere."""
        return self.select(self.painted).rmse_um

    @property
    def sd_um(self) -> float:
        """Sample standard deviation of the residuals, with N - 1 [um]; 0 for a single one."""
        return float(self.residual_um.std(ddof=1)) if len(self) > 1 else 0.0

    @property
    def chi_square(self) -> float:
        """Sum of squared residuals, each over its standard deviation."""
        whitened = self.residual_um / self.sigma_um
        return float(whitened @ whitened)

    @property
    def chi_square_per_reading(self) -> float:
        """About 1 where only the gauge's noise is left."""
        return self.chi_square / len(self)

    @property
    def p_value(self) -> float:
        """Probability that noise alone gives at least this chi-square."""
        return float(chdtrc(len(self), self.chi_square))

    @property
    def worst(self) -> int:
        """Row of the residual that is largest in magnitude."""
        return int(np.argmax(np.abs(self.residual_um)))

    def figures(self) -> dict[str, Any]:
        """The statistics as results name them."""
        return {
            'readings': len(self),
            'bias_um': self.bias_um,
            'rmse_um': self.rmse_um,
            'std_um': self.sd_um,
            'chi_square_per_reading': self.chi_square_per_reading,
            'p_value': self.p_value,
        }


def is_worse(before: Residuals, after: Residuals) -> bool:
    """Whether a model is further off the same readings by more than their noise explains."""
    noise_um = root_mean_square(before.sigma_um)
    return after.rmse_um > before.rmse_um + noise_um * np.sqrt(2.0 / len(before))
