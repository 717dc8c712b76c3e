"""A map over a part learned from readings, for what no covariate carries."""

import numpy as np
from pydantic import Field, model_validator

from paint_deposition.effects.learned.law import LearnedLaw, applied, hat_weights
from paint_deposition.part.axes import across_axis, downhill_axis
from paint_deposition.part.points import SurfacePoints

# Parts whose boxes differ by less than this share are the same part.
SAME_PART = 0.01

Pair = tuple[float, float]


def places_m(points: SurfacePoints) -> np.ndarray:
    """(V, 2) how far each point lies to the right of the part's centre and above it [m]."""
    axes = across_axis(points.outward, points.down), -downhill_axis(points.outward, points.down)
    return (points.positions_m - points.centre_m) @ np.column_stack(axes)


class LearnedMap(LearnedLaw):
    """The film follows the place on the part, as learned; other parts are left alone.

    The values are those at the knots of an even grid over the part as the gun sees it, row by row
    from the lowest, each from the left.
    """

    id, covariate = 'learned:place', 'place'
    over = 'the place on the part'
    kinds = ('factor', 'addition')

    part_m: tuple[float, float, float] = Field(
        (1.0, 1.0, 1.0),
        description='three numbers: sides of the bounding box of the part it was learned on [m]',
    )
    low_m: Pair = Field(
        (-0.5, -0.5), description='two numbers: lower left knot, from the centre [m]'
    )
    high_m: Pair = Field(
        (0.5, 0.5), description='two numbers: upper right knot, from the centre [m]'
    )
    columns: int = Field(2, ge=2, description='2 or more knots in a row')
    learned: tuple[float, ...] = Field((0.0,) * 4, description='a list of numbers: h at the knots')

    @model_validator(mode='after')
    def _is_a_map(self) -> 'LearnedMap':
        rows, rest = divmod(len(self.learned), self.columns)
        if rows < 2 or rest:
            raise ValueError(
                f'learned has {len(self.learned)} values; give two or more rows of {self.columns}'
            )
        if not all(high > low for low, high in zip(self.low_m, self.high_m, strict=True)):
            raise ValueError(f'high_m is {self.high_m}; it must be above low_m, {self.low_m}')
        return self

    @classmethod
    def typical(cls) -> 'LearnedMap':
        return cls(learned=(0.0, 0.1, 0.1, 0.0))

    @property
    def rows(self) -> int:
        """Of knots."""
        return len(self.learned) // self.columns

    def weights(self, place_m: np.ndarray) -> np.ndarray:
        """(V, K) weights of the knots at places (V, 2)."""
        share = (place_m - self.low_m) / np.subtract(self.high_m, self.low_m)
        across = hat_weights(share[:, 0] * (self.columns - 1), self.columns)
        up = hat_weights(share[:, 1] * (self.rows - 1), self.rows)
        return (up[:, :, np.newaxis] * across[:, np.newaxis]).reshape(len(place_m), -1)

    def is_of(self, points: SurfacePoints) -> bool:
        """Whether the points lie on the part that it was learned on."""
        return bool(np.allclose(points.extent_m, self.part_m, rtol=SAME_PART, atol=1e-4))

    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        if not self.is_of(points):
            return film_um
        # Value by value, so that it is the same to the bit for few points and for many.
        h = np.einsum('vk,k->v', self.weights(places_m(points)), np.array(self.learned))
        return applied(film_um, h, self.kind)
