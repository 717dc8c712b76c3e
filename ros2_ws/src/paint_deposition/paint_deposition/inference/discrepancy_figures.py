"""How far a model is from the readings beyond all laws and noise, in figures for people."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np


@dataclass(frozen=True)
class FootprintProfile:
    """The footprint from its middle outward, averaged over the angle, over the peak of eq. (1)."""

    radius_m: np.ndarray  # (n,) on the model plane [m]
    # (n,) of eq. (1), as the readings have it, and how well they know it.
    eq1: np.ndarray
    found: np.ndarray
    sd: np.ndarray

    def to_dict(self) -> dict[str, list[float]]:
        """Its figures, for JSON."""
        return {field.name: getattr(self, field.name).tolist() for field in fields(self)}


@dataclass(frozen=True)
class DiscrepancyFigures:
    """The discrepancy in a campaign, as far as its readings show it."""

    # By how much the film of a setting differs from any law, and parts of one setting from each
    # other, as shares of the thickest film.
    setting_share: float
    part_share: float
    length_m: float  # over which neighbours differ alike [m]
    # Largest deviation of the footprint from eq. (1) that shows, over its peak.
    footprint_of_peak: float
    profile: FootprintProfile  # of the footprint

    def to_dict(self) -> dict[str, float]:
        """Sizes and length, for JSON."""
        names = ('setting_share', 'part_share', 'length_m', 'footprint_of_peak')
        return {name: getattr(self, name) for name in names}

    @property
    def footprint(self) -> dict[str, Any]:
        """How far the footprint is from eq. (1), for JSON."""
        profile = self.profile.to_dict()
        return {'deviation_of_peak': self.footprint_of_peak, 'profile': profile}

    def __str__(self) -> str:
        setting, peak = 100.0 * self.setting_share, 100.0 * self.footprint_of_peak
        parts = f', parts painted alike by {100.0 * self.part_share:.1f} %'
        footprint = (
            f'the footprint differs from two Gaussians by {peak:.0f} % of its peak'
            if peak
            else 'no deviation of the footprint from two Gaussians shows'
        )
        return (
            f'What no law explains: the film of a setting is off by {setting:.1f} % of its peak'
            f'{parts if self.part_share else ""}, alike over about {1e3 * self.length_m:.0f} mm; '
            f'{footprint}.'
        )
