"""Work laid out for the kernel: points in blocks of neighbours, rows shared among threads."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

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


# Large blocks keep the SIMD loop busy; few points are cut finer, to share them among threads.
LARGEST_BLOCK = 256
SMALLEST_BLOCK = 32
# Points that a SIMD loop takes at once.
LANES = 16
# A thread takes a run of blocks, of which each is so many further over the part than the last:
# all threads have some under the gun.
SPREAD = 8


@dataclass(frozen=True)
class Blocks:
    """Points sorted into blocks of neighbours, each within a small sphere."""

    order: np.ndarray  # (V,) row in the caller's order of each sorted point
    # (3,) point that the coordinates are relative to, so that single precision resolves them.
    origin_m: np.ndarray
    # (3, V) sorted, in the kernel's precision.
    points: np.ndarray
    normals: np.ndarray
    spheres: np.ndarray  # (B, 4) centre and radius [m]
    bounds: np.ndarray  # (B + 1,) first point of each block

    @staticmethod
    def of(
        positions_m: np.ndarray,
        normals: np.ndarray,
        precision: type,
        neighbours: np.ndarray | None = None,
    ) -> 'Blocks':
        """Sort (V, 3) positions [m] and normals; ``neighbours_together`` may be known."""
        if neighbours is None:
            neighbours = neighbours_together(positions_m)
        origin = box_centre_m(positions_m)
        local = np.ascontiguousarray((positions_m - origin).T)
        count = len(positions_m)
        size = _block_size(count)
        members = [neighbours[start : start + size] for start in range(0, count, size)]
        members = [block for first in range(SPREAD) for block in members[first::SPREAD]]
        order = np.concatenate(members)
        sizes = [len(block) for block in members]
        bounds = np.concatenate([[0], np.cumsum(sizes)])
        local = local.take(order, axis=1)
        low, high = (
            reduce.reduceat(local, bounds[:-1], axis=1) for reduce in (np.minimum, np.maximum)
        )
        centre = 0.5 * (low + high)
        away = np.linalg.norm(local - np.repeat(centre, sizes, axis=1), axis=0)
        radius = np.maximum.reduceat(away, bounds[:-1])
        return Blocks(
            order,
            origin,
            np.ascontiguousarray(local, dtype=precision),
            np.ascontiguousarray(normals.T, dtype=precision).take(order, axis=1),
            np.ascontiguousarray(np.column_stack([centre.T, radius])),
            bounds,
        )


def neighbours_together(positions_m: np.ndarray) -> np.ndarray:
    """(V,) rows of positions (V, 3) [m], those of a block one after another."""
    local = np.ascontiguousarray((positions_m - box_centre_m(positions_m)).T)
    count = len(positions_m)
    return np.concatenate(_neighbours(local, np.arange(count), _block_size(count)))


def bounding_box_m(positions_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) lowest and (3,) highest coordinates of positions (V, 3) [m]; 0 without any."""
    if not len(positions_m):
        return np.zeros(3), np.zeros(3)
    # A column at a time: over rows of three NumPy's loop takes twenty times as long.
    columns = positions_m.T
    return np.array([c.min() for c in columns]), np.array([c.max() for c in columns])


def box_centre_m(positions_m: np.ndarray) -> np.ndarray:
    """(3,) centre of the bounding box of (V, 3) points [m]."""
    low, high = bounding_box_m(positions_m)
    return 0.5 * (low + high)


def _block_size(count: int) -> int:
    return min(LARGEST_BLOCK, max(SMALLEST_BLOCK, count // 16 // LANES * LANES))


def _neighbours(points: np.ndarray, rows: np.ndarray, size: int) -> list[np.ndarray]:
    """Halve points (3, V) across their longest extent until no part has more than ``size``.

    The points are handed on with their rows: gathering them anew from all would wait for memory.
    Every cut is at a multiple of ``size``: all blocks but the last are full.
    """
    if len(rows) <= size:
        return [rows]
    along = points[(points.max(axis=1) - points.min(axis=1)).argmax()]
    half = -(-len(rows) // size) // 2 * size
    split = np.argpartition(along, half)
    found = []
    for part in (split[:half], split[half:]):
        found += _neighbours(points.take(part, axis=1), rows[part], size)
    return found
