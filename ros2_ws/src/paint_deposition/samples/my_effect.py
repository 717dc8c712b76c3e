"""An effect of one's own, to copy: paint lost in the wake of a fast gun.

In model.yaml: ``effects: [{file: my_effect.py, loss_per_m_per_s: 0.2}]``.
"""

from paint_deposition.effects.base import Effect, Ray, parameter
from paint_deposition.kernel.fast_math import exp


class WakeLoss(Effect):
    """Flux along each ray times exp(-a v), v the speed of the gun: only ever takes away."""

    id = 'wake_loss'
    family = 'time'
    signature = 'less paint where the gun moves faster than the speed alone explains'

    loss_per_m_per_s: float = parameter(
        0.0, low=0.0, high=2.0, typical=0.2, unit='1/(m/s)',
        description='a, exponent of the loss at 1 m/s, about the share if small; positive loses',
    )  # fmt: skip

    @staticmethod
    def flux_factor(ray: Ray, loss_per_m_per_s: float) -> float:
        return exp(-loss_per_m_per_s * ray.speed_m_per_s)
