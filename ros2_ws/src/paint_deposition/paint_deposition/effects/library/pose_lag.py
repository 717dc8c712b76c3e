"""Poses stamped later, or earlier, than the trigger's clock says."""

import numpy as np

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter


class PoseLag(Effect):
    """Robot and trigger are stamped by clocks, or through delays, that differ.

    Acts on the flow: at a pose stamped t flows what the trigger commanded at t - lag, so each
    pass begins and ends lag x speed further on. Positive: a pose is stamped later than the gun
    was there. Openings and pauses shorter than the lag are not followed.
    """

    id = 'pose_lag'
    family = 'time'
    exact = True
    signature = 'passes moved along their own direction, to opposite sides when they alternate'
    rivals = ('gun_wake', 'trigger_lag')
    source = 'ABB externally guided motion: a pose every 4 ms, lag of control 10 to 20 ms'
    needs_whole_strokes = True

    lag_s: float = parameter(
        0.0, low=-0.1, high=0.1, typical=0.015, unit='s',
        description='time by which poses are stamped late against the trigger; positive is late',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        on = path.flow > 0.0
        if self.lag_s >= 0.0:
            gained_s, lost_s, side = path.since_off_s, path.since_on_s, -0.5
            level, brush = path.open_flow, path.brush
        else:
            gained_s, lost_s, side = path.until_on_s, path.until_off_s, 0.5
            # The next sub-step with the gun open; the last one where none comes.
            ahead, opens = np.arange(len(path)), np.flatnonzero(on)
            if len(opens):
                ahead = opens[np.minimum(np.searchsorted(opens, ahead), len(opens) - 1)]
            level, brush = path.flow[ahead], np.where(on, path.brush, path.brush[ahead])
        lag_s = abs(self.lag_s)
        gained = _share_within(gained_s, path.dwell_s, lag_s)
        lost = _share_within(lost_s, path.dwell_s, lag_s)
        share = on + gained - lost
        # The sub-step's paint is centred on what is left of it, or the lag would act in jumps.
        moment = side * (gained * (1.0 - gained) - lost * (1.0 - lost))
        shift_s = path.dwell_s * np.divide(moment, share, out=np.zeros(len(path)), where=share > 0)
        return path.with_(
            flow=share * np.where(on, path.flow, level),
            brush=brush,
            position_m=path.position_m + shift_s[:, np.newaxis] * path.velocity_m_per_s,
        )


def _share_within(middle_s: np.ndarray, dwell_s: np.ndarray, lag_s: float) -> np.ndarray:
    """Share of each sub-step that is less than the lag away from an event."""
    return np.clip((lag_s - middle_s) / dwell_s + 0.5, 0.0, 1.0)
