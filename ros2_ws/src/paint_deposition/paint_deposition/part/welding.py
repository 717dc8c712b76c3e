"""Vertices at the same place made one."""

import numpy as np
from scipy.spatial import cKDTree

from paint_deposition.part.edges import connected

WELD_M = 1e-6


def weld(vertices_m: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Make vertices closer than a micrometre one: STL repeats them for every triangle.

    Vertices may be in the file's single precision; returned in double, in the order in which they
    first appear, with the faces (F, 3) on them.
    """
    order = np.lexsort(vertices_m.T)
    in_order = vertices_m[order]
    new = np.append(True, (in_order[1:] != in_order[:-1]).any(axis=1))
    # The sort is stable: the first of equal vertices is that which appears first.
    first = order[new]
    rank = np.empty(len(first), dtype=np.int64)
    rank[first.argsort()] = np.arange(len(first))
    label = np.empty(len(order), dtype=np.int64)
    label[order] = rank[np.cumsum(new) - 1]
    first.sort()
    places = vertices_m[first].astype(np.float64)
    close = cKDTree(places).query_pairs(WELD_M, output_type='ndarray')
    count, group = connected(close, len(first))
    kept = np.empty(count, dtype=np.int64)
    kept[group[::-1]] = np.arange(len(first))[::-1]
    return places[kept], group[label][faces].astype(np.int64)
