"""Metal that stands between the gun and the surface."""

from paint_deposition.effects.base import Effect, parameter


class Occlusion(Effect):
    """The projection paints through metal; real drops stop at it, or most of them do.

    Flux along each ray times 1 - a where the part itself blocks the line of sight from the
    emission point. Only ever takes away; a = 1 is a full shadow, less lets drops drift round.
    """

    id = 'occlusion'
    family = 'visibility'
    covariates = ('sky_view_factor',)
    signature = 'less behind other parts of the surface, with a step at the edge of the shadow'
    rivals = ('faraday_shielding',)
    source = 'rays against the mesh (Moeller and Trumbore), as in simulators of cold spray'

    strength: float = parameter(
        0.0, low=0.0, high=1.0, typical=1.0, unit='1',
        description='a, share of the flux that the shadow stops; positive takes away',
    )  # fmt: skip

    def shadow(self) -> float:
        return self.strength
