"""How many pairs a second one thread could do if the hot loop did nothing but its arithmetic.

The instructions of the compiled loop are counted, and the processor is timed on multiply-adds
alone, in the same registers: loads, the clock that the server gives and the width of its units
then count for both. A processor that adds beside its multiplications may go beyond this limit.
"""

import re
import time

import numpy as np
from numba import njit

from paint_deposition.kernel.eq2_flux import compile_kernel

TERMS = 16
POINTS, REPEATS = 2048, 200
# Instructions that only bring numbers to where they are needed.
MOVES = ('vmov', 'vbroadcast', 'vpbroadcast')


def loop_instructions() -> int:
    """Arithmetic instructions in the loop over points, single precision, for a register of them.

    The kernel must have painted in this process.
    """
    kernel = compile_kernel((), (), False, np.float32, False, True)
    # Code that was found on disk cannot be looked at.
    fresh = njit(nogil=True, fastmath=True, error_model='numpy')(kernel.py_func)
    fresh.compile(kernel.signatures[0])
    (text,) = fresh.inspect_asm().values()
    loops = [_arithmetic(block) for block in re.split(r'^\S+:', text, flags=re.MULTILINE)]
    return len(max(loops, key=len))


def _arithmetic(block: str) -> list[str]:
    lines = [line.strip() for line in block.splitlines()]
    return [
        line for line in lines if re.match(r'v\w+\s.*[xyz]mm', line) and not line.startswith(MOVES)
    ]


def _polynomial(x, terms, repeats, out):
    for _ in range(repeats):
        for i in range(len(x)):
            value = x[i]
            for k in range(TERMS):
                value = value * x[i] + terms[k]
            out[i] += value


def multiply_adds_per_s(rounds: int = 15) -> float:
    """Multiply-adds of single numbers that a thread does in a second, at best."""
    run = njit(nogil=True, fastmath=True)(_polynomial)
    x = np.linspace(0.1, 0.9, POINTS, dtype=np.float32)
    terms, out = np.full(TERMS, 0.5, dtype=np.float32), np.zeros_like(x)
    run(x, terms, 1, out)
    best = np.inf
    for _ in range(rounds):
        begin = time.perf_counter()
        run(x, terms, REPEATS, out)
        best = min(best, time.perf_counter() - begin)
    return POINTS * REPEATS * TERMS / best
