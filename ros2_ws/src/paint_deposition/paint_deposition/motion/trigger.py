"""The trigger: what a cell's report of its atomizer means for the flow, and when it changed."""

import math

import numpy as np
from numba import njit

from paint_deposition.errors import RecordingError

# The brush of a motion that names none: the only one.
ONLY_BRUSH = 0
TRIGGER_STATE = np.dtype(
    [
        ('flow', 'f8'),
        ('open_flow', 'f8'),
        ('dwell_s', 'f8'),
        ('since_on_s', 'f8'),
        ('since_off_s', 'f8'),
        ('open_brush', 'i8'),
    ]
)

SPRAYS_NOTHING = (
    'says spraying with flow 0, which lays no paint: give 1 for the calibrated flow, or NaN where '
    'it is not measured'
)


def relative_flow(spraying: bool, flow: float = math.nan) -> float:
    """Flow relative to the calibrated one, 0 while the gun is off.

    Args:
        spraying: whether paint leaves the atomizer.
        flow: measured flow relative to the calibrated one; NaN is unknown and taken as 1.

    Raises:
        RecordingError: the flow is negative or infinite.
    """
    if not spraying:
        return 0.0
    if math.isnan(flow):
        return 1.0
    if flow < 0.0 or math.isinf(flow):
        raise RecordingError(f'atomizer flow is {flow}: give 1 for the calibrated flow, or NaN')
    return float(flow)


def first_trigger(flow_before: float) -> np.ndarray:
    """State before the first sub-step: (1,) record, from the flow that was on until then."""
    return np.array([(flow_before, 1.0, 0.0, np.inf, np.inf, ONLY_BRUSH)], TRIGGER_STATE)


@njit(cache=True)
def follow_trigger(states, dwell, flow, brush, after_gap):
    """Measure back to the last opening and closing of the gun; a gap forgets them.

    Args:
        states: (1,) record of dtype TRIGGER_STATE, updated in place.
        dwell: (M,) duration of the sub-steps [s].
        flow: (M,) relative to the calibrated flow; 0 is gun off.
        brush: (M,) int64 number of the brush; it counts where the gun is on.
        after_gap: (M,) bool, whether poses are missing before the sub-step.

    Returns:
        open_flow and open_brush (M,) of the opening that runs or ran last; since_on_s and
        since_off_s (M,) to the middle of the sub-step, inf where there is nothing to measure to.
    """
    count = len(dwell)
    open_flow, since_on, since_off = np.empty(count), np.empty(count), np.empty(count)
    open_brush = np.empty(count, np.int64)
    state = states[0]
    for i in range(count):
        if after_gap[i]:
            state.flow = 0.0
            state.since_on_s = state.since_off_s = np.inf
        elapsed = 0.5 * (state.dwell_s + dwell[i])
        state.since_on_s += elapsed
        state.since_off_s += elapsed
        if flow[i] > 0.0 and state.flow == 0.0:
            state.since_on_s = 0.5 * dwell[i]
        if flow[i] == 0.0 and state.flow > 0.0:
            state.since_off_s = 0.5 * dwell[i]
        if flow[i] > 0.0:
            state.open_flow, state.open_brush = flow[i], brush[i]
        state.flow, state.dwell_s = flow[i], dwell[i]
        open_flow[i], open_brush[i] = state.open_flow, state.open_brush
        since_on[i], since_off[i] = state.since_on_s, state.since_off_s
    return open_flow, open_brush, since_on, since_off
