"""Strokes and passes: where the path turns, and how far each sub-step is from turns and triggers.

Compiled and sequential, with the state carried in one record from call to call, so that a live
stream and an offline run number their strokes alike.
"""

import math

import numpy as np
from numba import njit

# The path's direction is judged over this travel, so that jitter at rest is no turn [m].
DIRECTION_STEP_M = 0.01
# A stroke ends where the path leaves its direction by more than 60 degrees.
COS_TURN = 0.5
# A stroke within 45 degrees of the first sprayed one, either way, is a pass; others are links.
COS_PASS = math.sqrt(0.5)

STATE = np.dtype(
    [
        ('stroke', 'i8'),
        ('spray_pass', 'i8'),
        ('pass_counted', 'i8'),
        ('started', 'i8'),
        ('flow', 'f8'),
        ('open_flow', 'f8'),
        ('dwell_s', 'f8'),
        ('since_on_s', 'f8'),
        ('since_off_s', 'f8'),
        ('from_turn_m', 'f8'),
        ('anchor', 'f8', 3),
        ('direction', 'f8', 3),
        ('pass_axis', 'f8', 3),
    ]
)


def new_state(flow_before: float) -> np.ndarray:
    """State before the first pose, (1,) record; the flow that is assumed to have been on."""
    state = np.zeros(1, STATE)
    state['spray_pass'] = -1
    state['flow'] = flow_before
    state['open_flow'] = 1.0
    state['since_on_s'] = state['since_off_s'] = np.inf
    return state


@njit(cache=True)
def _turned(state, position):
    """Advance the anchor; true where the direction of travel left the stroke's."""
    step = position - state.anchor
    length = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    if length < DIRECTION_STEP_M:
        return False
    step /= length
    along = step[0] * state.direction[0] + step[1] * state.direction[1]
    along += step[2] * state.direction[2]
    defined = state.direction[0] != 0.0 or state.direction[1] != 0.0 or state.direction[2] != 0.0
    turned = defined and along < COS_TURN
    for k in range(3):
        state.anchor[k] = position[k]
        if turned or not defined:
            state.direction[k] = step[k]
        else:  # follow a curved stroke slowly
            state.direction[k] = 0.9 * state.direction[k] + 0.1 * step[k]
    return turned


@njit(cache=True)
def _count_pass(state):
    """Number a stroke that sprays, unless it only links two passes."""
    if state.pass_counted:
        return
    d, axis = state.direction, state.pass_axis
    if d[0] == 0.0 and d[1] == 0.0 and d[2] == 0.0:
        if state.spray_pass < 0:
            state.spray_pass = 0
        return
    first = axis[0] == 0.0 and axis[1] == 0.0 and axis[2] == 0.0
    if first:
        for k in range(3):
            axis[k] = d[k]
        state.spray_pass = 0
        state.pass_counted = 1
        return
    norms = math.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
    norms *= math.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    if abs(d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2]) > COS_PASS * norms:
        state.spray_pass += 1
    state.pass_counted = 1


@njit(cache=True)
def follow(states, position, velocity, dwell, flow, after_gap):
    """Number strokes and passes and measure back to the last turn and trigger change.

    Args:
        states: (1,) record of dtype STATE, updated in place.
        position, velocity: (M, 3). dwell, flow: (M,). after_gap: (M,) bool.

    Returns:
        stroke, spray_pass (M,) int64; open_flow, since_on_s, since_off_s, from_turn_m (M,).
    """
    count = len(dwell)
    stroke = np.empty(count, np.int64)
    spray_pass = np.empty(count, np.int64)
    open_flow = np.empty(count)
    since_on = np.empty(count)
    since_off = np.empty(count)
    from_turn = np.empty(count)
    state = states[0]
    for i in range(count):
        v = velocity[i]
        half_step = 0.5 * dwell[i] * math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
        turned = False
        if state.started == 0 or after_gap[i]:
            turned = state.started == 1
            for k in range(3):
                state.anchor[k] = position[i, k]
                state.direction[k] = 0.0
            if turned:
                state.flow = 0.0
                state.since_on_s = state.since_off_s = np.inf
        else:
            turned = _turned(state, position[i])
        closed = state.flow > 0.0 and flow[i] == 0.0
        if turned:
            state.stroke += 1
            state.pass_counted = 0
            state.from_turn_m = 0.0
        state.started = 1

        elapsed = 0.5 * (state.dwell_s + dwell[i])
        state.since_on_s += elapsed
        state.since_off_s += elapsed
        if flow[i] > 0.0 and state.flow == 0.0:
            state.since_on_s = 0.5 * dwell[i]
        if closed:
            state.since_off_s = 0.5 * dwell[i]
        if flow[i] > 0.0:
            _count_pass(state)
            state.open_flow = flow[i]

        stroke[i], spray_pass[i], open_flow[i] = state.stroke, state.spray_pass, state.open_flow
        since_on[i], since_off[i] = state.since_on_s, state.since_off_s
        from_turn[i] = state.from_turn_m + half_step
        state.from_turn_m += 2.0 * half_step
        state.flow, state.dwell_s = flow[i], dwell[i]
    return stroke, spray_pass, open_flow, since_on, since_off, from_turn


@njit(cache=True)
def look_ahead(stroke, velocity, dwell, flow, since_on):
    """Measure forward to the next trigger change and turn, within whole strokes.

    Args:
        stroke, since_on: (M,) from ``follow``; every stroke complete. velocity: (M, 3).
        dwell, flow: (M,).

    Returns:
        until_on_s, until_off_s, to_turn_m (M,); inf where a stroke ends without such an event.
    """
    count = len(dwell)
    until_on = np.empty(count)
    until_off = np.empty(count)
    to_turn = np.empty(count)
    on, off, turn = np.inf, np.inf, 0.0
    for i in range(count - 1, -1, -1):
        v = velocity[i]
        step = dwell[i] * math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
        if i == count - 1 or stroke[i + 1] != stroke[i]:
            # The gun may close at the very turn; a gap closes it, and it opens again behind it.
            closed = i == count - 1 or flow[i + 1] == 0.0 or since_on[i + 1] < dwell[i + 1]
            closes = flow[i] > 0.0 and closed
            on, off, turn = np.inf, (0.0 if closes else np.inf), 0.0
        elif flow[i + 1] > 0.0 and flow[i] == 0.0:
            on = 0.0
        elif flow[i + 1] == 0.0 and flow[i] > 0.0:
            off = 0.0
        until_on[i], until_off[i] = on + 0.5 * dwell[i], off + 0.5 * dwell[i]
        to_turn[i] = turn + 0.5 * step
        on, off, turn = on + dwell[i], off + dwell[i], turn + step
    return until_on, until_off, to_turn
