"""A gauge whose zero is off."""

import numpy as np

from paint_deposition.effects.base import Effect, SurfacePoints, parameter


class GaugeZero(Effect):
    """The gauge was zeroed on other metal, or on a rough or primed one.

    Acts on the reading: plus b. Positive b: it reads too much, also on bare metal.
    """

    id = 'gauge_zero'
    family = 'level'
    exact = True
    covariates = ('film_um',)
    signature = 'the same amount on every reading; shows on bare metal'
    rivals = ('overspray_fog', 'gauge_gain')
    source = 'specification of gauges: 1 % or 2.5 um, whichever is greater (Elcometer)'

    offset_um: float = parameter(
        0.0, low=-20.0, high=20.0, typical=0.8, unit='um',
        description='b, reading on bare metal; positive reads high',
    )  # fmt: skip

    def on_gauge(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        return film_um + self.offset_um
