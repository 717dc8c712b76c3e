"""Passes: the stretches along one line of the part on which the gun sprays.

A pass continues over openings and closings of the gun along its line; links between passes are no
passes. The state machine runs over the sub-steps in order and its state is carried from call to
call. Each sub-step raises these events in the order of the table.

=======  ======================================  =======  ====================================
state    event                                   next     what happens
=======  ======================================  =======  ====================================
runs     a gap                                   ended *
runs     a heading step that leaves the mean     ended *
runs     another heading step, the gun was open  runs     the mean takes it in
runs     the gun opens on another track          ended *
awaited  the gun is open, no heading is known    awaited  the number is 0
awaited  the gun is open                         runs     the number is 0; the heading is the
                                                          pass's mean
ended    the gun is open on the line of the      runs     the number goes up; the heading is the
         last pass, either way                            pass's mean
ended    the gun is open off that line: a link   ended
=======  ======================================  =======  ====================================

``*`` Pass 0 is awaited once more if it ends after less than 40 mm: the gun opened at a turn that
shows only now, and the heading was that of the approach.
"""

import math

import numpy as np

from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.motion.strokes import (
    HEADING_STEP_M,
    LATEST_NOTICE_M,
    carry,
    cosine,
    difference,
    dot,
    leaves,
    take_in,
)

AWAITED, RUNS, ENDED = 0, 1, 2
_VECTORS = ('position', 'normal', 'mean', 'carried', 'closed_at')
PASS_STATE = np.dtype(
    [('number', 'i8'), ('state', 'i8'), ('length_m', 'f8'), ('flow', 'f8')]
    + [(name, 'f8', 3) for name in _VECTORS]
)


def first_pass(flow_before: float) -> np.ndarray:
    """State before the first sub-step: (1,) record, from the flow that was on until then."""
    state = np.zeros(1, PASS_STATE)
    state['number'] = -1
    state['flow'] = flow_before
    return state


@njit
def _continue(state, heading, step, after_gap):
    """Follow a pass that runs to here, or end it."""
    if after_gap or (step > 0.0 and leaves(heading, state.mean, state.carried)):
        _end(state)
    elif step > 0.0 and state.flow > 0.0:
        state.length_m += step
        take_in(heading, step, state.length_m, state.mean, state.carried)


@njit
def _end(state):
    state.state = ENDED
    if state.number == 0 and state.length_m < LATEST_NOTICE_M:
        state.state = AWAITED
        for k in range(3):
            state.mean[k] = state.carried[k] = 0.0


@njit
def _spray(state, heading):
    """Begin a pass here, where the gun is open, if none runs and this is no link."""
    if state.state == RUNS and state.flow == 0.0 and _on_another_track(state):
        _end(state)
    if state.state == RUNS:
        return
    if dot(heading, heading) == 0.0:
        state.number = max(state.number, 0)
        return
    along = max(abs(cosine(heading, state.mean)), abs(cosine(heading, state.carried)))
    # A pass lies within 45 degrees of the heading of the last one, either way; others are links.
    if state.state == AWAITED or along > math.sqrt(0.5):
        state.number = 0 if state.state == AWAITED else state.number + 1
        state.state = RUNS
        state.length_m = 0.0
        take_in(heading, 1.0, 1.0, state.mean, state.carried)


@njit
def _on_another_track(state):
    """Whether the gun has left the line on which it closed, seen along the tool axis."""
    x, y, z = difference(state.position, state.closed_at)
    off = dot((x, y, z), state.normal)
    between = x - off * state.normal[0], y - off * state.normal[1], z - off * state.normal[2]
    if dot(between, between) < HEADING_STEP_M**2:
        return False
    # A gun that opens more than 30 degrees off the line on which it closed is on another track.
    return cosine(between, state.carried) < math.sqrt(0.75)


@njit(cache=True)
@named_for_its_code
def follow_passes(states, position, normal, heading, step, flow, after_gap):
    """Number the spraying passes: (M,) int64, the one that runs or ran last, -1 before the first.

    ``states`` (1,) is updated in place; position and normal (M, 3) are TCP [m] and tool z, heading
    (M, 3) and step (M,) are from ``follow_strokes``, flow (M,) is relative, 0 gun off, and
    after_gap (M,) bool.
    """
    spray_pass = np.empty(len(flow), np.int64)
    state = states[0]
    for i in range(len(flow)):
        carry(state.carried, state.normal, normal[i])
        for k in range(3):
            state.normal[k] = normal[i, k]
            if state.flow > 0.0:
                state.closed_at[k] = state.position[k]
            state.position[k] = position[i, k]
        if state.state == RUNS:
            _continue(state, heading[i], step[i], after_gap[i])
        if after_gap[i]:
            state.flow = 0.0
        if flow[i] > 0.0:
            _spray(state, heading[i])
        spray_pass[i], state.flow = state.number, flow[i]
    return spray_pass
