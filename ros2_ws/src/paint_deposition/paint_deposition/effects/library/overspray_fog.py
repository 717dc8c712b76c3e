"""Overspray that settles everywhere alike."""

import numpy as np

from paint_deposition.effects.base import Effect, SurfacePoints, parameter


class OversprayFog(Effect):
    """Fine drops miss the part, stay in the booth and settle on everything in it.

    Acts on the film: plus a, everywhere, also where no gun looked. Only ever adds; none as long as
    no paint has landed on any of the points at hand.
    """

    id = 'overspray_fog'
    family = 'level'
    covariates = ('sky_view_factor',)
    signature = 'the same amount everywhere; shows where the model says none'
    rivals = ('gauge_zero', 'pattern_spread')
    source = 'transfer efficiency of 0.8 leaves 20 % airborne; measured far tails of sprayers'

    fog_um: float = parameter(
        0.0, low=0.0, high=20.0, typical=1.0, unit='um',
        description='a, film that settles everywhere; positive adds',
    )  # fmt: skip

    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        return film_um + self.fog_um if film_um.any() else film_um
