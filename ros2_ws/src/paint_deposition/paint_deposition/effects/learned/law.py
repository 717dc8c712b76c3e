"""The base of laws learned from readings.

Its form comes from readings: values at knots over the range that the readings cover, linear in
between. One step beyond that range it is neutral again: nothing is known there. The idea is that
of an embedded discrepancy, inferred inside the model and shown against a physical covariate
(Parish and Duraisamy, J. Comput. Phys. 305:758, 2016).
"""

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from paint_deposition.effects.base import Effect

# A factor never takes more than all but this share of the film away.
LEAST_FACTOR = 0.05


class LearnedLaw(Effect):
    """Values h at knots over a covariate; the subclass says which and where it acts.

    Factor: what arrives is multiplied by 1 + h. Addition: h [um] is added to the film.

    Attributes of a subclass:
        covariate, unit: its name and unit. over: the same in words.
        kinds: what the law may be.
    """

    family = 'learned'
    covariate: ClassVar[str]
    unit: ClassVar[str] = '1'
    over: ClassVar[str]
    kinds: ClassVar[tuple[str, ...]] = ('factor',)

    kind: Literal['factor', 'addition'] = Field(
        'factor', description="'factor' 1 + h on what arrives, or 'addition' of h um to the film"
    )
    learned: tuple[float, ...] = Field((0.0, 0.0), description='a list of numbers: h at the knots')

    @model_validator(mode='after')
    def _is_of_its_kind(self) -> 'LearnedLaw':
        if self.kind not in self.kinds:
            raise ValueError(
                f'kind is {self.kind!r}; over {self.covariate} give {" or ".join(self.kinds)}'
            )
        return self

    @classmethod
    def parameters(cls) -> dict[str, dict[str, Any]]:
        """None: a fit does not vary the law; it is learned by its own step."""
        return {}

    @property
    def is_neutral(self) -> bool:
        return not any(self.learned)


def hat_weights(position: np.ndarray, count: int) -> np.ndarray:
    """(..., count) weights of knots 0 to count - 1 at positions (...) among them.

    Linear between two knots; they fall to zero within one step beyond the first and the last.
    """
    away = np.abs(np.asarray(position, dtype=float)[..., np.newaxis] - np.arange(count))
    return np.maximum(0.0, 1.0 - away)


def hat_sums(share: np.ndarray, position: np.ndarray, count: int) -> np.ndarray:
    """(P, count) sums over M of a share (M, P) at positions (M, P), or (1, P), among the knots.

    The share times ``hat_weights``, without the weights of all the knots that are not near.
    """
    points = share.shape[1]
    # A knot before the first and two beyond the last take what is out of reach.
    place = np.clip(np.broadcast_to(position, share.shape), -1.0, count) + 1.0
    lower = place.astype(np.int64)
    upper_share = share * (place - lower)
    lower += (count + 3) * np.arange(points)
    size = (count + 3) * points
    sums = np.bincount(lower.ravel(), (share - upper_share).ravel(), size)
    sums += np.bincount((lower + 1).ravel(), upper_share.ravel(), size)
    return sums.reshape(points, count + 3)[:, 1 : count + 1]


def applied(film_um: np.ndarray, h: np.ndarray, kind: str) -> np.ndarray:
    """Film (V,) [um] after a law with values h (V,) over the surface; bare metal stays bare."""
    if kind == 'addition':
        return np.where(film_um > 0.0, np.maximum(film_um + h, 0.0), film_um)
    return film_um * np.maximum(1.0 + h, LEAST_FACTOR)
