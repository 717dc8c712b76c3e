"""Rows of compiled work shared among threads."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import config

# Threads that share work: NUMBA_NUM_THREADS, by default one for each core.
THREADS: int = config.NUMBA_NUM_THREADS
# Fewer rows are done before a second thread wakes.
LEAST_SHARE = 2048


def shared_among_threads(
    count: int, fill: Callable[[int, int], None], least_share: int = LEAST_SHARE
) -> None:
    """Call ``fill(start, stop)`` for shares of ``count`` rows, each in a thread of its own.

    ``fill`` is compiled and lets go of Python's lock.
    """
    shares = min(THREADS, count // least_share)
    if shares < 2:
        fill(0, count)
        return
    bounds = np.linspace(0, count, shares + 1).astype(np.int64)
    with ThreadPoolExecutor(shares) as threads:
        list(threads.map(fill, bounds[:-1], bounds[1:]))
