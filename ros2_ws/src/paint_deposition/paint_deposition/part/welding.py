"""Vertices at the same place made one."""

import numpy as np
from numba import njit

from paint_deposition.kernel.code_cache import named_for_its_code
from paint_deposition.part.groups import joined_groups, numbered_groups

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
    first, label, heads, following = _distinct(vertices)
    parent = np.arange(len(first), dtype=np.int32)
    _join_near(vertices, first, heads, following, parent)
    count, group = numbered_groups(parent)
    kept = np.empty(count, dtype=np.int32)
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
def _distinct(vertices):
    """First of equal vertices (U,), which of them each is, and those of a cell as linked lists."""
    slots = 1024
    while slots < len(vertices) // 2:
        slots *= 2
    heads = np.full(slots, -1, dtype=np.int32)
    first = np.empty(len(vertices), dtype=np.int32)
    following = np.empty(len(vertices), dtype=np.int32)
    label = np.empty(len(vertices), dtype=np.int32)
    count = 0
    for v in range(len(vertices)):
        x, y, z = _place(vertices, v)
        slot = _slot(_cell(x), _cell(y), _cell(z), slots)
        u = heads[slot]
        while u >= 0:
            w = first[u]
            if vertices[w, 0] == x and vertices[w, 1] == y and vertices[w, 2] == z:
                break
            u = following[u]
        if u < 0:
            u = count
            first[u], following[u], heads[slot] = v, heads[slot], u
            count += 1
        label[v] = u
    return first[:count].copy(), label, heads, following[:count].copy()


@njit(cache=True, nogil=True)
@named_for_its_code
def _join_near(vertices, first, heads, following, parent):
    for u in range(len(first)):
        x, y, z = _place(vertices, first[u])
        for i in range(_cell(x - WELD_M), _cell(x + WELD_M) + 1):
            for j in range(_cell(y - WELD_M), _cell(y + WELD_M) + 1):
                for k in range(_cell(z - WELD_M), _cell(z + WELD_M) + 1):
                    other = heads[_slot(i, j, k, len(heads))]
                    while other >= 0:
                        if other < u:
                            a, b, c = _place(vertices, first[other])
                            away2 = (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2
                            if away2 <= WELD_M * WELD_M:
                                joined_groups(parent, u, other)
                        other = following[other]
