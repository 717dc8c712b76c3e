"""Overspray that settles more on the lower part of the part."""

import numpy as np

from paint_deposition.effects.base import Effect, SurfacePoints, parameter


class FogGradient(Effect):
    """Fog sinks along the part and settles on its way: most at the bottom.

    Acts on the film: plus a (1 - height), height running from 0 at the lowest point of the part
    to 1 at its highest. Only ever adds, whatever the film; none as long as no paint has landed on
    any of the points at hand.
    """

    id = 'fog_gradient'
    family = 'order'
    covariates = ('height_fraction',)
    free_law = 'addition'
    signature = 'more at the bottom, by a fixed amount: not in proportion to the film'
    rivals = ('flow_drift',)
    source = 'transfer efficiency of 0.8 leaves 20 % airborne; linear form proposed here'

    fog_um: float = parameter(
        0.0, low=0.0, high=20.0, typical=2.0, unit='um',
        description='a, film that settles at the lowest point; positive adds',
    )  # fmt: skip

    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        if not film_um.any():
            return film_um
        return film_um + self.fog_um * (1.0 - points.height_fraction)
