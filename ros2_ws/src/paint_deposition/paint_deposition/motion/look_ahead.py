"""What lies ahead of each sub-step within its stroke: the next trigger change and turn."""

import math

import numpy as np
from numba import njit


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
