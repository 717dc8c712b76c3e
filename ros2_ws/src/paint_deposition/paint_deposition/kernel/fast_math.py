"""Exponential and logarithm that a compiler can vectorise, and vectors, for compiled code.

The C library's functions are calls and stop SIMD. These are near-minimax polynomials after an
exact range reduction, good to a few units in the last place of the result, times the magnitude
of the exponent. Outside compiled code they are the C library's.

Vectors of three numbers are rows of arrays, or tuples. Results are tuples: arrays take seconds to
compile.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numba import types
from numba.extending import overload, register_jitable

from paint_deposition.kernel.compiler import named_for_its_code, njit

# Fused multiply-add only: the rest of fast-math would cancel the rounding to an integer.
WITHOUT_REORDERING = {'fastmath': {'contract'}}


def exp2(x):
    """2**x up to 127 (single) or 1023 (double), beyond which the result is nonsense.

    Below -120 or -1000 it stays at that floor.
    """
    return 2.0**x


def exp(x):
    """e**x; below -83 or above 87 (single), -693 or 709 (double) the result stays as there."""
    return math.exp(x)


def log(x):
    """Natural logarithm of a positive, normal number."""
    return math.log(x)


@register_jitable
def power(x, exponent):
    """A positive, normal number to any power; the result stays within the limits of ``exp``."""
    return exp(exponent * log(x))


@overload(exp2, jit_options=WITHOUT_REORDERING)
def _exp2(x):
    if x == types.float32:
        return _exp2_of(np.float32, np.int32, 23, -120.0, 5)
    if x == types.float64:
        return _exp2_of(np.float64, np.int64, 52, -1000.0, 11)
    return None


@overload(exp, jit_options=WITHOUT_REORDERING)
def _exp(x):
    if x not in (types.float32, types.float64):
        return None
    real, ceiling = (np.float32, 126.0) if x == types.float32 else (np.float64, 1023.0)
    log2_e, highest = real(math.log2(math.e)), real(ceiling)
    # Not in exp2, whose argument in the hot loop is never large: it would cost some per cent.
    return lambda x: exp2(min(x * log2_e, highest))


def _exp2_of(real, integer, mantissa_bits, floor, degree):
    # Polynomial of least relative error over -0.5 to 0.5, exactly 1 at 0: any power 0 is 1.
    places = 0.5 * np.cos(np.pi * (np.arange(4 * degree) + 0.5) / (4 * degree))
    powers = np.arange(1, degree + 1)
    columns = (2.0 * places[:, np.newaxis]) ** powers
    relative = np.exp2(-places)
    wanted = np.expm1(places * math.log(2.0))
    fit = np.linalg.lstsq(columns * relative[:, np.newaxis], wanted * relative, rcond=None)[0]
    polynomial = _horner([real(1.0), *map(real, (fit * 2.0**powers).tolist())])
    lowest, shift = real(floor), integer(mantissa_bits)
    # Adding this number leaves the nearest integer in the lowest bits of the mantissa.
    round_off = real(1.5 * 2.0**mantissa_bits)

    def exp2_by_polynomial(x):
        x = max(x, lowest)
        rounded = real(x + round_off)
        fraction = x - (rounded - round_off)
        exponent = integer(rounded.view(integer) << shift)
        return integer(real(polynomial(fraction)).view(integer) + exponent).view(real)

    return exp2_by_polynomial


@overload(log, jit_options=WITHOUT_REORDERING)
def _log(x):
    if x == types.float32:
        return _log_of(np.float32, np.int32, 23, [2.0 / n for n in range(1, 11, 2)])
    if x == types.float64:
        return _log_of(np.float64, np.int64, 52, [2.0 / n for n in range(1, 25, 2)])
    return None


def _log_of(real, integer, mantissa_bits, terms):
    # ln(2^n m) = n ln 2 + 2 atanh((m - 1) / (m + 1)), with m between 1/sqrt 2 and sqrt 2.
    ln2, one, shift = real(math.log(2.0)), real(1.0), integer(mantissa_bits)
    root_half = real(math.sqrt(0.5)).view(integer)
    series = _horner([real(term) for term in terms])

    def log_by_series(x):
        bits = integer(real(x).view(integer) - root_half)
        n = integer(bits >> shift)
        mantissa = integer((bits - integer(n << shift)) + root_half).view(real)
        w = (mantissa - one) / (mantissa + one)
        return real(n) * ln2 + w * series(w * w)

    return log_by_series


def _horner(terms: Sequence[float]) -> Callable[[float], float]:
    """A polynomial, lowest power first, as nested compiled functions."""
    value = terms[0]
    if len(terms) == 1:

        def constant(x):
            return value

        return register_jitable(named_for_its_code(constant, [], terms))
    higher = _horner(terms[1:])

    def nested(x):
        return value + x * higher(x)

    # Symbols of compiled code from different processes can share a name: each names its terms.
    return register_jitable(named_for_its_code(nested, [], terms))


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
