"""A plume that trails behind the moving gun."""

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter


class GunWake(Effect):
    """Drops take time to arrive, and the air holds them back: the spot lags behind the bell.

    Acts on the motion: every TCP moves by -v tau, v its velocity. Only ever backward. Straight
    passes at an even speed hide it: it shows where the gun opens, closes, turns or changes speed.
    """

    id = 'gun_wake'
    family = 'time'
    covariates = ('speed_m_per_s',)
    signature = 'passes moved against their direction, in proportion to the speed'
    rivals = ('pose_lag', 'trigger_lag')
    source = 'time of flight of 5 to 50 ms; size from general practice'

    lag_s: float = parameter(
        0.0, low=0.0, high=0.1, typical=0.02, unit='s',
        description='tau, time by which the spot lags behind the bell; positive lags',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        return path.with_(position_m=path.position_m - self.lag_s * path.velocity_m_per_s)
