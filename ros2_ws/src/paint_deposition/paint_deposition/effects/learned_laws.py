"""The base of laws learned from readings, and maps over the part and over the footprint.

The form comes from readings: values at knots over the range that the readings cover, linear in
between. One step beyond that range it is neutral again: nothing is known there. The idea is that
of an embedded discrepancy, inferred inside the model and shown against a physical covariate
(Parish and Duraisamy, J. Comput. Phys. 305:758, 2016).
"""

from collections.abc import Callable, Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from paint_deposition.effects.base import Effect
from paint_deposition.kernel.eq2_flux import Ray
from paint_deposition.part.points import SurfacePoints, across_axis, downhill_axis

# A factor never takes more than all but this share of the film away.
LEAST_FACTOR = 0.05


class LearnedLaw(Effect):
    """Values h at knots over a covariate; the subclass says which and where it acts.

    Factor: what arrives is multiplied by 1 + h. Addition: h [um] is added to the film.

    It has no ``parameters``: a fit does not vary the law; it is learned by its own step.

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
        'factor', description='1 + h times what arrives, or h um added to the film'
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
    def typical(cls) -> 'LearnedLaw':
        """The law that rises to 0.1 over the second half of its knots."""
        half = len(cls().learned) // 2
        return cls(learned=(0.0,) * half + (0.1,) * half)

    @property
    def is_neutral(self) -> bool:
        return not any(self.learned)

    @property
    def absent(self) -> 'LearnedLaw':
        return self.model_copy(update={'learned': (0.0,) * len(self.learned)})


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


Pair = tuple[float, float]


def places_m(points: SurfacePoints) -> np.ndarray:
    """(V, 2) how far each point lies to the right of the part's centre and above it [m]."""
    axes = across_axis(points.outward, points.down), -downhill_axis(points.outward, points.down)
    return (points.positions_m - points.centre_m) @ np.column_stack(axes)


class PartGrid(BaseModel):
    """Knots of a map: an even grid over a part as the gun sees it."""

    model_config = ConfigDict(frozen=True, extra='forbid')

    part_m: tuple[float, float, float] = Field(
        description='three numbers: sides of the bounding box of the part [m]'
    )
    low_m: Pair = Field(description='two numbers: lower left knot, from the centre [m]')
    high_m: Pair = Field(description='two numbers: upper right knot, from the centre [m]')
    columns: int = Field(ge=2, description='2 or more knots in a row')
    rows: int = Field(ge=2, description='2 or more rows of knots')

    @model_validator(mode='after')
    def _has_an_area(self) -> 'PartGrid':
        if not all(high > low for low, high in zip(self.low_m, self.high_m, strict=True)):
            raise ValueError(f'high_m is {self.high_m}; it must be above low_m, {self.low_m}')
        return self

    @property
    def knots(self) -> int:
        """Row by row from the lowest, each from the left."""
        return self.rows * self.columns

    def knots_m(self) -> np.ndarray:
        """(K, 2) their places from the centre [m]."""
        across = np.linspace(self.low_m[0], self.high_m[0], self.columns)
        up = np.linspace(self.low_m[1], self.high_m[1], self.rows)
        return np.stack(np.meshgrid(across, up), axis=-1).reshape(-1, 2)

    def weights(self, place_m: np.ndarray) -> np.ndarray:
        """(V, K) weights of the knots at places (V, 2)."""
        share = (place_m - self.low_m) / np.subtract(self.high_m, self.low_m)
        across = hat_weights(share[:, 0] * (self.columns - 1), self.columns)
        up = hat_weights(share[:, 1] * (self.rows - 1), self.rows)
        return (up[:, :, np.newaxis] * across[:, np.newaxis]).reshape(len(place_m), -1)

    def is_of(self, points: SurfacePoints) -> bool:
        """Whether the points lie on the part of this grid."""
        # Parts whose boxes differ by less than this share are the same part.
        return bool(np.allclose(points.extent_m, self.part_m, rtol=0.01, atol=1e-4))


class LearnedMap(LearnedLaw):
    """The film follows the place on the part, as learned; other parts are left alone."""

    id, covariate = 'learned:place', 'place'
    over = 'the place on the part'
    kinds = ('factor', 'addition')

    maps: tuple[PartGrid, ...] = Field(
        (PartGrid(part_m=(1.0,) * 3, low_m=(-0.5,) * 2, high_m=(0.5,) * 2, columns=2, rows=2),),
        description='a list of the grids of knots, one for each part',
    )
    learned: tuple[float, ...] = Field(
        (0.0,) * 4, description='a list of numbers: h at the knots of one map after the other'
    )

    @model_validator(mode='after')
    def _fills_its_maps(self) -> 'LearnedMap':
        knots = sum(grid.knots for grid in self.maps)
        if len(self.learned) != knots:
            raise ValueError(
                f'learned has {len(self.learned)} values; its maps have {knots} knots'
            )
        return self

    def values_by_part(self) -> Iterator[tuple[PartGrid, np.ndarray]]:
        """Each grid with its values (rows, columns)."""
        first = 0
        for grid in self.maps:
            values = np.array(self.learned[first : first + grid.knots])
            yield grid, values.reshape(grid.rows, grid.columns)
            first += grid.knots

    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        for grid, values in self.values_by_part():
            if grid.is_of(points):
                # Value by value, so that it is the same to the bit for few points and for many.
                h = np.einsum('vk,k->v', grid.weights(places_m(points)), values.ravel())
                return applied(film_um, h, self.kind)
        return film_um


# Harmonics of the angle: 1, cos, sin, cos 2, sin 2.
HARMONICS = np.array([0, 1, 1, 2, 2])
WAVES = len(HARMONICS)
TINY_M2 = 1e-20


def waves(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(WAVES, ...) harmonics of the angle at (x, y) on the model plane."""
    radius = np.sqrt(x * x + y * y + TINY_M2)
    cos, sin = x / radius, y / radius
    return np.stack([np.ones_like(cos), cos, sin, cos * cos - sin * sin, 2.0 * cos * sin])


def _flux_factor() -> Callable[..., float]:
    """The factor at the point where a ray pierces the model plane, for the kernel.

    Counters come from outside, as a number in a law is made one of the kernel's precision.
    """
    first, count = 0, WAVES

    def flux_factor(ray: Ray, steps_per_m: float, *values: float) -> float:
        radius = np.sqrt(ray.x_m * ray.x_m + ray.y_m * ray.y_m + TINY_M2)
        cos, sin = ray.x_m / radius, ray.y_m / radius
        wave = (1.0, cos, sin, cos * cos - sin * sin, 2.0 * cos * sin)
        away = radius * steps_per_m
        factor = 1.0
        for knot in range(first, len(values), count):
            near = max(0.0, 1.0 - abs(away))
            for k in range(first, count):
                factor += near * wave[k] * values[knot + k]
            away -= 1.0
        return max(LEAST_FACTOR, factor)

    return flux_factor


class LearnedFootprint(LearnedLaw):
    """The pattern deviates from the two Gaussians of eq. (1), as learned.

    The flux is multiplied by 1 + h, h a function of the place on the model plane: at each of even
    steps of the radius a constant and the first two harmonics of the angle.
    """

    id, covariate = 'learned:footprint', 'footprint'
    over = 'the place in the pattern'

    reach_m: float = Field(
        1.0, gt=0.0, description='radius on the model plane of the outermost values [m]'
    )
    learned: tuple[float, ...] = Field(
        (0.0,) * (2 * WAVES),
        description='a list of numbers: h at even radii from 0 to reach_m; of each its mean, and '
        "its parts with cos a, sin a, cos 2a, sin 2a, a the angle from the tool's x axis",
    )
    flux_factor = staticmethod(_flux_factor())

    @model_validator(mode='after')
    def _is_a_pattern(self) -> 'LearnedFootprint':
        if len(self.learned) < 2 * WAVES or len(self.learned) % WAVES:
            raise ValueError(
                f'learned has {len(self.learned)} values; give {WAVES} for each of some radii'
            )
        return self

    def values(self) -> tuple[float, ...]:
        """Steps per metre of the radius, and the values."""
        return ((len(self.learned) // WAVES - 1) / self.reach_m, *self.learned)

    def h(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Relative deviation (...) of the flux at places (...) on the model plane."""
        count = len(self.learned) // WAVES
        near = hat_weights(np.hypot(x_m, y_m) / self.reach_m * (count - 1), count)
        table = np.reshape(self.learned, (count, WAVES))
        return np.einsum('...k,kw,w...->...', near, table, waves(x_m, y_m))
