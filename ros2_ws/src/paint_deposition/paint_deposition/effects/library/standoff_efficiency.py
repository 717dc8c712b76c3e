"""Transfer efficiency that falls with the distance from the bell."""

from paint_deposition.effects.base import Effect, Ray, parameter
from paint_deposition.kernel.fast_math import power


class StandoffEfficiency(Effect):
    """Drops that fly further lose momentum, evaporate and feel a weaker field: fewer arrive.

    Flux along each ray times (Z / Omega)^-a, Z the distance along the bell's axis and Omega that
    of the model plane, where nothing changes. Positive a: the far surface gets less.
    """

    id = 'standoff_efficiency'
    family = 'standoff'
    covariates = ('standoff_ratio',)
    free_law = 'factor'
    signature = 'negative where the gun is far, positive where it is near; level, not width'
    rivals = ('incidence_attraction', 'corner_slowdown', 'tcp_standoff')
    source = (
        'Sames Kremlin: transfer is better with a higher field and a shorter distance; power law '
        'proposed here, no curve for a bell is published'
    )

    exponent: float = parameter(
        0.0, low=0.0, high=4.0, typical=0.5, unit='1',
        description='a, exponent of the loss with distance; positive loses',
    )  # fmt: skip

    @staticmethod
    def flux_factor(ray: Ray, exponent: float) -> float:
        return power(ray.standoff_ratio, -exponent)
