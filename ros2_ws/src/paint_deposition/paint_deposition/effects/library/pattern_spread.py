"""A pattern that does not widen in proportion to the distance."""

from paint_deposition.effects.base import Effect, Ray, parameter
from paint_deposition.kernel.fast_math import power

# Standoffs between a quarter of the model plane's distance and four times it are within reach.
STANDOFF_RANGE = 4.0


class PatternSpread(Effect):
    """The spray is no bundle of straight rays from one point: air and field bend it.

    The width grows as (Z / Omega)^(1 + a) instead of Z / Omega, Z the distance along the bell's
    axis from the emission point: a point q of the model plane becomes q (Z / Omega)^-a, and the
    flux (Z / Omega)^-2a times as much, which keeps the volume.
    Positive a: the pattern is wider than the straight cone beyond the model plane (the field and
    the drops' own charge drive it apart); negative a: narrower (shaping air holds it together).
    """

    id = 'pattern_spread'
    family = 'standoff'
    covariates = ('standoff_ratio',)
    signature = 'the width of the pattern changes with the distance, not what it deposits'
    rivals = ('tcp_standoff', 'overspray_fog')
    source = (
        'the single emission point of Conner et al. (IROS 2002) is the assumption that fails; '
        'power law proposed here'
    )

    exponent: float = parameter(
        0.0, low=-0.5, high=0.8, typical=0.3, unit='1',
        description='a, excess exponent of width over distance; positive widens with distance',
    )  # fmt: skip

    @staticmethod
    def pattern_scale(ray: Ray, exponent: float) -> float:
        return power(ray.standoff_ratio, -exponent)

    def widening(self) -> float:
        return STANDOFF_RANGE ** abs(self.exponent)
