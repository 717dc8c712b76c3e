"""What rays meet first on a part."""

import numpy as np
from numba import njit

from paint_deposition.kernel.code_cache import named_for_its_code
from paint_deposition.part.face_tree import BOX, DEPTH, FaceTree, leaf_faces, wait

# A ray through a common edge meets one of both triangles, whatever was rounded.
ON_THE_EDGE = -1e-9
# Boxes are larger by this, so that rounding hides no flat one [m].
SLACK_M = 1e-9


def first_faces(tree: FaceTree, starts_m: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(N,) the face that each ray meets first, from either side, -1 for none.

    Args:
        starts_m: (N, 3) [m].
        directions: (N, 3), any length.
    """
    starts = np.ascontiguousarray(starts_m, dtype=np.float64)
    ways = np.ascontiguousarray(directions, dtype=np.float64)
    met = np.empty(len(starts), dtype=np.int64)
    _meet(starts, ways, tree.vertices_m, tree.faces, tree.order, tree.nodes, met)
    return met


@njit(cache=True, nogil=True, error_model='numpy')
def _entry(start, way, node):
    """Where along a ray it comes into a box, inf where it does not."""
    enter, leave = 0.0, np.inf
    for k in range(3):
        low = node[k] - node[BOX + k] - SLACK_M - start[k]
        high = node[k] + node[BOX + k] + SLACK_M - start[k]
        if way[k] == 0.0:
            if low > 0.0 or high < 0.0:
                return np.inf
            continue
        one, other = low / way[k], high / way[k]
        enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
    return enter if enter <= leave else np.inf


@njit(cache=True, nogil=True, error_model='numpy')
def _crossing(start, way, vertices, face):
    """Where along a ray it meets a triangle, inf where not (Moeller and Trumbore, 1997)."""
    i, j, k = face[0], face[1], face[2]
    ax, ay, az = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    ux, uy, uz = vertices[j, 0] - ax, vertices[j, 1] - ay, vertices[j, 2] - az
    vx, vy, vz = vertices[k, 0] - ax, vertices[k, 1] - ay, vertices[k, 2] - az
    px, py, pz = way[1] * vz - way[2] * vy, way[2] * vx - way[0] * vz, way[0] * vy - way[1] * vx
    size = ux * px + uy * py + uz * pz
    if size == 0.0:
        return np.inf
    sx, sy, sz = start[0] - ax, start[1] - ay, start[2] - az
    one = (sx * px + sy * py + sz * pz) / size
    qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
    other = (way[0] * qx + way[1] * qy + way[2] * qz) / size
    if min(one, other, 1.0 - one - other) < ON_THE_EDGE:
        return np.inf
    along = (vx * qx + vy * qy + vz * qz) / size
    return along if along >= 0.0 else np.inf


@njit(cache=True, nogil=True, error_model='numpy')
@named_for_its_code
def _meet(starts, ways, vertices, faces, order, nodes, met):
    inner = len(nodes) // 2
    waiting, entries = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    for i in range(len(starts)):
        start = (starts[i, 0], starts[i, 1], starts[i, 2])
        way = (ways[i, 0], ways[i, 1], ways[i, 2])
        nearest, met[i] = np.inf, -1
        waiting[0], entries[0], left = 0, _entry(start, way, nodes[0]), 1
        while left:
            left -= 1
            if not entries[left] < nearest:
                continue
            node = waiting[left]
            if node < inner:
                first = _entry(start, way, nodes[2 * node + 1])
                second = _entry(start, way, nodes[2 * node + 2])
                left = wait(waiting, entries, left, node, first, second)
                continue
            for f in range(*leaf_faces(nodes, faces, node)):
                along = _crossing(start, way, vertices, faces[f])
                if along < nearest:
                    nearest, met[i] = along, order[f]
