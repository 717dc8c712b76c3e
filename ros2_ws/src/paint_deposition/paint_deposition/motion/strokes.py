"""Strokes and passes: where the path turns, and how far sub-steps are behind turns and triggers.

A turn leaves the heading of the stroke so far, in space and as the tool carries it along: a gun
that follows a curved part does not turn, nor does one that is tilted on a straight way. Compiled
and sequential, with the state carried in one record from call to call, so that a live stream and
an offline run number their strokes alike; in one file, as compiled code is kept by its file.
"""

import math

import numpy as np
from numba import njit

# The path's heading is judged over this travel, so that jitter at rest is no turn [m].
HEADING_STEP_M = 0.01
# A stroke's heading so far is its mean over this travel; curves of half of it still turn [m].
MEMORY_M = 1.0
# A stroke ends where the path leaves its heading by more than 60 degrees.
COS_TURN = 0.5
# A sharp turn is noticed at most so far behind it, after two heading steps [m].
LATEST_NOTICE_M = 0.04
# A pass sprays within 45 degrees of the heading of the last one, either way; others are links.
COS_PASS = math.sqrt(0.5)
# A gun that opens more than 30 degrees off the way on which it closed is on another track.
COS_TRACK = math.sqrt(0.75)

STATE = np.dtype(
    [
        ('stroke', 'i8'),
        ('spray_pass', 'i8'),
        ('pass_runs', 'i8'),
        ('started', 'i8'),
        ('flow', 'f8'),
        ('open_flow', 'f8'),
        ('dwell_s', 'f8'),
        ('since_on_s', 'f8'),
        ('since_off_s', 'f8'),
        ('from_turn_m', 'f8'),
        # Path since the last two anchors: a turn that shows now lies behind the earlier one.
        ('since_anchor_m', 'f8'),
        ('since_earlier_m', 'f8'),
        ('stroke_m', 'f8'),
        ('pass_m', 'f8'),
        ('position', 'f8', 3),
        ('anchor', 'f8', 3),
        ('earlier', 'f8', 3),
        ('normal', 'f8', 3),
        # Over the last step; mean of the stroke so far, and of the last pass while it sprayed,
        # in space and carried by the tool.
        ('heading', 'f8', 3),
        ('stroke_heading', 'f8', 3),
        ('stroke_carried', 'f8', 3),
        ('pass_heading', 'f8', 3),
        ('pass_carried', 'f8', 3),
        ('closed_at', 'f8', 3),
    ]
)


@njit(cache=True)
def _dot(a, b):
    """Scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _cosine(a, b):
    """Cosine of the angle between two vectors (3,); 0 if one of them is none."""
    lengths = math.sqrt(_dot(a, a) * _dot(b, b))
    return _dot(a, b) / lengths if lengths > 0.0 else 0.0


@njit(cache=True)
def _carry(vector, before, after):
    """Turn a vector the short way from one unit normal to the next, in place."""
    wx = before[1] * after[2] - before[2] * after[1]
    wy = before[2] * after[0] - before[0] * after[2]
    wz = before[0] * after[1] - before[1] * after[0]
    cos = _dot(before, after)
    if cos < -0.99:  # turned over at once: no way is the short one
        return
    x, y, z = vector[0], vector[1], vector[2]
    cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    vector[0] = x + cx + (wy * cz - wz * cy) / (1.0 + cos)
    vector[1] = y + cy + (wz * cx - wx * cz) / (1.0 + cos)
    vector[2] = z + cz + (wx * cy - wy * cx) / (1.0 + cos)


@njit(cache=True)
def _carry_along(state, normal):
    """Carry the headings that go with the tool on to its new axis z (3,)."""
    if state.started:
        _carry(state.stroke_carried, state.normal, normal)
        _carry(state.pass_carried, state.normal, normal)
    for k in range(3):
        state.normal[k] = normal[k]


@njit(cache=True)
def _begin_heading(state, position):
    """Forget the heading, as at the start and behind a gap."""
    state.stroke_m = state.since_anchor_m = state.since_earlier_m = 0.0
    for k in range(3):
        state.anchor[k] = state.earlier[k] = state.position[k] = position[k]
        state.heading[k] = state.stroke_heading[k] = state.stroke_carried[k] = 0.0


@njit(cache=True)
def _left(heading, mean, carried):
    """Whether a heading is more than 60 degrees off a mean one, in space and to the tool."""
    return _cosine(heading, mean) < COS_TURN and _cosine(heading, carried) < COS_TURN


@njit(cache=True)
def _average(heading, mean, carried, gain):
    """Take a heading into its means, in place."""
    for k in range(3):
        mean[k] += gain * (heading[k] - mean[k])
        carried[k] += gain * (heading[k] - carried[k])


@njit(cache=True)
def _advance(state, position):
    """Follow the path to its next position; length of the heading step that ended here, or 0."""
    moved = position - state.position
    travel = math.sqrt(_dot(moved, moved))
    state.since_anchor_m += travel
    state.since_earlier_m += travel
    step = position - state.anchor
    length = math.sqrt(_dot(step, step))
    for k in range(3):
        state.position[k] = position[k]
        if length >= HEADING_STEP_M:
            state.heading[k] = step[k] / length
    return length if length >= HEADING_STEP_M else 0.0


@njit(cache=True)
def _move_anchor(state):
    """Begin the next heading step."""
    state.since_earlier_m = state.since_anchor_m
    state.since_anchor_m = 0.0
    for k in range(3):
        state.earlier[k] = state.anchor[k]
        state.anchor[k] = state.position[k]


@njit(cache=True)
def _behind_turn_m(state):
    """How far back the stroke turned, if straight up to there and straight since."""
    chord = state.position - state.earlier
    square = _dot(chord, chord)
    along = math.sqrt(square) * _cosine(chord, state.stroke_heading)
    detour = state.since_earlier_m - along
    # Legs a + b = path and a + b cos = along, b sin = across, solved for b.
    behind = (square - along**2 + detour**2) / (2.0 * detour) if detour > 0.0 else 0.0
    return min(behind, state.since_earlier_m, LATEST_NOTICE_M)


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
    if _left(state.heading, state.pass_heading, state.pass_carried):
        _end_pass(state)
    elif state.flow > 0.0:
        state.pass_m += length
        gain = min(length / min(state.pass_m, MEMORY_M), 1.0)
        _average(state.heading, state.pass_heading, state.pass_carried, gain)


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
    between -= _dot(between, state.normal) * state.normal
    if _dot(between, between) < HEADING_STEP_M**2:
        return False
    return _cosine(between, state.pass_carried) < COS_TRACK


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
    first = _dot(state.pass_heading, state.pass_heading) == 0.0
    in_space = abs(_cosine(state.heading, state.pass_heading))
    to_the_tool = abs(_cosine(state.heading, state.pass_carried))
    if first or max(in_space, to_the_tool) > COS_PASS:
        state.spray_pass = 0 if first else state.spray_pass + 1
        state.pass_runs = 1
        state.pass_m = 0.0
        _average(state.heading, state.pass_heading, state.pass_carried, 1.0)


@njit(cache=True)
def _follow_heading(state, position):
    """Follow the path's heading to here; true where a stroke begins."""
    length = _advance(state, position)
    if length == 0.0:
        return False
    _follow_pass(state, length)
    turned = state.stroke_m > 0.0 and _left(
        state.heading, state.stroke_heading, state.stroke_carried
    )
    if turned:
        state.from_turn_m = _behind_turn_m(state)
        state.stroke_m = 0.0
    state.stroke_m += length
    gain = min(length / min(state.stroke_m, MEMORY_M), 1.0)
    _average(state.heading, state.stroke_heading, state.stroke_carried, gain)
    _move_anchor(state)
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
    stroke, spray_pass = np.empty(count, np.int64), np.empty(count, np.int64)
    open_flow, from_turn = np.empty(count), np.empty(count)
    since_on, since_off = np.empty(count), np.empty(count)
    state = states[0]
    for i in range(count):
        v = velocity[i]
        half_step = 0.5 * dwell[i] * math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
        _carry_along(state, normal[i])
        for k in range(3):
            if state.flow > 0.0:
                state.closed_at[k] = state.position[k]
        if state.started == 0 or after_gap[i]:
            turned = state.started == 1
            _begin_heading(state, position[i])
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
