"""Curves learned from readings over one covariate."""

from collections.abc import Callable
from types import new_class
from typing import Any, Literal, cast

import numpy as np
from numba.extending import register_jitable
from pydantic import Field, model_validator

from paint_deposition.effects.base import PathContext
from paint_deposition.effects.learned_laws import LEAST_FACTOR, LearnedLaw, applied, places_m
from paint_deposition.kernel.eq2_flux import Ray
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints

# Scale and range in which the distance to an edge is resolved [m].
EDGE_SCALE_M, FARTHEST_EDGE_M = 0.01, 0.15
# Times since the trigger and distances from a turn matter up to here.
LONGEST_SINCE_TRIGGER_S, FARTHEST_TURN_M = 1.0, 1.0
SHARPEST_CURVATURE_PER_M = 12.0


class LearnedCurve(LearnedLaw):
    """A curve over a covariate, with knots at even steps on its ``axis`` from low to high."""

    low: float = Field(0.0, description='least value of the covariate in the readings')
    high: float = Field(1.0, description='greatest value of the covariate in the readings')
    sd: tuple[float, ...] = Field(
        (), description='a list of numbers: standard deviations of h at the knots; [] if not known'
    )
    acts_with: Literal['', 'voltage', 'draught'] = Field(
        '', description='what of the cell must be on for the law to act; nothing: it always does'
    )

    @staticmethod
    def axis(value: Any) -> Any:
        """The covariate on the scale on which the knots lie at even steps."""
        return value

    @model_validator(mode='after')
    def _is_a_curve(self) -> 'LearnedCurve':
        if not self.axis(self.high) > self.axis(self.low):
            raise ValueError(f'high is {self.high:g}; it must be above low, {self.low:g}')
        if len(self.learned) < 2:
            raise ValueError(f'learned has {len(self.learned)} values; give two or more')
        if self.sd and len(self.sd) != len(self.learned):
            raise ValueError(
                f'sd has {len(self.sd)} values and learned {len(self.learned)}; give one for each'
            )
        if any(value < 0.0 for value in self.sd):
            raise ValueError(f'sd has {min(self.sd):g}; a standard deviation is 0 or more')
        return self

    def is_off(self, switched_off: frozenset[str]) -> bool:
        return self.acts_with in switched_off

    @property
    def knots(self) -> np.ndarray:
        """(K,) even steps on the ``axis`` at which the curve has its values."""
        return np.linspace(self.axis(self.low), self.axis(self.high), len(self.learned))

    def curve(self, value: np.ndarray) -> np.ndarray:
        """h at values of the covariate (...) [1 or um]; 0 where the covariate is unknown."""
        count = len(self.learned)
        position = knot_positions(type(self), value, self.low, self.high, count)
        # Value by value, so that it is the same to the bit for few values and for many.
        return np.interp(position, np.arange(-1, count + 1), [0.0, *self.learned, 0.0])

    def deviation(self, value: np.ndarray) -> np.ndarray:
        """Standard deviation (...) of h at values of the covariate (...) [1 or um].

        Between two knots it is at most this. NaN where nothing is known: outside the range of the
        readings, or everywhere.
        """
        if not self.sd:
            return np.full(np.shape(value), np.nan)
        count = len(self.sd)
        position = knot_positions(type(self), value, self.low, self.high, count)
        return np.interp(position, np.arange(count), self.sd, left=np.nan, right=np.nan)

    def factor(self, value: np.ndarray) -> np.ndarray:
        """What the film is multiplied by at values of the covariate."""
        return np.maximum(1.0 + self.curve(value), LEAST_FACTOR)

    def values(self) -> tuple[float, ...]:
        """For the kernel: first knot, knots per unit of the axis, and the curve at the knots."""
        first, last = self.axis(self.low), self.axis(self.high)
        return (float(first), (len(self.learned) - 1) / float(last - first), *self.learned)


def _on_path(law: LearnedCurve, path: SprayPath, context: PathContext) -> SprayPath:
    """Acts on the flow, by a covariate of each sub-step."""
    return path.with_flow_scaled(law.factor(along_path(path)[law.covariate]))


def _on_film(law: LearnedCurve, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
    """Acts on the film, by a covariate of each point, or by the film itself."""
    is_film = law.covariate == 'film_um'
    value = film_um if is_film else at_points(points)[law.covariate]()
    return applied(film_um, law.curve(value), law.kind)


def knot_positions(
    law: type[LearnedCurve], value: np.ndarray, low: float, high: float, count: int
) -> np.ndarray:
    """(...) positions of values of the covariate among the knots 0 to count - 1 of a law.

    Where the covariate is unknown the position is beyond the reach of all knots.
    """
    first, last = law.axis(low), law.axis(high)
    position = (law.axis(value) - first) / (last - first) * (count - 1)
    return np.where(np.isfinite(position), position, -2.0)


def counted_from_1(covariate: str, values: Any) -> Any:
    """Values of a covariate as people count them: passes from 1."""
    return values + (1.0 if covariate == 'spray_pass' else 0.0)


def along_path(path: SprayPath) -> dict[str, np.ndarray]:
    """Covariates (M,) of the sub-steps of a path; NaN where one is not known.

    A path of which the time is not known, such as one pass by itself, has no number of the pass.
    """
    return {
        'time_s': path.time_s,
        'spray_pass': np.where(np.isnan(path.time_s), np.nan, path.passes_before),
        'stroke_end_m': np.minimum(np.minimum(path.from_turn_m, path.to_turn_m), FARTHEST_TURN_M),
        'since_trigger_s': np.minimum(path.since_on_s, LONGEST_SINCE_TRIGGER_S),
        'speed_m_per_s': path.speed_m_per_s,
    }


def at_points(points: SurfacePoints) -> dict[str, Callable[[], np.ndarray]]:
    """Covariates (V,) of points on the surface, each computed when it is called for."""
    return {
        'curvature_per_m': lambda: np.clip(
            points.curvature_per_m, -SHARPEST_CURVATURE_PER_M, SHARPEST_CURVATURE_PER_M
        ),
        'edge_distance_m': lambda: np.minimum(points.edge_distance_m, FARTHEST_EDGE_M),
        'sky_view_factor': lambda: points.sky_view_factor,
        'height_fraction': lambda: points.height_fraction,
        'across_m': lambda: places_m(points)[:, 0],
    }


def _ray_factor(variable: Callable[[Ray], float]) -> Callable[..., float]:
    """The factor of a curve over a variable of the ray, for the kernel.

    The knots lie at even steps from ``low`` on. Constants and counters are floating-point numbers
    here and none stands in ``variable``, so that the kernel's precision holds.
    """
    of_ray = register_jitable(variable)

    def flux_factor(ray: Ray, low: float, steps_per_unit: float, *values: float) -> float:
        away = (of_ray(ray) - low) * steps_per_unit
        factor = 1.0
        for value in values:
            factor += value * max(0.0, 1.0 - abs(away))
            away -= 1.0
        return max(LEAST_FACTOR, factor)

    return flux_factor


def _curve_class(covariate: str, unit: str, over: str, **acts: Any) -> type[LearnedCurve]:
    """The class of the law over a covariate, with what says where it acts."""
    what = {
        'id': f'learned:{covariate}', 'covariate': covariate, 'unit': unit, 'over': over,
        '__module__': __name__, '__doc__': f'What is painted follows {over}, as learned.',
    }  # fmt: skip
    name = f'Learned_{covariate}'
    law = new_class(name, (LearnedCurve,), {}, lambda names: names.update(what | acts))
    return cast(type[LearnedCurve], law)


ALONG_PATH = {'on_path': _on_path}
OVER_SURFACE = {'on_film': _on_film, 'kinds': ('factor', 'addition')}
# Learned curves by covariate.
CURVES: dict[str, type[LearnedCurve]] = {
    law.covariate: law
    for law in (
        _curve_class(
            'incidence_deg', 'deg', 'the angle of incidence',
            # Minus the angle's cosine, which the kernel knows.
            axis=staticmethod(lambda value: -np.cos(np.radians(value))),
            flux_factor=staticmethod(_ray_factor(lambda ray: -ray.cos_incidence)),
        ),
        _curve_class(
            'standoff_ratio', '1', 'the distance as a multiple of Omega',
            flux_factor=staticmethod(_ray_factor(lambda ray: ray.standoff_ratio)),
        ),
        _curve_class('time_s', 's', 'the time since the motion began', **ALONG_PATH),
        _curve_class('spray_pass', '1', 'the number of the pass', **ALONG_PATH),
        _curve_class(
            'stroke_end_m', 'm', 'the distance to the nearer end of the stroke',
            needs_whole_strokes=True, **ALONG_PATH,
        ),
        _curve_class('since_trigger_s', 's', 'the time since the trigger opened', **ALONG_PATH),
        _curve_class('speed_m_per_s', 'm/s', 'the speed of the gun', **ALONG_PATH),
        _curve_class('curvature_per_m', '1/m', 'the curvature of the surface', **OVER_SURFACE),
        _curve_class(
            'edge_distance_m', 'm', 'the distance to the nearest free edge',
            # A scale that resolves what is close to the edge.
            axis=staticmethod(
                lambda value: np.log1p(np.minimum(value, FARTHEST_EDGE_M) / EDGE_SCALE_M)
            ),
            **OVER_SURFACE,
        ),
        _curve_class(
            'sky_view_factor', '1', 'the share of the half-space that a point sees', **OVER_SURFACE
        ),
        _curve_class(
            'across_m', 'm', "the distance from the part's centre to the right", **OVER_SURFACE
        ),
        _curve_class('height_fraction', '1', 'the height on the part', **OVER_SURFACE),
        _curve_class('film_um', 'um', 'the film itself', on_film=_on_film),
    )
}  # fmt: skip
# Where pickle looks for them.
globals().update({law.__name__: law for law in CURVES.values()})
