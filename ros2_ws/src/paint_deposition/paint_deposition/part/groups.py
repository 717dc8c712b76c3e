"""What belongs together: points that lie near others, and groups that hang together by pairs."""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

BLOCK = 4096


def connected(pairs: np.ndarray, count: int) -> tuple[int, np.ndarray]:
    """How many groups (P, 2) pairs make of ``count`` members, and (count,) the group of each."""
    links = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return connected_components(links, directed=False)


def near_pairs(
    points_m: np.ndarray, others_m: np.ndarray, radius_m: float
) -> Iterator[tuple[slice, np.ndarray, np.ndarray, np.ndarray]]:
    """Pairs of points and others within a radius, a block of points at a time.

    Yields:
        The block, and of each pair the row in the block, the row of the other and the distance.
    """
    tree = cKDTree(others_m)
    for start in range(0, len(points_m), BLOCK):
        block = slice(start, start + BLOCK)
        near = cKDTree(points_m[block]).sparse_distance_matrix(
            tree, radius_m, output_type='ndarray'
        )
        yield block, near['i'], near['j'], near['v']
