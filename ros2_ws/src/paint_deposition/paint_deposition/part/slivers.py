"""Cutting slivers, long triangles on a short base, crosswise in one go.

Halving edges keeps a sliver's pieces as thin as itself, and their number grows with the square of
its length. Cut across into rungs, a sliver gives pieces as wide as its base.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

# How many times longer than its base a sliver's sides are.
SLENDERNESS = 3.0


@dataclass(frozen=True)
class CutEdges:
    """Edges cut into equal parts, 2 to some power, so that halving them meets the same points.

    Attributes:
        parts: (E,) how many; 1 is uncut.
        first: (E,) number of the inner vertex next to the edge's first end.
    """

    parts: np.ndarray
    first: np.ndarray

    def along(self, edge: np.ndarray, forward: np.ndarray, parts: int) -> np.ndarray:
        """(N, parts - 1) inner vertices of edges of that many parts, in the sense asked for."""
        steps = np.arange(parts - 1)
        return self.first[edge][:, None] + np.where(forward[:, None], steps, parts - 2 - steps)

    def middles(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ends (lower, upper) and middle of the cut edges, their halves, and so on."""
        lower, upper, middle = [], [], []
        for parts in np.unique(self.parts[self.parts > 1]).tolist():
            cut = np.flatnonzero(self.parts == parts)
            inner = self.first[cut][:, None] + np.arange(parts - 1)
            points = np.concatenate([edges[cut, :1], inner, edges[cut, 1:]], axis=1)
            span = parts
            while span > 1:
                ends = points[:, ::span]
                one, other = ends[:, :-1].ravel(), ends[:, 1:].ravel()
                lower.append(np.minimum(one, other))
                upper.append(np.maximum(one, other))
                middle.append(points[:, span // 2 :: span].ravel())
                span //= 2
        return np.concatenate(lower), np.concatenate(upper), np.concatenate(middle)


def find_slivers(lengths_m: np.ndarray, max_edge_length_m: float) -> np.ndarray:
    """(N,) rows of (F, 3) triangle sides that are slivers with both long sides too long."""
    base, side, _ = np.sort(lengths_m, axis=1).T
    return np.flatnonzero(side > np.maximum(SLENDERNESS * base, max_edge_length_m))


def cut_edges(
    of_slivers: np.ndarray, lengths_m: np.ndarray, max_edge_length_m: float, next_vertex: int
) -> CutEdges:
    """Cut the long sides of slivers into pieces about as long as their base.

    Args:
        of_slivers: (N, 3) edges of the slivers.
        lengths_m: (E,) lengths of all edges [m].
        max_edge_length_m: no need for shorter pieces than this [m].
        next_vertex: number that the first new vertex gets.
    """
    in_order = np.take_along_axis(of_slivers, lengths_m[of_slivers].argsort(axis=1), axis=1)
    piece_m = np.maximum(lengths_m[in_order[:, :1]], max_edge_length_m)
    sides = in_order[:, 1:]
    parts = np.ones(len(lengths_m), dtype=np.int64)
    wanted = 2 ** np.ceil(np.log2(lengths_m[sides] / piece_m)).astype(np.int64)
    np.maximum.at(parts, sides, wanted)
    return CutEdges(parts, next_vertex + np.cumsum(parts - 1) - (parts - 1))


def cut_slivers(
    slivers: np.ndarray, of_slivers: np.ndarray, lengths_m: np.ndarray, cut: CutEdges
) -> np.ndarray:
    """Pieces (P, 3) of slivers (N, 3) whose sides (N, 3) are edges of lengths_m (E,)."""
    base = lengths_m[of_slivers].argmin(axis=1)
    # From the tip opposite the base, with the same winding.
    turn = (base[:, None] + np.array([2, 0, 1])) % 3
    rows = np.arange(len(slivers))[:, None]
    tip, left, right = slivers[rows, turn].T
    sides = of_slivers[rows, turn]
    left_edge, right_edge = sides[:, 0], sides[:, 2]
    counts = np.stack([cut.parts[left_edge], cut.parts[right_edge]], axis=1)
    pieces = []
    for parts in np.unique(counts, axis=0):
        some = (counts == parts).all(axis=1)
        a, b, c = tip[some], left[some], right[some]
        up = cut.along(left_edge[some], a < b, int(parts[0]))
        down = cut.along(right_edge[some], a < c, int(parts[1]))
        vertices = np.concatenate([a[:, None], up, b[:, None], down, c[:, None]], axis=1)
        pieces.append(vertices[:, _ladder(*parts.tolist())].reshape(-1, 3))
    return np.concatenate(pieces)


@lru_cache
def _ladder(left_parts: int, right_parts: int) -> np.ndarray:
    """(T, 3) triangles between two sides from one tip: vertices tip, left ones, right ones."""
    left = np.arange(left_parts + 1)
    right = np.concatenate([[0], left_parts + 1 + np.arange(right_parts)])
    i, j = 1, 1
    triangles = [(left[0], left[1], right[1])]
    while i < left_parts or j < right_parts:
        if i < left_parts and (i + 1) * right_parts <= (j + 1) * left_parts:
            triangles.append((left[i], left[i + 1], right[j]))
            i += 1
        else:
            triangles.append((left[i], right[j + 1], right[j]))
            j += 1
    return np.array(triangles)
