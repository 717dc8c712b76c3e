"""Flow that follows the trigger late: pump, hose and bell need time."""

import numpy as np

from paint_deposition.effects.base import Effect, PathContext, SprayPath, parameter


class TriggerLag(Effect):
    """Paint that comes late after the trigger opens, and goes on after it closes.

    The flow F follows the commanded one C as tau dF/dt = C - F, rise and fall apart. Acts on the
    flow: after the trigger opens it rises as 1 - exp(-t / tau_on), after it closes it falls as
    exp(-t / tau_off); each sub-step gets its mean. tau_on x flow is missing at the begin of a pass
    and tau_off x flow is added behind its end. What is left of the last opening when the next one
    comes is taken along; of the one before that nothing.
    """

    id = 'trigger_lag'
    family = 'boundary'
    covariates = ('since_trigger_s',)
    signature = 'less paint where the gun opens and more where it closes, on alternate sides'
    rivals = ('corner_slowdown', 'pose_lag', 'gun_wake')
    source = (
        'delay of gun on and off is a set-up parameter of painting robots; tests of its timing: '
        'Mossige, Gotlieb and Meling (IJCAI 2016); first-order form and size from general practice'
    )

    rise_s: float = parameter(
        0.0, low=0.0, high=0.5, typical=0.05, unit='s',
        description='tau_on, time constant of the rise; positive is late',
    )  # fmt: skip
    fall_s: float = parameter(
        0.0, low=0.0, high=0.5, typical=0.05, unit='s',
        description='tau_off, time constant of the fall; positive is late',
    )  # fmt: skip

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        on = path.flow > 0.0
        pause_s = _interval_s(path.since_on_s, path.since_off_s)
        opening_s = _interval_s(path.since_off_s, path.since_on_s)
        left_over = _fade(pause_s, self.fall_s)
        reached = 1.0 - _fade(opening_s, self.rise_s)
        rising = 1.0 - (1.0 - left_over) * _mean_fade(path.since_on_s, path.dwell_s, self.rise_s)
        falling = reached * _mean_fade(path.since_off_s, path.dwell_s, self.fall_s)
        return path.with_(flow=np.where(on, path.flow * rising, path.open_flow * falling))


def _interval_s(later_s: np.ndarray, earlier_s: np.ndarray) -> np.ndarray:
    """Time between two events, given as times since them; inf where one did not happen."""
    both = np.isfinite(later_s) & np.isfinite(earlier_s)
    return np.subtract(earlier_s, later_s, out=np.full(len(both), np.inf), where=both)


def _fade(time_s: np.ndarray, tau_s: float) -> np.ndarray:
    """exp(-t / tau), and 0 without a lag."""
    if tau_s == 0.0:
        return np.zeros(len(time_s))
    return np.exp(-np.maximum(time_s, 0.0) / tau_s)


def _mean_fade(middle_s: np.ndarray, dwell_s: np.ndarray, tau_s: float) -> np.ndarray:
    """Mean of exp(-t / tau) over sub-steps around ``middle_s``."""
    begin, end = middle_s - 0.5 * dwell_s, middle_s + 0.5 * dwell_s
    return tau_s / dwell_s * (_fade(begin, tau_s) - _fade(end, tau_s))
