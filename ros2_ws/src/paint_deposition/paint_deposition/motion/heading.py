"""Where the path heads, and where it turns: the state that is followed from sub-step to sub-step.

A turn leaves the heading of the stroke so far, both as it stands in space and as it is carried
along by the tool: a gun that follows a curved part does not turn, nor does one that is tilted on a
straight way.
"""

import math

import numpy as np
from numba import njit

# The path's heading is judged over this travel, so that jitter at rest is no turn [m].
HEADING_STEP_M = 0.01
# A stroke's heading so far is its mean over this travel: curves of up to half of it turn, wider
# ones are followed [m].
MEMORY_M = 1.0
# A stroke ends where the path leaves its heading by more than 60 degrees.
COS_TURN = 0.5
# A sharp turn is noticed at most so far behind it, after two heading steps [m].
LATEST_NOTICE_M = 0.04

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
def dot(a, b):
    """Scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def cosine(a, b):
    """Cosine of the angle between two vectors (3,); 0 if one of them is none."""
    lengths = math.sqrt(dot(a, a) * dot(b, b))
    return dot(a, b) / lengths if lengths > 0.0 else 0.0


@njit(cache=True)
def _carry(vector, before, after):
    """Turn a vector the short way from one unit normal to the next, in place."""
    wx = before[1] * after[2] - before[2] * after[1]
    wy = before[2] * after[0] - before[0] * after[2]
    wz = before[0] * after[1] - before[1] * after[0]
    cos = dot(before, after)
    if cos < -0.99:  # turned over at once: no way is the short one
        return
    x, y, z = vector[0], vector[1], vector[2]
    cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    vector[0] = x + cx + (wy * cz - wz * cy) / (1.0 + cos)
    vector[1] = y + cy + (wz * cx - wx * cz) / (1.0 + cos)
    vector[2] = z + cz + (wx * cy - wy * cx) / (1.0 + cos)


@njit(cache=True)
def carry_along(state, normal):
    """Carry the headings that go with the tool on to its new axis z (3,)."""
    if state.started:
        _carry(state.stroke_carried, state.normal, normal)
        _carry(state.pass_carried, state.normal, normal)
    for k in range(3):
        state.normal[k] = normal[k]


@njit(cache=True)
def begin_heading(state, position):
    """Forget the heading, as at the start and behind a gap."""
    state.stroke_m = state.since_anchor_m = state.since_earlier_m = 0.0
    for k in range(3):
        state.anchor[k] = state.earlier[k] = state.position[k] = position[k]
        state.heading[k] = state.stroke_heading[k] = state.stroke_carried[k] = 0.0


@njit(cache=True)
def left(heading, mean, carried):
    """Whether a heading is more than 60 degrees off a mean one, in space and to the tool."""
    return cosine(heading, mean) < COS_TURN and cosine(heading, carried) < COS_TURN


@njit(cache=True)
def average(heading, mean, carried, gain):
    """Take a heading into its means, in place."""
    for k in range(3):
        mean[k] += gain * (heading[k] - mean[k])
        carried[k] += gain * (heading[k] - carried[k])


@njit(cache=True)
def advance(state, position):
    """Follow the path to its next position; length of the heading step that ended here, or 0."""
    travel = 0.0
    for k in range(3):
        travel += (position[k] - state.position[k]) ** 2
        state.position[k] = position[k]
    state.since_anchor_m += math.sqrt(travel)
    state.since_earlier_m += math.sqrt(travel)
    step = position - state.anchor
    length = math.sqrt(dot(step, step))
    if length < HEADING_STEP_M:
        return 0.0
    for k in range(3):
        state.heading[k] = step[k] / length
    return length


@njit(cache=True)
def move_anchor(state):
    """Begin the next heading step."""
    state.since_earlier_m = state.since_anchor_m
    state.since_anchor_m = 0.0
    for k in range(3):
        state.earlier[k] = state.anchor[k]
        state.anchor[k] = state.position[k]


@njit(cache=True)
def behind_turn_m(state):
    """How far back the stroke turned, if straight up to there and straight since."""
    chord = state.position - state.earlier
    square = dot(chord, chord)
    along = math.sqrt(square) * cosine(chord, state.stroke_heading)
    detour = state.since_earlier_m - along
    # Legs a + b = path and a + b cos = along, b sin = across, solved for b.
    behind = (square - along**2 + detour**2) / (2.0 * detour) if detour > 0.0 else 0.0
    return min(behind, state.since_earlier_m, LATEST_NOTICE_M)
