"""A gauge whose scale is off."""

import numpy as np

from paint_deposition.effects.base import Effect, SurfacePoints, parameter


class GaugeGain(Effect):
    """The gauge was calibrated on a foil or a substrate that is not the part's.

    Acts on the reading: times 1 + a. Positive a: it reads too much. On one part the same as more
    flow: only a check of the gauge distinguishes them.
    """

    id = 'gauge_gain'
    family = 'level'
    exact = True
    covariates = ('film_um',)
    signature = 'in proportion to the film everywhere; the same as another K1'
    rivals = ('gauge_zero',)
    source = 'specification of gauges: a fixed amount plus a percentage, 1 to 3 %'

    gain: float = parameter(
        0.0, low=-0.2, high=0.2, typical=0.02, unit='1',
        description='a, relative error of the scale; positive reads high',
    )  # fmt: skip

    def on_gauge(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        return (1.0 + self.gain) * film_um
