"""Vertices at the same place made one; compiled, for NumPy's sorting takes ten times as long."""

import numpy as np
from numba import njit

from paint_deposition.kernel.code_cache import named_for_its_code
from paint_deposition.part.edges import connected

WELD_M = 1e-6
# Cells so small that few vertices share one, and so large that few are near two.
CELL_M = 20.0 * WELD_M


def weld(vertices_m: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Make vertices closer than a micrometre one: STL repeats them for every triangle.

    Args:
        vertices_m: (V, 3), in single precision if that is how the file has them.
        faces: (F, 3).

    Returns:
        Vertices (V, 3) [m], in double precision, in the order in which they first appear, and
        faces (F, 3) on them.
    """
    vertices = np.ascontiguousarray(vertices_m)
    first, label, close = _distinct(vertices)
    count, group = connected(close, len(first))
    kept = np.empty(count, dtype=np.int64)
    kept[group[::-1]] = first[::-1]
    return vertices[kept].astype(np.float64), group[label][faces].astype(np.int64)


@njit(cache=True, nogil=True)
def _slot(i, j, k, slots):
    """Where cell (i, j, k) is kept: Teschner et al., Optimized spatial hashing, 2003."""
    return (i * 73856093 ^ j * 19349663 ^ k * 83492791) & (slots - 1)


@njit(cache=True, nogil=True)
def _cell(length_m):
    return np.int64(np.floor(length_m / CELL_M))


@njit(cache=True, nogil=True)
def _place(vertices, v):
    return np.float64(vertices[v, 0]), np.float64(vertices[v, 1]), np.float64(vertices[v, 2])


@njit(cache=True, nogil=True)
@named_for_its_code
def _distinct(vertices):
    """First of equal vertices (U,), which of them each is, and (P, 2) those close to another."""
    slots = 1024
    while slots < len(vertices) // 2:
        slots *= 2
    # Those of a cell hang together as a linked list.
    heads = np.full(slots, -1, dtype=np.int32)
    first, following, label = np.empty((3, len(vertices)), dtype=np.int32)
    close = [(np.int64(0), np.int64(0))]  # gives the list its type
    count = 0
    for v in range(len(vertices)):
        x, y, z = (
            np.float64(vertices[v, 0]),
            np.float64(vertices[v, 1]),
            np.float64(vertices[v, 2]),
        )
        home = _slot(_cell(x), _cell(y), _cell(z), slots)
        u = heads[home]
        while u >= 0:
            w = first[u]
            if vertices[w, 0] == x and vertices[w, 1] == y and vertices[w, 2] == z:
                break
            u = following[u]
        label[v] = u if u >= 0 else count
        if u >= 0:
            continue
        for i in range(_cell(x - WELD_M), _cell(x + WELD_M) + 1):
            for j in range(_cell(y - WELD_M), _cell(y + WELD_M) + 1):
                for k in range(_cell(z - WELD_M), _cell(z + WELD_M) + 1):
                    other = heads[_slot(i, j, k, slots)]
                    while other >= 0:
                        a, b, c = _place(vertices, first[other])
                        away2 = (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2
                        if away2 <= WELD_M * WELD_M:
                            close.append((np.int64(other), np.int64(count)))
                        other = following[other]
        first[count], following[count], heads[home] = v, heads[home], count
        count += 1
    return first[:count].copy(), label, np.array(close)[1:]
