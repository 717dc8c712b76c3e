"""Headings of the tool path and their running mean, which strokes and passes are judged by.

A mean is kept twice: in space, and as the tool carries it along when it is tilted. A path leaves
the mean only where it leaves both. So a gun that follows a curved part does not turn, and neither
does a gun that is tilted on a straight path.
"""

import math

from numba import njit

# The path's heading is judged over this travel, so that jitter at rest is no turn [m].
HEADING_STEP_M = 0.01
# A mean reaches back over this travel; curves of half of it as their radius still turn [m].
MEMORY_M = 1.0
# The path leaves a mean heading where it is more than 60 degrees off.
COS_TURN = 0.5
# A sharp turn is noticed at most so far behind it, after two heading steps [m].
LATEST_NOTICE_M = 0.04


@njit
def dot(a, b):
    """Scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit
def cosine(a, b):
    """Cosine of the angle between two vectors (3,); 0 if one of them has no length."""
    lengths = math.sqrt(dot(a, a) * dot(b, b))
    return dot(a, b) / lengths if lengths > 0.0 else 0.0


@njit
def carry(vector, before, after):
    """Turn a vector (3,) by the smallest rotation from one unit normal to the next, in place."""
    wx = before[1] * after[2] - before[2] * after[1]
    wy = before[2] * after[0] - before[0] * after[2]
    wz = before[0] * after[1] - before[1] * after[0]
    cos = dot(before, after)
    if cos < -0.99:  # The tool was turned over at once: no rotation is the smallest.
        return
    x, y, z = vector[0], vector[1], vector[2]
    cx, cy, cz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
    vector[0] = x + cx + (wy * cz - wz * cy) / (1.0 + cos)
    vector[1] = y + cy + (wz * cx - wx * cz) / (1.0 + cos)
    vector[2] = z + cz + (wx * cy - wy * cx) / (1.0 + cos)


@njit
def leaves(heading, mean, carried):
    """Whether a heading is more than 60 degrees off a mean, both in space and to the tool."""
    return cosine(heading, mean) < COS_TURN and cosine(heading, carried) < COS_TURN


@njit
def take_in(heading, step_m, length_m, mean, carried):
    """Update a mean over a length, this step included, in place; the first step is the mean."""
    gain = min(step_m / min(length_m, MEMORY_M), 1.0)
    for k in range(3):
        mean[k] += gain * (heading[k] - mean[k])
        carried[k] += gain * (heading[k] - carried[k])
