"""What belongs together: points that lie near others, and groups that hang together by pairs."""

from collections.abc import Iterator

import numpy as np
import scipy
from numba import njit

BLOCK = 4096


def connected(pairs: np.ndarray, count: int) -> tuple[int, np.ndarray]:
    """How many groups (P, 2) pairs make of ``count`` members, and (count,) the group of each.

    Groups are numbered in the order of their first members.
    """
    return numbered_groups(_joined(np.ascontiguousarray(pairs, dtype=np.int32), count))


@njit(cache=True, nogil=True)
def joined_groups(parent, one, other):
    """Join two members' groups; ``parent`` (N,) leads from each member to the group's first."""
    while parent[one] != one:
        parent[one] = parent[parent[one]]
        one = parent[one]
    while parent[other] != other:
        parent[other] = parent[parent[other]]
        other = parent[other]
    if one < other:
        parent[other] = one
    else:
        parent[one] = other


@njit(cache=True, nogil=True)
def numbered_groups(parent):
    """How many groups there are, and (N,) the number of each member's."""
    group = np.empty_like(parent)
    count = 0
    for member in range(len(parent)):
        if parent[member] == member:
            group[member] = count
            count += 1
        else:  # what leads to the first member comes before this one
            group[member] = group[parent[member]]
    return count, group


@njit(cache=True, nogil=True)
def _joined(pairs, count):
    parent = np.arange(count).astype(np.int32)
    for p in range(len(pairs)):
        joined_groups(parent, pairs[p, 0], pairs[p, 1])
    return parent


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
