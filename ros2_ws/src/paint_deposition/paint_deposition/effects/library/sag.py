"""Wet paint that runs down a steep surface."""

import numpy as np

from paint_deposition.effects.base import Effect, SurfacePoints, parameter

REFERENCE_FILM_UM = 20.0


class Sag(Effect):
    """Wet paint that runs down steep surface before it sets.

    Gravity drives a flux rho g h^3 / (3 eta) down the wet film until it has set. Acts on the
    film: T - d/ds [run T (T / 20 um)^2], s down the surface. ``run_m`` is how far a film of 20 um
    as a whole runs before it sets; the cube makes a film twice as thick run four times as far.
    Thick zones lose at their top and gain below. On a plane the volume stays, but for what runs
    over the lower edge; on a cylinder it grows by some 0.4 %, as the law leaves out that paint
    slows down where the surface grows less steep. Of first order: the run must be short against
    the film's features, or the film falls below zero.
    """

    id = 'sag'
    family = 'lateral shift'
    covariates = ('film_um', 'height_fraction')
    signature = "thick zones thinner at their top and thicker below; grows with the film's cube"
    rivals = ('air_drift', 'tcp_offset', 'tcp_tilt', 'part_misalignment')
    source = (
        'flux of a viscous film on a steep wall, standard; 60 um wet at 0.3 Pa s: 150 um mm per '
        'minute, about 1 um over 100 mm'
    )

    needs_slope = True

    run_m: float = parameter(
        0.0, low=0.0, high=0.03, typical=0.006, unit='m',
        description='run of a 20 um film on a vertical surface until it sets; positive is down',
    )  # fmt: skip

    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        flux_um_m = self.run_m * film_um * (film_um / REFERENCE_FILM_UM) ** 2
        return film_um - points.slope_per_m @ flux_um_m
