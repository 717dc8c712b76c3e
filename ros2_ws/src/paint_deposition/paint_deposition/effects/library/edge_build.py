"""More paint along the free edges: fat edges, picture framing."""

import numpy as np

from paint_deposition.effects.base import Effect, SurfacePoints, parameter


class EdgeBuild(Effect):
    """The field crowds on free edges, and surface tension draws wet paint to them.

    Acts on the film: times 1 + a exp(-d / l), d the distance to the nearest free edge. Only ever
    adds; on all sides alike, so it is no matter of gravity. Surface tension draws a rim without
    voltage, too.
    """

    id = 'edge_build'
    family = 'boundary'
    covariates = ('edge_distance_m',)
    free_law = 'factor'
    signature = 'a rim of more paint along all free edges alike'
    rivals = ('corner_slowdown',)
    source = (
        'fat edge and picture framing (Kansai Altan, coating defects); exponential form proposed '
        'here, no profile is published'
    )

    gain: float = parameter(
        0.0, low=0.0, high=2.0, typical=0.25, unit='1',
        description='a, excess film at the edge; positive adds',
    )  # fmt: skip
    length_m: float = parameter(
        0.025, low=0.005, high=0.12, unit='m', role='shape',
        description='l, distance in which the excess falls to 37 %',
    )  # fmt: skip

    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        return film_um * (1.0 + self.gain * np.exp(-points.edge_distance_m / self.length_m))
