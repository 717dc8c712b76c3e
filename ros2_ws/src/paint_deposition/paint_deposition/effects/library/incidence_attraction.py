"""Attraction to surface that turns away from the gun, or rebound from it."""

from paint_deposition.effects.base import Effect, Ray, parameter


class IncidenceAttraction(Effect):
    """Charged drops follow the field to surface that turns away; uncharged ones rebound from it.

    Flux along each ray times 1 + a (1 - cos theta), theta the incidence. Positive a: the field
    bends the drops toward the surface, and inclined surface gets more than the projection says.
    Negative a: glancing drops are carried past, and it gets less; a = -1 is another factor
    cos theta, the most that was measured of any spray. Linear in a on both sides, so the sign is
    what the readings say.
    """

    id = 'incidence_attraction'
    family = 'incidence'
    covariates = ('incidence_deg',)
    free_law = 'factor'
    signature = 'grows with incidence; most on surface that turns away from the gun'
    rivals = ('standoff_efficiency',)
    source = (
        'hypothesis of Conner et al. (IROS 2002), section 4.3; field and space charge: Ellwood '
        'and Braslaw (1998), Elmoursi (1992); rebound: HVOF thickness over incidence, total '
        'exponent of the cosine 0.985 +- 0.086'
    )

    attraction: float = parameter(
        0.0, low=-1.0, high=6.0, typical=1.0, unit='1',
        description='a, gain of flux at glancing incidence; positive attracts, negative rebounds',
    )  # fmt: skip

    @staticmethod
    def flux_factor(ray: Ray, attraction: float) -> float:
        return 1.0 + attraction * (1.0 - ray.cos_incidence)
