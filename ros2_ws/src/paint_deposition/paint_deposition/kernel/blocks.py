"""Surface points laid out for the kernel: neighbours together, structure of arrays."""

from dataclasses import dataclass

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
        local = np.ascontiguousarray((positions_m - origin).T)
        count = len(positions_m)
        size = min(LARGEST_BLOCK, max(SMALLEST_BLOCK, count // 16 // LANES * LANES))
        members = _neighbours(local, np.arange(count), size)
        members = [block for first in range(SPREAD) for block in members[first::SPREAD]]
        order = np.concatenate(members)
        sizes = [len(block) for block in members]
        bounds = np.concatenate([[0], np.cumsum(sizes)])
        local = local[:, order]
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
            np.ascontiguousarray(normals[order].T, dtype=precision),
            np.column_stack([centre.T, radius]),
            bounds,
        )


def _neighbours(points: np.ndarray, rows: np.ndarray, size: int) -> list[np.ndarray]:
    """Halve points (3, V) across their longest extent until no part has more than ``size``.

    The points are handed on with their rows: gathering them anew from all would wait for memory.
    Every cut is at a multiple of ``size``: all blocks but one are full.
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
