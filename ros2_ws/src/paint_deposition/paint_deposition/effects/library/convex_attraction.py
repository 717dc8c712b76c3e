"""Attraction to convex lines and corners."""

import numpy as np

from paint_deposition.effects.base import REFERENCE_CURVATURE_PER_M, Effect, parameter
from paint_deposition.part.points import SurfacePoints


class ConvexAttraction(Effect):
    """The field crowds on convex surface and draws charged drops to it.

    Acts on the film: times 1 + a max(-kappa, 0) / kappa_ref, kappa the curvature (positive where
    concave toward the gun), kappa_ref = 1 / 250 mm. Only ever adds.
    """

    id = 'convex_attraction'
    family = 'curvature'
    needs = 'voltage'
    covariates = ('curvature_per_m',)
    free_law = 'factor'
    signature = 'a ridge along convex lines, whichever way the passes run'
    rivals = ('gauge_curvature_bias',)
    source = (
        'field over a conductor is stronger where it is convex, E ~ V / R; sharp edges and '
        'recesses named as problem areas in a thesis of the University of Western Ontario '
        '(ir.lib.uwo.ca/etd/3235); linear form proposed here'
    )

    gain: float = parameter(
        0.0, low=0.0, high=1.0, typical=0.15, unit='1',
        description='a, excess film where the radius is 250 mm; positive adds',
    )  # fmt: skip

    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        convexity = np.maximum(-points.curvature_per_m, 0.0) / REFERENCE_CURVATURE_PER_M
        return film_um * (1.0 + self.gain * convexity)
