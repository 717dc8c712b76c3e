"""A gauge that reads high on convex surface and low in hollows."""

import numpy as np

from paint_deposition.effects.base import REFERENCE_CURVATURE_PER_M, Effect, parameter
from paint_deposition.part.points import SurfacePoints


class GaugeCurvatureBias(Effect):
    """The probe was zeroed on flat metal; on curved metal its field finds less, or more, of it.

    Acts on the reading: minus b kappa / kappa_ref, kappa the curvature (positive where concave
    toward the gun), kappa_ref = 1 / 250 mm. Positive b: convex surface reads too much, hollows too
    little. The film itself is as it was.
    """

    id = 'gauge_curvature_bias'
    family = 'curvature'
    covariates = ('curvature_per_m',)
    free_law = 'addition'
    signature = 'follows curvature, not film: the same on thin and on thick paint'
    rivals = ('faraday_shielding', 'convex_attraction')
    source = 'Helmut Fischer, application note on curvature; ISO 2178 and ISO 2360'

    bias_um: float = parameter(
        0.0, low=0.0, high=10.0, typical=1.2, unit='um',
        description='b, excess reading on a convex radius of 250 mm; positive reads high there',
    )  # fmt: skip

    def on_gauge(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        return film_um - self.bias_um * points.curvature_per_m / REFERENCE_CURVATURE_PER_M
