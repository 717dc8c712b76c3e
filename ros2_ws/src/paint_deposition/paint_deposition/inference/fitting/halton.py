"""Points that fill a unit cube evenly: Halton's sequence with its digits permuted.

They are those of ``scipy.stats.qmc.Halton`` to the bit. Loading that package takes longer than a
fit, and a command would need nothing else of it.
"""

import math
from collections.abc import Iterator
from itertools import count, islice

import numpy as np

# Of the fraction of a double number.
BITS = 54


def halton(points: int, dimensions: int, seed: int) -> np.ndarray:
    """(points, dimensions) coordinates in [0, 1), permuted after Owen (arXiv:1706.02808, 2017)."""
    random, columns = np.random.default_rng(seed), []
    for base in islice(_primes(), dimensions):
        permuted = np.tile(np.arange(base), (math.ceil(BITS / math.log2(base)) - 1, 1))
        for digits in permuted:
            random.shuffle(digits)
        column, left, share = np.zeros(points), np.arange(points), 1.0 / base
        for digits in permuted:
            column += digits[left % base] * share
            left //= base
            share /= base
        columns.append(column)
    return np.column_stack(columns)


def _primes() -> Iterator[int]:
    return (n for n in count(2) if all(n % k for k in range(2, math.isqrt(n) + 1)))
