"""Recesses that the field does not reach."""

import numpy as np

from paint_deposition.effects.base import REFERENCE_CURVATURE_PER_M, Effect, parameter
from paint_deposition.part.points import SurfacePoints


class FaradayShielding(Effect):
    """Field lines end on the rim of a recess; its bottom gets only what the air carries there.

    Acts on the film: times exp(-a max(kappa, 0) / kappa_ref), kappa the curvature (positive where
    concave toward the gun), kappa_ref = 1 / 250 mm. Only ever takes away, and never all: a field
    decays exponentially into a slot.
    """

    id = 'faraday_shielding'
    family = 'curvature'
    needs = 'voltage'
    covariates = ('curvature_per_m', 'sky_view_factor')
    free_law = 'factor'
    signature = 'concave zones low, whichever way the passes run'
    rivals = ('gauge_curvature_bias', 'occlusion')
    source = (
        'practice of powder coating (Sundial Powder Coatings; powdercoating.blog): recesses need '
        '40 to 60 kV and less flow; form proposed here'
    )

    shielding: float = parameter(
        0.0, low=0.0, high=2.0, typical=0.15, unit='1',
        description='a, exponent of the loss where the radius is 250 mm: about the share lost, if '
        'small; positive takes away',
    )  # fmt: skip

    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        hollowness = np.maximum(points.curvature_per_m, 0.0) / REFERENCE_CURVATURE_PER_M
        return film_um * np.exp(-self.shielding * hollowness)
