"""How far the pattern of a job lies from the one that was calibrated before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from paint_deposition.inference.fitting.least_squares import Fit

# Of jobs that differ as assumed this share lies nearer than what is called usual, and this share
# nearer than what is warned of.
USUAL, ALARMING = 0.95, 0.999


@dataclass(frozen=True)
class PatternShift:
    """Distance between the fitted pattern and the calibrated one."""

    # Mahalanobis distance, in standard deviations of what was known before: the calibration's
    # posterior, widened by what differs between jobs.
    distance: float
    by_coordinate: dict[str, float]  # signed, of each coordinate alone

    @staticmethod
    def of(fit: Fit) -> PatternShift | None:
        """Of a fit; None where no readings stand behind what is known."""
        known, pattern = fit.parameters.known, fit.parameters.pattern
        if known is None or not known.readings:
            return None
        prior, count = fit.parameters.prior, len(pattern)
        # The pattern comes first, and the factor is lower triangular: this is its marginal.
        away = prior.whiten(fit.vector)[:count]
        single = ((fit.vector - prior.centre) / prior.width)[:count]
        names = (coordinate.name for coordinate in pattern.coordinates)
        return PatternShift(
            float(np.linalg.norm(away)), dict(zip(names, map(float, single), strict=True))
        )

    @property
    def usual(self) -> float:
        """Distance that 95 % of jobs stay below if they differ as assumed."""
        return float(np.sqrt(chdtri(len(self.by_coordinate), 1.0 - USUAL)))

    @property
    def is_alarming(self) -> bool:
        """Whether hardly any job differs as much."""
        return bool(self.distance > np.sqrt(chdtri(len(self.by_coordinate), 1.0 - ALARMING)))

    def __str__(self) -> str:
        name, most = max(self.by_coordinate.items(), key=lambda item: abs(item[1]))
        return (
            f'{self.distance:.1f} standard deviations from the calibration, most in {name} '
            f'({most:+.1f}); 95 % of jobs stay below {self.usual:.1f}'
        )

    @property
    def warning(self) -> str:
        """What to do about one that is alarming."""
        return (
            f'The pattern moved {self}: far more than jobs differ. Check that bell, settings and '
            'part frame are those of the calibration, or calibrate anew.'
        )

    def to_dict(self) -> dict[str, object]:
        """As in ``diagnosis.json``."""
        return {
            'standard_deviations': self.distance,
            'usual': self.usual,
            'by_coordinate': self.by_coordinate,
        }
