"""Edges of a mesh: which triangles share one, what hangs together, how far an edge is away.

Half-edge h = 3 f + k runs from corner k of triangle f to its next corner.
"""

from collections.abc import Iterator

import numpy as np
import scipy

from paint_deposition.kernel.compiler import njit

# Points whose neighbours are looked for at once, edges that are looked at.
BLOCK = 4096
# Pieces of edges so short that the nearest has one of the nearest middles [m].
PIECE_M = 0.002
# Patches of a CAD model are often triangulated apart; gaps up to this are no edges of the surface.
SEAM_M = 3e-4


@njit(cache=True, nogil=True)
def rows_by_number(numbers, count):
    """(N,) rows by their numbers below ``count``, and (count + 1,) where each number's begin."""
    first = np.zeros(count + 1, dtype=np.int32)
    for number in numbers:
        first[number + 1] += 1
    first = np.cumsum(first).astype(np.int32)
    rows, free = np.empty(len(numbers), dtype=np.int32), first.copy()
    for row in range(len(numbers)):
        rows[free[numbers[row]]] = row
        free[numbers[row]] += 1
    return rows, first


@njit(cache=True, nogil=True)
def half_edges_by_edge(faces):
    """(3 F,) half-edges by lower vertex, higher vertex and number: an edge's follow each other.

    And (E + 1,) where among them those of each edge begin.
    """
    lower, higher = np.empty(faces.size, dtype=np.int32), np.empty(faces.size, dtype=np.int32)
    for h in range(faces.size):
        start, end = faces[h // 3, h % 3], faces[h // 3, (h + 1) % 3]
        lower[h], higher[h] = min(start, end), max(start, end)
    count = higher.max() + 1 if len(higher) else 0
    order = rows_by_number(higher, count)[0]
    order = order[rows_by_number(lower[order], count)[0]]
    first, edges = np.zeros(len(order) + 1, dtype=np.int32), 0
    for row in range(len(order)):
        one, other = order[row - 1], order[row]
        if row == 0 or lower[one] != lower[other] or higher[one] != higher[other]:
            first[edges] = row
            edges += 1
    first[edges] = len(order)
    return order, first[: edges + 1].copy()


def edges_of(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(E, 2) ends of the edges, lower first and in order, and (F, 3) which leaves each corner."""
    order, first = half_edges_by_edge(faces)
    half_edges, corners = order[first[:-1]], faces.ravel()
    edges = np.stack([corners[half_edges], corners[next_half_edge(half_edges)]], axis=1)
    edges.sort(axis=1)
    of_half_edge = np.empty(len(order), dtype=np.int64)
    of_half_edge[order] = np.repeat(np.arange(len(edges)), np.diff(first))
    return edges, of_half_edge.reshape(-1, 3)


def matched_half_edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which half-edges of (F, 3) faces lie on each other.

    (E, 2) of two triangles with the same winding, in the order of their vertices; (C, 2) of two
    of opposite winding, which clash; and (B,) those without a partner, or with several.
    """
    order, first = half_edges_by_edge(faces)
    count = np.diff(first)
    two = first[:-1][count == 2]
    pairs = np.stack([order[two], order[two + 1]], axis=1)
    corners = faces.ravel()
    opposed = corners[pairs[:, 0]] != corners[pairs[:, 1]]
    return pairs[opposed], pairs[~opposed], np.sort(order[np.repeat(count != 2, count)])


def next_half_edge(half_edges: np.ndarray) -> np.ndarray:
    """The half-edge that follows in the same triangle."""
    return half_edges - half_edges % 3 + (half_edges + 1) % 3


def half_edges_m(vertices_m: np.ndarray, faces: np.ndarray, half_edges: np.ndarray) -> np.ndarray:
    """(H, 2, 3) ends of half-edges [m]."""
    corners = faces.ravel()
    return vertices_m[np.stack([corners[half_edges], corners[next_half_edge(half_edges)]], axis=1)]


def connected(rows: np.ndarray, count: int) -> tuple[int, np.ndarray]:
    """How many groups of ``count`` members rows (P, K) make, and (count,) the group of each.

    Members in one row, the ends of an edge or the corners of a face, are of one group. Groups are
    numbered in the order of their first members.
    """
    joined = np.repeat(rows[:, 0], rows.shape[1] - 1), rows[:, 1:].ravel()
    links = scipy.sparse.coo_array((np.ones(len(joined[0]), bool), joined), shape=(count, count))
    groups, group = scipy.sparse.csgraph.connected_components(links, directed=False)
    return groups, group.astype(np.int64)


def near_pairs(
    points_m: np.ndarray, others_m: np.ndarray, radius_m: float
) -> Iterator[tuple[slice, np.ndarray, np.ndarray, np.ndarray]]:
    """Pairs of points and others within a radius, a block of points at a time.

    Yields:
        The block, and of each pair the row in the block, the row of the other and the distance.
    """
    tree = scipy.spatial.cKDTree(others_m)
    for start in range(0, len(points_m), BLOCK):
        block = slice(start, start + BLOCK)
        near = scipy.spatial.cKDTree(points_m[block]).sparse_distance_matrix(
            tree, radius_m, output_type='ndarray'
        )
        yield block, near['i'], near['j'], near['v']


def edge_distance_m(points_m: np.ndarray, rim_m: np.ndarray) -> np.ndarray:
    """(N,) straight distance to the nearest of the (B, 2, 3) rim segments, inf without any [m]."""
    if not len(rim_m):
        return np.full(len(points_m), np.inf)
    pieces = cut_segments(rim_m, PIECE_M)[0]
    middles = scipy.spatial.cKDTree(pieces.mean(axis=1))
    near = middles.query(points_m, k=min(4, len(pieces)))[1]
    near = near.reshape(len(points_m), -1)
    return _distance_m(points_m[:, None, :], pieces[near]).min(axis=1)


def without_seams(segments_m: np.ndarray) -> np.ndarray:
    """Leave out edges (B, 2, 3) of triangles along which another patch continues the surface [m].

    Each runs in the sense of its triangle: the two sides of a seam run against each other.
    """
    if not len(segments_m):
        return segments_m
    pieces, segment = cut_segments(segments_m, PIECE_M)
    middles = segments_m.mean(axis=1)
    reach_m = 0.5 * PIECE_M + SEAM_M
    near = scipy.spatial.cKDTree(middles).sparse_distance_matrix(
        scipy.spatial.cKDTree(pieces.mean(axis=1)), reach_m, output_type='ndarray'
    )
    one, piece = near['i'], near['j']
    along = segments_m[:, 1] - segments_m[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    against = np.einsum('ni,ni->n', along[one], along[segment[piece]]) < -0.9
    touching = _distance_m(middles[one], pieces[piece]) < SEAM_M
    free = np.ones(len(segments_m), dtype=bool)
    free[one[against & touching]] = False
    return segments_m[free]


def _distance_m(points_m: np.ndarray, segments_m: np.ndarray) -> np.ndarray:
    """(...) distances of points (..., 3) from segments (..., 2, 3) [m]."""
    way = points_m - segments_m[..., 0, :]
    along = segments_m[..., 1, :] - segments_m[..., 0, :]
    length2 = np.maximum(np.sum(along * along, axis=-1), 1e-30)
    share = np.clip(np.sum(way * along, axis=-1) / length2, 0.0, 1.0)
    return np.linalg.norm(way - share[..., None] * along, axis=-1)


def cut_segments(segments_m: np.ndarray, longest_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Equal pieces (P, 2, 3) no longer than wanted of (B, 2, 3) segments, and (P,) whose."""
    along = segments_m[:, 1] - segments_m[:, 0]
    count = np.maximum(1, np.ceil(np.linalg.norm(along, axis=1) / longest_m)).astype(int)
    segment = np.repeat(np.arange(len(segments_m)), count)
    step = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
    ends = (step[:, None] + np.array([0.0, 1.0])) / count[segment][:, None]
    start = segments_m[segment, 0][:, None, :]
    return start + ends[:, :, None] * along[segment][:, None, :], segment


def weld(vertices_m: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Make vertices closer than a micrometre one: STL repeats them for every triangle.

    Vertices may be in the file's single precision; returned in double, in the order in which they
    first appear, with the faces (F, 3) on them.
    """
    one_zero = np.ascontiguousarray(vertices_m) + vertices_m.dtype.type(0.0)  # no -0.0
    first, label = equal_rows(one_zero.view(f'u{vertices_m.dtype.itemsize}'))
    places = vertices_m[first].astype(np.float64)
    tree = scipy.spatial.cKDTree(places, balanced_tree=False, compact_nodes=False)
    # Vertices closer than this are one [m].
    close = tree.query_pairs(1e-6, output_type='ndarray')
    if len(close):
        count, group = connected(close, len(first))
        kept = np.empty(count, dtype=np.int64)
        kept[group[::-1]] = np.arange(len(first))[::-1]
        places, label = places[kept], group[label]
    return places, label[faces]


@njit(cache=True, nogil=True)
def equal_rows(bits):
    """The first row of each kind among (N, 3) integers, and (N,) which kind each row is of."""
    size = 4
    while size < 2 * len(bits):
        size *= 2
    table = np.full(size, -1, dtype=np.int32)
    first, label = np.empty(len(bits), dtype=np.int64), np.empty(len(bits), dtype=np.int64)
    count = 0
    for row in range(len(bits)):
        mixed = np.uint64(0)
        for k in range(3):
            mixed = (mixed ^ np.uint64(bits[row, k])) * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(29)
        slot = np.int64(mixed & np.uint64(size - 1))
        while table[slot] >= 0:
            other = first[table[slot]]
            same = bits[other, 0] == bits[row, 0] and bits[other, 1] == bits[row, 1]
            if same and bits[other, 2] == bits[row, 2]:
                break
            slot = (slot + 1) & (size - 1)
        if table[slot] < 0:
            first[count], table[slot] = row, count
            count += 1
        label[row] = table[slot]
    return first[:count].copy(), label


def coarse_faces(vertices_m: np.ndarray, faces: np.ndarray, cell_m: float) -> np.ndarray:
    """(C, 3) triangles of a picture: of each patch one vertex (V, 3) a cell [m] stands for all."""
    _, patch = connected(faces, len(vertices_m))
    cells = ((vertices_m - vertices_m.min(axis=0)) / cell_m).astype(np.int64)
    cells[:, 0] += patch * (cells[:, 0].max() + 1)
    first, cell = equal_rows(cells)
    coarse = first[cell[faces]]
    a, b, c = coarse.T
    return coarse[(a != b) & (b != c) & (c != a)]
