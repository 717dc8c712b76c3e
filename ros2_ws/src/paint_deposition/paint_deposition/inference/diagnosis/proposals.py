"""What a diagnosis proposes to do next: places to measure, and sprays."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from paint_deposition.inference.diagnosis.stationary_spray import StationarySpray

# A film so many times as thick as any that was measured may sag.
MAY_SAG = 1.3


@dataclass(frozen=True)
class Place:
    """A point to measure: position (3,) [m], the film predicted there [um], and why."""

    position_m: np.ndarray
    experiment: str
    why: str
    film_um: float = float('nan')

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``next.measure`` in ``diagnosis.json``."""
        position = dict(zip(('x_m', 'y_m', 'z_m'), self.position_m.tolist(), strict=True))
        film = {'film_um': self.film_um} if np.isfinite(self.film_um) else {}
        return {'experiment': self.experiment, **position, **film, 'why': self.why}


@dataclass(frozen=True)
class Spray:
    """A proposed experiment."""

    what: str  # in words; names the part where there are several
    separates: tuple[str, ...]  # the explanations that it is to separate, effect ids or 'unknown'
    separation: float  # standard deviations from the leading effect to its nearest rival with it
    now: float  # the same without it
    readings: int = 0  # number of points to be measured on the new part
    experiment: str = ''  # the part that is painted anew
    changes: tuple[str, ...] = ()  # what is done otherwise, by key
    # Probability that the true effect is left alone, averaged over which it probably is.
    chance: float = float('nan')
    peak_um: float = float('nan')  # thickest film at these points
    peak_now_um: float = float('nan')  # as measured on that part
    stand: StationarySpray | None = None  # where the gun stands still, if it does

    @property
    def film_words(self) -> str:
        """A remark on a film that is much thicker than those measured; else nothing."""
        if not self.peak_um > MAY_SAG * self.peak_now_um:
            return ''
        return (
            f'the film will reach {self.peak_um:.0f} µm, now {self.peak_now_um:.0f}: see that it '
            'does not sag'
        )

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``next.spray`` in ``diagnosis.json``."""
        return {
            'what': self.what,
            'separates': list(self.separates),
            'separation_sigma': self.separation,
            'separation_now_sigma': self.now,
            'chance': self.chance,
            'readings': self.readings,
            'experiment': self.experiment,
            'changes': list(self.changes),
            'peak_um': self.peak_um,
            'stand': self.stand and self.stand.to_dict(),
        }
