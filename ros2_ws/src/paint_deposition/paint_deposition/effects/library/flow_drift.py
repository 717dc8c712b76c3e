"""Flow that drifts from pass to pass."""

import numpy as np

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter

# The calibrated flow is that of the middle of a job; live nobody knows how many passes will come.
MIDDLE_PASS = 2.5


class FlowDrift(Effect):
    """Pump, temperature and viscosity drift: each pass delivers a little more, or less.

    Acts on the flow: times (1 + a)^(n - 2.5) on pass n, the first pass being 0, so that the middle
    of six passes is as calibrated. Positive a: later passes deliver more. A pass by itself, as
    ``recommend`` computes it, has no number and is as calibrated.
    """

    id = 'flow_drift'
    family = 'order'
    covariates = ('time_s', 'spray_pass')
    free_law = 'factor'
    signature = 'level changes in the order of the passes; reversed if their order is'
    rivals = ('fog_gradient',)
    source = (
        'viscosity over temperature changes median drop size from 52 to 39 um between 65 and '
        '115 F (Bonner, pfonline); size from general practice'
    )

    drift_per_pass: float = parameter(
        0.0, low=-0.2, high=0.2, typical=0.02, unit='1/pass',
        description='a, relative change of flow from one pass to the next; positive grows',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        number = np.where(np.isnan(path.time_s), MIDDLE_PASS, path.passes_before)
        growth = (1.0 + self.drift_per_pass) ** (number - MIDDLE_PASS)
        return path.with_flow_scaled(growth)
