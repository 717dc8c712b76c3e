"""Which triangles share an edge, found by counting: time and memory grow with the triangles only.

Half-edge h = 3 f + k runs from corner k of triangle f to its next corner.
"""

import numpy as np
from numba import njit


def edges_of(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(E, 2) ends of the edges, lower first and in order, and (F, 3) which leaves each corner."""
    edges, of_half_edge = _unique(*_in_order(np.ascontiguousarray(faces, dtype=np.int64)))
    return edges, of_half_edge.reshape(-1, 3)


def matched(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half-edges that lie on each other.

    Args:
        faces: (F, 3).

    Returns:
        (E, 2) pairs of half-edges that run against each other, in the order of their vertices;
        (C, 2) pairs that run alike; (B,) half-edges without a partner, or with several.
    """
    return _matched(*_in_order(np.ascontiguousarray(faces, dtype=np.int64)))


def _in_order(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vertices (3 F,), and all half-edges by lower vertex, higher vertex and number."""
    vertices = faces.ravel()
    count = int(vertices.max()) + 1 if len(vertices) else 0
    return vertices, _sorted(vertices, count)


@njit(cache=True, nogil=True)
def _next(half_edge):
    return half_edge - 2 if half_edge % 3 == 2 else half_edge + 1


@njit(cache=True, nogil=True)
def _sorted(vertices, count):
    """Half-edges sorted by counting, by the higher of their vertices first, then by the lower."""
    order = np.arange(len(vertices)).astype(np.int32)
    for lower in (False, True):
        place = np.zeros(count + 1, dtype=np.int32)
        for i in range(len(vertices)):
            start, end = vertices[i], vertices[_next(i)]
            place[(min(start, end) if lower else max(start, end)) + 1] += 1
        for v in range(count):
            place[v + 1] += place[v]
        ordered = np.empty_like(order)
        for i in range(len(order)):
            h = order[i]
            start, end = vertices[h], vertices[_next(h)]
            key = min(start, end) if lower else max(start, end)
            ordered[place[key]] = h
            place[key] += 1
        order = ordered
    return order


@njit(cache=True, nogil=True)
def _same_edge(vertices, one, other):
    a, b = vertices[one], vertices[_next(one)]
    c, d = vertices[other], vertices[_next(other)]
    return (a == c and b == d) or (a == d and b == c)


@njit(cache=True, nogil=True)
def _unique(vertices, order):
    count = 0
    for i in range(len(order)):
        if i == 0 or not _same_edge(vertices, order[i - 1], order[i]):
            count += 1
    edges = np.empty((count, 2), dtype=np.int64)
    of_half_edge = np.empty(len(order), dtype=np.int64)
    at = -1
    for i in range(len(order)):
        h = order[i]
        if i == 0 or not _same_edge(vertices, order[i - 1], h):
            at += 1
            start, end = vertices[h], vertices[_next(h)]
            edges[at, 0], edges[at, 1] = min(start, end), max(start, end)
        of_half_edge[h] = at
    return edges, of_half_edge


@njit(cache=True, nogil=True)
def _matched(vertices, order):
    paired = np.empty((len(order) // 2, 2), dtype=np.int64)
    clashing = np.empty((len(order) // 2, 2), dtype=np.int64)
    lonely = np.ones(len(order), dtype=np.bool_)
    pairs = clashes = first = 0
    while first < len(order):
        last = first + 1
        while last < len(order) and _same_edge(vertices, order[first], order[last]):
            last += 1
        if last - first == 2:
            one, other = order[first], order[first + 1]
            lonely[one] = lonely[other] = False
            if vertices[one] != vertices[other]:
                paired[pairs, 0], paired[pairs, 1] = one, other
                pairs += 1
            else:
                clashing[clashes, 0], clashing[clashes, 1] = one, other
                clashes += 1
        first = last
    return paired[:pairs].copy(), clashing[:clashes].copy(), np.flatnonzero(lonely)
