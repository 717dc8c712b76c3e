"""A footprint learned from readings: where the spray pattern deviates from eq. (1)."""

from collections.abc import Callable

import numpy as np
from pydantic import Field, model_validator

from paint_deposition.effects.learned.law import LEAST_FACTOR, LearnedLaw, hat_weights
from paint_deposition.kernel.laws import Ray

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

    @classmethod
    def typical(cls) -> 'LearnedFootprint':
        return cls(learned=(0.0,) * WAVES + (0.1,) * WAVES)

    def values(self) -> tuple[float, ...]:
        """Steps per metre of the radius, and the values."""
        return ((len(self.learned) // WAVES - 1) / self.reach_m, *self.learned)

    def h(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Relative deviation (...) of the flux at places (...) on the model plane."""
        count = len(self.learned) // WAVES
        near = hat_weights(np.hypot(x_m, y_m) / self.reach_m * (count - 1), count)
        table = np.reshape(self.learned, (count, WAVES))
        return np.einsum('...k,kw,w...->...', near, table, waves(x_m, y_m))
