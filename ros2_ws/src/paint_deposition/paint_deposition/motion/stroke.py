"""Strokes: the straight or gently curved stretches between the turns of the tool path.

The state machine runs over the sub-steps in order. It is carried from call to call, so that a
live stream and an offline run number their strokes alike.

=======  =====================================  =======  =====================================
state    event                                  next     what happens
=======  =====================================  =======  =====================================
new      first sub-step, or a gap before it     new      the stroke's number goes up; the turn
                                                         is here
new      less than a heading step since then    new
new      a heading step                         runs     it is the stroke's mean heading
runs     less than a heading step               runs
runs     a heading step that keeps to the mean  runs     the mean takes it in
runs     a heading step that leaves the mean    runs     the stroke's number goes up; the turn
                                                         is where the two legs meet, behind
                                                         here; the step is the new mean
runs     a gap                                  new      as at the first sub-step
=======  =====================================  =======  =====================================

A stroke is new while its ``length_m`` is zero.
"""

import math

import numpy as np
from numba import njit

from paint_deposition.kernel.code_cache import named_for_its_code
from paint_deposition.motion.heading import (
    HEADING_STEP_M,
    LATEST_NOTICE_M,
    carry,
    cosine,
    dot,
    leaves,
    take_in,
)

STROKE_STATE = np.dtype(
    [
        ('number', 'i8'),
        ('from_turn_m', 'f8'),
        ('length_m', 'f8'),
        ('position', 'f8', 3),
        ('normal', 'f8', 3),
        # Where the last two heading steps began and the path since then: a turn that shows now
        # lies behind the earlier one.
        ('anchor', 'f8', 3),
        ('earlier', 'f8', 3),
        ('since_anchor_m', 'f8'),
        ('since_earlier_m', 'f8'),
        ('heading', 'f8', 3),
        ('mean', 'f8', 3),
        ('carried', 'f8', 3),
    ]
)


def first_stroke() -> np.ndarray:
    """State before the first sub-step: (1,) record."""
    state = np.zeros(1, STROKE_STATE)
    state['number'] = -1
    return state


@njit
def _begin_anew(state, position):
    """Begin a stroke of unknown heading, as at the start and behind a gap."""
    state.number += 1
    state.from_turn_m = state.length_m = state.since_anchor_m = state.since_earlier_m = 0.0
    for k in range(3):
        state.anchor[k] = state.earlier[k] = state.position[k] = position[k]
        state.heading[k] = state.mean[k] = state.carried[k] = 0.0


@njit
def _advance(state, position):
    """Follow the path to its next position; length of the heading step that ends here, or 0."""
    moved = position - state.position
    travel = math.sqrt(dot(moved, moved))
    state.since_anchor_m += travel
    state.since_earlier_m += travel
    step = position - state.anchor
    length = math.sqrt(dot(step, step))
    for k in range(3):
        state.position[k] = position[k]
        if length >= HEADING_STEP_M:
            state.heading[k] = step[k] / length
    return length if length >= HEADING_STEP_M else 0.0


@njit
def _take_step(state, length):
    """Take a heading step into the stroke, or begin the next stroke with it: true if it turns."""
    turns = state.length_m > 0.0 and leaves(state.heading, state.mean, state.carried)
    if turns:
        state.number += 1
        state.from_turn_m = _behind_turn_m(state)
        state.length_m = 0.0
    state.length_m += length
    take_in(state.heading, length, state.length_m, state.mean, state.carried)
    state.since_earlier_m, state.since_anchor_m = state.since_anchor_m, 0.0
    for k in range(3):
        state.earlier[k], state.anchor[k] = state.anchor[k], state.position[k]
    return turns


@njit
def _behind_turn_m(state):
    """How far back the stroke turned, if straight up to there and straight since."""
    chord = state.position - state.earlier
    square = dot(chord, chord)
    along = math.sqrt(square) * cosine(chord, state.mean)
    detour = state.since_earlier_m - along
    # Legs a + b = path and a + b cos = along, b sin = across, solved for b.
    behind = (square - along**2 + detour**2) / (2.0 * detour) if detour > 0.0 else 0.0
    return min(behind, state.since_earlier_m, LATEST_NOTICE_M)


@njit(cache=True)
@named_for_its_code
def follow_strokes(states, position, normal, velocity, dwell, after_gap):
    """Number the strokes and measure back along the path to where each began.

    Args:
        states: (1,) record of dtype STROKE_STATE, updated in place.
        position: (M, 3) TCP [m].
        normal: (M, 3) tool axis z.
        velocity: (M, 3) of the TCP [m/s].
        dwell: (M,) duration of the sub-steps [s].
        after_gap: (M,) bool, whether poses are missing before the sub-step.

    Returns:
        stroke (M,) int64; from_turn_m (M,); heading (M, 3), the last unit heading, zero before
        there is one; and step_m (M,), length of the heading step that ended here, or 0.
    """
    count = len(dwell)
    stroke, from_turn = np.empty(count, np.int64), np.empty(count)
    heading, step = np.empty((count, 3)), np.zeros(count)
    state = states[0]
    for i in range(count):
        v = velocity[i]
        half_step = 0.5 * dwell[i] * math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
        carry(state.carried, state.normal, normal[i])
        if state.number < 0 or after_gap[i]:
            _begin_anew(state, position[i])
        else:
            step[i] = _advance(state, position[i])
            if step[i] > 0.0 and _take_step(state, step[i]):
                state.from_turn_m -= half_step
        stroke[i], from_turn[i] = state.number, state.from_turn_m + half_step
        state.from_turn_m += 2.0 * half_step
        for k in range(3):
            state.normal[k], heading[i, k] = normal[i, k], state.heading[k]
    return stroke, from_turn, heading, step
