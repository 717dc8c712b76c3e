"""Vectors of three numbers in compiled code: rows of arrays, or tuples.

Results are tuples: arrays take seconds to compile.
"""

import math

from paint_deposition.kernel.compiler import njit


@njit
def dot(a, b):
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit
def length(a):
    """Length of a vector."""
    return math.sqrt(dot(a, a))


@njit
def difference(a, b):
    """Vector from b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit
def cross(a, b):
    """Vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
