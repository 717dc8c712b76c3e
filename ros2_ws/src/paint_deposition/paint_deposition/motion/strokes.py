"""Strokes and passes, numbered over the sub-steps of a path, and the time since the gun switched.

Strokes are the straight or gently curved stretches between the turns of the tool path.

The state machine runs over the sub-steps in order. Its state is carried from call to call, so that
a live stream and an offline run number their strokes alike. A turn is a heading more than 60
degrees off the stroke's mean. The mean is kept twice, in space and as the tool carries it along
when it is tilted, and a path leaves it only where it leaves both: neither a gun that follows a
curved part turns, nor one that is tilted on a straight path.

The first sub-step, or a gap before one, begins a stroke without a heading, whose turn is there;
the first heading step is its mean, and each that keeps to the mean is taken in. One that leaves it
begins the next stroke: the turn is where the two legs meet, behind there.

A stroke is new while its ``length_m`` is zero.

Passes are the stretches along one line of the part on which the gun sprays. A pass continues over
openings and closings of the gun along its line; links between passes are no passes. Their state
machine, too, runs over the sub-steps in order. Each raises these events in the order of the table.

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
from paint_deposition.kernel.fast_math import cross, difference, dot, length
from paint_deposition.motion.trajectory import ONLY_BRUSH

# The path's heading is judged over this travel, so that jitter at rest is no turn [m].
HEADING_STEP_M = 0.01
# The path leaves a mean heading where it is more than 60 degrees off.
COS_TURN = 0.5
# A sharp turn is noticed at most so far behind it, after two heading steps [m].
LATEST_NOTICE_M = 0.04


@njit
def cosine(a, b):
    """Cosine of the angle between two vectors (3,); 0 if one of them has no length."""
    lengths = math.sqrt(dot(a, a) * dot(b, b))
    return dot(a, b) / lengths if lengths > 0.0 else 0.0


@njit
def carry(vector, before, after):
    """Turn a vector (3,) by the smallest rotation from one unit normal to the next, in place."""
    axis, cos = cross(before, after), dot(before, after)
    if cos < -0.99:  # The tool was turned over at once: no rotation is the smallest.
        return
    once = cross(axis, vector)
    twice = cross(axis, once)
    for k in range(3):
        vector[k] = vector[k] + once[k] + twice[k] / (1.0 + cos)


@njit
def leaves(heading, mean, carried):
    """Whether a heading is more than 60 degrees off a mean, both in space and to the tool."""
    return cosine(heading, mean) < COS_TURN and cosine(heading, carried) < COS_TURN


@njit
def take_in(heading, step_m, length_m, mean, carried):
    """Update a mean over a length, this step included, in place."""
    # A mean reaches back over this travel; curves of half of it as their radius still turn [m].
    gain = min(step_m / min(length_m, 1.0), 1.0)
    for k in range(3):
        mean[k] += gain * (heading[k] - mean[k])
        carried[k] += gain * (heading[k] - carried[k])


def first_states(flow_before: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(1,) states of stroke, pass and trigger before the first sub-step, by the flow before."""
    # anchor and earlier are where the last two heading steps began, with the path since then: a
    # turn that shows now lies behind the earlier one.
    lengths = ('from_turn_m', 'length_m', 'since_anchor_m', 'since_earlier_m')
    vectors = ('position', 'normal', 'anchor', 'earlier', 'heading', 'mean', 'carried')
    fields = [('number', 'i8'), *((name, 'f8') for name in lengths)]
    of_stroke = np.zeros(1, np.dtype([*fields, *((name, 'f8', 3) for name in vectors)]))
    places = ('position', 'normal', 'mean', 'carried', 'closed_at')
    fields = [('number', 'i8'), ('state', 'i8'), ('length_m', 'f8'), ('flow', 'f8')]
    of_pass = np.zeros(1, np.dtype([*fields, *((name, 'f8', 3) for name in places)]))
    of_stroke['number'] = of_pass['number'] = -1
    of_pass['flow'] = flow_before
    numbers = ('flow', 'open_flow', 'dwell_s', 'since_on_s', 'since_off_s')
    fields = [*((name, 'f8') for name in numbers), ('open_brush', 'i8')]
    first = flow_before, 1.0, 0.0, np.inf, np.inf, ONLY_BRUSH
    return of_stroke, of_pass, np.array([first], np.dtype(fields))


@njit
def _take_step(state, step_m):
    """Take a heading step into the stroke, or begin the next stroke with it: true if it turns."""
    turns = state.length_m > 0.0 and leaves(state.heading, state.mean, state.carried)
    if turns:
        state.number += 1
        state.length_m = 0.0
        # How far back the stroke turned, if straight up to there and straight since: legs
        # a + b = path and a + b cos = along, b sin = across, solved for b.
        chord = difference(state.position, state.earlier)
        square = dot(chord, chord)
        along = math.sqrt(square) * cosine(chord, state.mean)
        detour = state.since_earlier_m - along
        behind = (square - along**2 + detour**2) / (2.0 * detour) if detour > 0.0 else 0.0
        state.from_turn_m = min(behind, state.since_earlier_m, LATEST_NOTICE_M)
    state.length_m += step_m
    take_in(state.heading, step_m, state.length_m, state.mean, state.carried)
    state.since_earlier_m, state.since_anchor_m = state.since_anchor_m, 0.0
    for k in range(3):
        state.earlier[k], state.anchor[k] = state.anchor[k], state.position[k]
    return turns


@njit(cache=True)
@named_for_its_code
def follow_strokes(states, position, normal, velocity, dwell, after_gap):
    """Number the strokes and measure back along the path to where each began.

    ``states`` (1,) is updated in place; position, normal, velocity (M, 3) are TCP [m], tool z and
    speed of the TCP [m/s], dwell (M,) durations [s], after_gap (M,) bool.

    Returns:
        stroke (M,) int64; from_turn_m (M,); heading (M, 3), the last unit heading, zero before
        there is one; and step_m (M,), length of the heading step that ended here, or 0.
    """
    count = len(dwell)
    stroke, from_turn = np.empty(count, np.int64), np.empty(count)
    heading, step = np.empty((count, 3)), np.zeros(count)
    state = states[0]
    for i in range(count):
        half_step = 0.5 * dwell[i] * length(velocity[i])
        carry(state.carried, state.normal, normal[i])
        if state.number < 0 or after_gap[i]:
            # A stroke of unknown heading, as at the start and behind a gap.
            state.number += 1
            state.from_turn_m = state.length_m = 0.0
            state.since_anchor_m = state.since_earlier_m = 0.0
            for k in range(3):
                state.anchor[k] = state.earlier[k] = state.position[k] = position[i, k]
                state.heading[k] = state.mean[k] = state.carried[k] = 0.0
        else:
            travel = length(difference(position[i], state.position))
            state.since_anchor_m += travel
            state.since_earlier_m += travel
            way = difference(position[i], state.anchor)
            way_m = length(way)
            is_step = way_m >= HEADING_STEP_M
            for k in range(3):
                state.position[k] = position[i, k]
                if is_step:
                    state.heading[k] = way[k] / way_m
            step[i] = way_m if is_step else 0.0
            if is_step and _take_step(state, way_m):
                state.from_turn_m -= half_step
        stroke[i], from_turn[i] = state.number, state.from_turn_m + half_step
        state.from_turn_m += 2.0 * half_step
        for k in range(3):
            state.normal[k], heading[i, k] = normal[i, k], state.heading[k]
    return stroke, from_turn, heading, step


@njit(cache=True)
@named_for_its_code
def look_ahead(stroke, velocity, dwell, flow, since_on, from_turn):
    """Measure forward to the next trigger change and turn, within whole strokes.

    All (M,) but velocity (M, 3); every stroke is complete. Returns until_on_s, until_off_s and
    to_turn_m (M,); inf where a stroke ends without such an event.
    """
    count = len(dwell)
    until_on, until_off, to_turn = np.empty(count), np.empty(count), np.empty(count)
    on, off, turn, behind_m = np.inf, np.inf, 0.0, 0.0
    for i in range(count - 1, -1, -1):
        step = dwell[i] * length(velocity[i])
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


AWAITED, RUNS, ENDED = 0, 1, 2


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
    if state.state == RUNS and state.flow == 0.0:
        # The way from where it closed, seen along the tool axis.
        x, y, z = difference(state.position, state.closed_at)
        off = dot((x, y, z), state.normal)
        way = x - off * state.normal[0], y - off * state.normal[1], z - off * state.normal[2]
        # A gun that opens more than 30 degrees off the line on which it closed is on another
        # track.
        if dot(way, way) >= HEADING_STEP_M**2 and cosine(way, state.carried) < math.sqrt(0.75):
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
            turns = step[i] > 0.0 and leaves(heading[i], state.mean, state.carried)
            if after_gap[i] or turns:
                _end(state)
            elif step[i] > 0.0 and state.flow > 0.0:
                state.length_m += step[i]
                take_in(heading[i], step[i], state.length_m, state.mean, state.carried)
        if after_gap[i]:
            state.flow = 0.0
        if flow[i] > 0.0:
            _spray(state, heading[i])
        spray_pass[i], state.flow = state.number, flow[i]
    return spray_pass


@njit(cache=True)
def follow_trigger(states, dwell, flow, brush, after_gap):
    """Measure back to the last opening and closing of the gun; a gap forgets them.

    ``states`` (1,) is updated in place; all others (M,): dwell [s], relative flow, 0 gun off,
    int64 brush, which counts where the gun is on, and after_gap.

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
