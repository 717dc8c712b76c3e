"""A robot that is slower near reversals than its recorded poses say."""

import numpy as np

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter

# A gun that is slower than this stands, and its log trembles [m/s].
STANDING_M_PER_S = 0.003


class CornerSlowdown(Effect):
    """Commanded poses were recorded: the real gun brakes toward each turn of the path.

    Acts on the motion: dwell times 1 + a exp(-s / l), s the distance along the path to the
    nearest turn, begin or end. Positive a: more paint near the turns. It is absent where the
    recorded poses are the real ones, and where the gun stands still.
    """

    id = 'corner_slowdown'
    family = 'boundary'
    covariates = ('stroke_end_m',)
    free_law = 'factor'
    signature = 'more paint where the passes turn, none along edges that they run beside'
    rivals = ('edge_build', 'trigger_lag', 'standoff_efficiency')
    source = (
        'ABB, application for a patent of a controller for a paint robot: flow corrected where '
        'the speed deviates; film in acceleration sections: Coatings 13(8) 1434 (2023)'
    )
    needs_whole_strokes = True

    gain: float = parameter(
        0.0, low=0.0, high=2.0, typical=0.3, unit='1',
        description='a, excess dwell at the turn; positive is slower',
    )  # fmt: skip
    length_m: float = parameter(
        0.15, low=0.02, high=0.5, unit='m', role='shape',
        description='l, distance in which the excess falls to 37 %',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        to_nearest_m = np.minimum(path.from_turn_m, path.to_turn_m)
        slower = 1.0 + self.gain * np.exp(-to_nearest_m / self.length_m)
        moving = path.speed_m_per_s > STANDING_M_PER_S
        return path.with_(dwell_s=path.dwell_s * np.where(moving, slower, 1.0))
