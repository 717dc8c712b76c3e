"""Booth air that carries the drops aside on their way."""

import numpy as np

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter


class AirDrift(Effect):
    """Slow drops drift with the booth's air, and sink.

    Acts on the motion: the pattern is shifted on the model plane by the drift's components in the
    tool's x and y. On the part the shift is a Z / Omega, Z the distance along the bell's axis, as
    drops that fly further drift longer: at the model plane's distance Omega it is a. Its
    direction is fixed in the booth, however the gun is turned. ``shift_down_m``: along gravity,
    and never up, as drops sink and booths blow down; by ``gradient_down_m_per_m`` more for each
    metre that the gun is below the part's centre, as the air is drawn off at the floor; positive
    ``shift_across_m``: horizontally, to the right as the gun sees the part.
    """

    id = 'air_drift'
    family = 'lateral shift'
    needs = 'draught'
    covariates = ('height_fraction', 'standoff_ratio')
    signature = 'pattern shifted in a direction fixed in the booth, however the gun is turned'
    rivals = ('tcp_offset', 'tcp_tilt', 'part_misalignment', 'sag')
    source = (
        'booth air of 0.25 to 0.5 m/s (MC 502.7.3.3.2, 29 CFR 1910.107) for a flight of 25 to '
        '100 ms is 8 to 30 mm; cross-flow as a governing force: Viti et al. (ILASS 2008)'
    )

    shift_down_m: float = parameter(
        0.0, low=0.0, high=0.1, typical=0.015, unit='m',
        description='a, shift of the pattern at the model plane; positive along gravity',
    )  # fmt: skip
    gradient_down_m_per_m: float = parameter(
        0.0, low=0.0, high=0.1, typical=0.015, unit='m/m',
        description='growth of a along gravity for each metre; positive toward the floor',
    )  # fmt: skip
    shift_across_m: float = parameter(
        0.0, low=-0.1, high=0.1, typical=0.015, unit='m',
        description='a, horizontal shift at the model plane; positive to the gun\'s right',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        lower_m = (path.position_m - context.centre_m) @ context.down
        down_m = np.maximum(self.shift_down_m + self.gradient_down_m_per_m * lower_m, 0.0)
        drift = np.multiply.outer(down_m, context.down) + self.shift_across_m * context.across
        in_tool = np.einsum('mij,mi->mj', path.rotation[:, :, :2], drift)
        return path.with_(pattern_shift_m=path.pattern_shift_m + in_tool)
