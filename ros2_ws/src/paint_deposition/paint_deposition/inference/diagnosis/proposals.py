"""What a diagnosis proposes to do next: places to measure, and sprays."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr

from paint_deposition.inference.diagnosis.explanations import LAW_ERROR
from paint_deposition.inference.diagnosis.model_space import CREDIBLE
from paint_deposition.inference.diagnosis.stationary_spray import StationarySpray

# A film so many times as thick as any that was measured may sag.
MAY_SAG = 1.3
# Relative deviations of an effect from its law, and their weights, after Gauss and Hermite.
OFF, WEIGHTS = LAW_ERROR * np.sqrt([0.0, 3.0, 3.0]) * [0, 1, -1], np.array([4.0, 1.0, 1.0]) / 6.0


def chance_of_settling(separation: np.ndarray) -> np.ndarray:
    """Probability that the true one of two explanations is left alone.

    The log evidence for it is normal, its mean half the squared separation and its standard
    deviation the separation itself. It is left alone where that exceeds the odds of a group. The
    effect may turn out smaller or larger than its law says, so that is averaged over.

    Args:
        separation: (...) standard deviations between them.
    """
    needed = np.log(CREDIBLE / (1.0 - CREDIBLE))
    apart = np.maximum(np.multiply.outer(separation, 1.0 + OFF), 1e-9)
    return ndtr(0.5 * apart - needed / apart) @ WEIGHTS


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
    separation: float  # standard deviations between the two that are least apart with it
    now: float  # the same without it
    readings: int = 0  # number of points to be measured on the new part
    experiment: str = ''  # the part that is painted anew
    changes: tuple[str, ...] = ()  # what is done otherwise, by key
    # Probability that one explanation is left, on average over which is the true one.
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
