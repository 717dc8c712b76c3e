"""Slips: single readings that contradict all that their neighbours and the model say.

A typing error, a display misread, a reading on bare metal. A point that was read several times
agrees with itself or is judged by its repeats; for the others the readings around them speak. A
deviation that several neighbours share, or that lies where no other reading is alike, is no slip.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import expit

from paint_deposition.inference.fitting.smooth_misfit import Misfit

# Prior probability that a reading is a slip, and the posterior one from which it counts as one.
SLIP, SURE = 0.01, 0.9
# Slips are rare: where a greater share of the points would be some, the model is at fault.
MOST = 0.05
# Fewer points say too little of each other.
FEWEST = 20
# A slip of the pen is proposed if it explains the reading to within this many standard deviations.
NEAR = 3.0


@dataclass(frozen=True)
class Slip:
    """A reading that was left out, and what the others say.

    Attributes:
        point: its label, which names the part.
        thickness_um: as it was given.
        expected_um, sigma_um: what the model and the other readings predict there.
    """

    point: str
    thickness_um: float
    expected_um: float
    sigma_um: float

    @property
    def guess_um(self) -> float | None:
        """What was probably read: a decimal point or two digits are in the wrong place."""
        meant = [value for value in _miswritten(self.thickness_um) if self._fits(value)]
        return min(meant, key=lambda value: abs(value - self.expected_um), default=None)

    def __str__(self) -> str:
        meant = '' if self.guess_um is None else f' ({self.guess_um:.4g}?)'
        return (
            f"point '{self.point}': {self.thickness_um:.4g} µm where model and neighbours say "
            f'{self.expected_um:.4g} ± {self.sigma_um:.2g} µm{meant}; left out of the fit, '
            'measure there again'
        )

    def to_dict(self) -> dict[str, Any]:
        """As results name it."""
        names = ('point', 'thickness_um', 'expected_um', 'sigma_um', 'guess_um')
        return {name: getattr(self, name) for name in names}

    def _fits(self, value: float) -> bool:
        return abs(value - self.expected_um) < NEAR * self.sigma_um


def slips(misfit: Misfit, single: np.ndarray) -> dict[int, tuple[float, float]]:
    """Slips by their row, with the residual that the others predict and its error [um].

    The most certain one is taken out first, since slips hide each other and widen what is
    expected of sound readings.

    Args:
        misfit: P points beside a fitted model.
        single: (P,) whether a point was read only once.
    """
    count = len(single)
    kept = np.arange(count)
    found: dict[int, tuple[float, float]] = {}
    if count < FEWEST:
        return {}
    film, left = np.mean(misfit.predicted_um), misfit
    while True:
        scatter = left.scatter
        # Nothing is known of a slip but that it is a number of the size of the film.
        wild = -np.log(np.pi * film * (1.0 + (left.residual_um / film) ** 2))  # Cauchy's.
        log_odds = np.log(SLIP / (1.0 - SLIP)) + wild - scatter.log_density
        log_odds[~single[kept]] = -np.inf
        worst = int(np.argmax(log_odds))
        if expit(log_odds[worst]) < SURE:
            return found
        if len(found) + 1 > max(MOST * count, 1.0):
            return {}
        found[int(kept[worst])] = scatter.predicted(worst)
        kept = np.delete(kept, worst)
        left = misfit.select(kept)


def _miswritten(value: float) -> list[float]:
    """Numbers that become this one by a shifted decimal point or two digits exchanged."""
    text = f'{value:.6g}'
    exchanged = [
        text[:k] + text[k + 1] + text[k] + text[k + 2 :]
        for k in range(len(text) - 1)
        if text[k : k + 2].isdigit()
    ]
    return [value / 10.0, value * 10.0, value / 100.0, value * 100.0, *map(float, exchanged)]
