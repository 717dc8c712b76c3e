"""Strokes and passes: where the path turns, and how far each sub-step is from turns and triggers.

Compiled and sequential, with the state carried in one record from call to call, so that a live
stream and an offline run number their strokes alike.
"""

import math

import numpy as np
from numba import njit

from paint_deposition.motion.heading import (
    HEADING_STEP_M,
    LATEST_NOTICE_M,
    MEMORY_M,
    STATE,
    advance,
    average,
    begin_heading,
    behind_turn_m,
    carry_along,
    cosine,
    dot,
    left,
    move_anchor,
)

# A stroke that sprays is a pass if it runs within 45 degrees of the last one, either way; others
# are links.
COS_PASS = math.sqrt(0.5)
# A gun that opens again more than 30 degrees off the way on which it closed is on another track.
COS_TRACK = math.sqrt(0.75)


def new_state(flow_before: float) -> np.ndarray:
    """State before the first pose, (1,) record; the flow that is assumed to have been on."""
    state = np.zeros(1, STATE)
    state['spray_pass'] = -1
    state['flow'] = flow_before
    state['open_flow'] = 1.0
    state['since_on_s'] = state['since_off_s'] = np.inf
    return state


@njit(cache=True)
def _follow_pass(state, length):
    """End the pass where the path leaves its heading; else take the last step into that."""
    if not state.pass_runs:
        return
    if left(state.heading, state.pass_heading, state.pass_carried):
        _end_pass(state)
    elif state.flow > 0.0:
        state.pass_m += length
        gain = min(length / min(state.pass_m, MEMORY_M), 1.0)
        average(state.heading, state.pass_heading, state.pass_carried, gain)


@njit(cache=True)
def _end_pass(state):
    if state.spray_pass == 0 and state.pass_runs and state.pass_m < LATEST_NOTICE_M:
        # The gun opened at a turn that shows only now: the heading was that of the approach.
        for k in range(3):
            state.pass_heading[k] = state.pass_carried[k] = 0.0
    state.pass_runs = 0


@njit(cache=True)
def _on_another_track(state, position):
    """Whether the gun, open again, has left the way on which it closed, seen along the tool."""
    between = position - state.closed_at
    between -= dot(between, state.normal) * state.normal
    if dot(between, between) < HEADING_STEP_M**2:
        return False
    return cosine(between, state.pass_carried) < COS_TRACK


@njit(cache=True)
def _count_pass(state, position):
    """Number the pass that sprays here, if it is one."""
    if state.pass_runs and state.flow == 0.0 and _on_another_track(state, position):
        _end_pass(state)
    if state.pass_runs:
        return
    if state.stroke_m == 0.0:
        state.spray_pass = max(state.spray_pass, 0)
        return
    first = dot(state.pass_heading, state.pass_heading) == 0.0
    in_space = abs(cosine(state.heading, state.pass_heading))
    to_the_tool = abs(cosine(state.heading, state.pass_carried))
    if first or max(in_space, to_the_tool) > COS_PASS:
        state.spray_pass = 0 if first else state.spray_pass + 1
        state.pass_runs = 1
        state.pass_m = 0.0
        average(state.heading, state.pass_heading, state.pass_carried, 1.0)


@njit(cache=True)
def _follow_heading(state, position):
    """Follow the path's heading to here; true where a stroke begins."""
    length = advance(state, position)
    if length == 0.0:
        return False
    _follow_pass(state, length)
    turned = state.stroke_m > 0.0 and left(
        state.heading, state.stroke_heading, state.stroke_carried
    )
    if turned:
        state.from_turn_m = behind_turn_m(state)
        state.stroke_m = 0.0
    state.stroke_m += length
    gain = min(length / min(state.stroke_m, MEMORY_M), 1.0)
    average(state.heading, state.stroke_heading, state.stroke_carried, gain)
    move_anchor(state)
    return turned


@njit(cache=True)
def follow(states, position, normal, velocity, dwell, flow, after_gap):
    """Number strokes and passes and measure back to the last turn and trigger change.

    Args:
        states: (1,) record of dtype STATE, updated in place.
        position, normal, velocity: (M, 3); the normal is the tool's axis z. dwell, flow: (M,).
        after_gap: (M,) bool.

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
        carry_along(state, normal[i])
        for k in range(3):
            if state.flow > 0.0:
                state.closed_at[k] = state.position[k]
        if state.started == 0 or after_gap[i]:
            turned = state.started == 1
            begin_heading(state, position[i])
            if turned:
                _end_pass(state)
                state.from_turn_m = state.flow = 0.0
                state.since_on_s = state.since_off_s = np.inf
        else:
            turned = _follow_heading(state, position[i])
            if turned:
                state.from_turn_m -= half_step
        state.stroke += turned
        state.started = 1
        closed = state.flow > 0.0 and flow[i] == 0.0

        elapsed = 0.5 * (state.dwell_s + dwell[i])
        state.since_on_s += elapsed
        state.since_off_s += elapsed
        if flow[i] > 0.0 and state.flow == 0.0:
            state.since_on_s = 0.5 * dwell[i]
        if closed:
            state.since_off_s = 0.5 * dwell[i]
        if flow[i] > 0.0:
            _count_pass(state, position[i])
            state.open_flow = flow[i]

        stroke[i], spray_pass[i], open_flow[i] = state.stroke, state.spray_pass, state.open_flow
        since_on[i], since_off[i] = state.since_on_s, state.since_off_s
        from_turn[i] = state.from_turn_m + half_step
        state.from_turn_m += 2.0 * half_step
        state.flow, state.dwell_s = flow[i], dwell[i]
    return stroke, spray_pass, open_flow, since_on, since_off, from_turn


@njit(cache=True)
def look_ahead(stroke, velocity, dwell, flow, since_on, from_turn):
    """Measure forward to the next trigger change and turn, within whole strokes.

    Args:
        stroke, since_on, from_turn: (M,) from ``follow``; every stroke complete. velocity: (M, 3).
        dwell, flow: (M,).

    Returns:
        until_on_s, until_off_s, to_turn_m (M,); inf where a stroke ends without such an event.
    """
    count = len(dwell)
    until_on = np.empty(count)
    until_off = np.empty(count)
    to_turn = np.empty(count)
    on, off, turn, behind_m = np.inf, np.inf, 0.0, 0.0
    for i in range(count - 1, -1, -1):
        v = velocity[i]
        step = dwell[i] * math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
        if i == count - 1 or stroke[i + 1] != stroke[i]:
            # The gun may close at the very turn; a gap closes it, and it opens again behind it.
            closed = i == count - 1 or flow[i + 1] == 0.0 or since_on[i + 1] < dwell[i + 1]
            closes = flow[i] > 0.0 and closed
            on, off, turn = np.inf, (0.0 if closes else np.inf), 0.0
            if i < count - 1:  # the turn is where it shows to be from behind, not where it shows
                turn = 0.5 * behind_m - from_turn[i + 1]
        elif flow[i + 1] > 0.0 and flow[i] == 0.0:
            on = 0.0
        elif flow[i + 1] == 0.0 and flow[i] > 0.0:
            off = 0.0
        until_on[i], until_off[i] = on + 0.5 * dwell[i], off + 0.5 * dwell[i]
        to_turn[i] = abs(turn + 0.5 * step)
        on, off, turn, behind_m = on + dwell[i], off + dwell[i], turn + step, step
    return until_on, until_off, to_turn
