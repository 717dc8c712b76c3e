"""Surface points laid out for the kernel: neighbours together, structure of arrays."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

# Large blocks keep the SIMD loop busy; few points are cut finer, to share them among threads.
LARGEST_BLOCK = 256
SMALLEST_BLOCK = 32
# Points that a SIMD loop takes at once.
LANES = 16
# Threads take runs of blocks; neighbours lie this far apart, for work where the gun is shared.
SPREAD = 8


@dataclass(frozen=True)
class Blocks:
    """Points sorted into blocks of neighbours, each within a small sphere.

    Attributes:
        order: (V,) row in the caller's order of each sorted point.
        origin_m: (3,) point that the coordinates are relative to, so that single precision
            resolves them.
        points, normals: (3, V) sorted, in the kernel's precision.
        spheres: (B, 4) centre and radius [m].
        bounds: (B + 1,) first point of each block.
    """

    order: np.ndarray
    origin_m: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    spheres: np.ndarray
    bounds: np.ndarray

    @staticmethod
    def of(positions_m: np.ndarray, normals: np.ndarray, precision: type) -> 'Blocks':
        """Sort (V, 3) positions [m] and normals into blocks."""
        origin = 0.5 * (positions_m.min(axis=0) + positions_m.max(axis=0))
        local = positions_m - origin
        size = min(LARGEST_BLOCK, max(SMALLEST_BLOCK, len(local) // 16 // LANES * LANES))
        members = _neighbours(local, np.arange(len(local)), size)
        members = [block for first in range(SPREAD) for block in members[first::SPREAD]]
        order = np.concatenate(members)
        bounds = np.concatenate([[0], np.cumsum([len(block) for block in members])])
        spheres = np.empty((len(members), 4))
        for block, (start, stop) in enumerate(pairwise(bounds)):
            inside = local[order[start:stop]]
            centre = 0.5 * (inside.min(axis=0) + inside.max(axis=0))
            spheres[block, :3] = centre
            spheres[block, 3] = np.linalg.norm(inside - centre, axis=1).max()
        return Blocks(
            order,
            origin,
            np.ascontiguousarray(local[order].T, dtype=precision),
            np.ascontiguousarray(normals[order].T, dtype=precision),
            spheres,
            bounds,
        )


def _neighbours(points: np.ndarray, rows: np.ndarray, size: int) -> list[np.ndarray]:
    """Halve the rows across their longest extent until none has more than ``size``.

    Every cut is at a multiple of ``size``: all blocks but one are full.
    """
    if len(rows) <= size:
        return [rows]
    chosen = points[rows]
    along = chosen[:, np.ptp(chosen, axis=0).argmax()]
    half = -(-len(rows) // size) // 2 * size
    split = rows[np.argpartition(along, half)]
    return [*_neighbours(points, split[:half], size), *_neighbours(points, split[half:], size)]
