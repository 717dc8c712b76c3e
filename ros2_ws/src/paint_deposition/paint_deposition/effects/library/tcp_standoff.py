"""A TCP calibrated too short or too long along the bell's axis."""

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter


class TcpStandoff(Effect):
    """The bell is not where its TCP says: it is nearer to the part, or further away.

    Acts on the motion: every TCP moves by the offset along the tool's z, which points from the
    bell to the surface. Positive: the bell is nearer than recorded.
    """

    id = 'tcp_standoff'
    family = 'standoff'
    exact = True
    covariates = ('standoff_ratio',)
    signature = 'as if the whole path were sprayed from another distance'
    rivals = ('pattern_spread', 'standoff_efficiency', 'part_misalignment')
    source = 'error of tool calibration; size from general practice'

    offset_z_m: float = parameter(
        0.0, low=-0.05, high=0.05, typical=0.005, unit='m',
        description='true bell ahead of the recorded TCP along z; positive is nearer to the part',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        return path.with_(position_m=path.position_m + self.offset_z_m * path.rotation[:, :, 2])
