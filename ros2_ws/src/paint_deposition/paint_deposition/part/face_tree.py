"""The faces of a part in a tree of boxes: closest places, first hits and horizons are found in it.

A tree of a million triangles is there in half a second. To hand them to Embree takes five times as
long, which pays for millions of rays only (``visibility``).
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from paint_deposition.kernel.blocks import bounding_box_m
from paint_deposition.kernel.code_cache import named_for_its_code

# Faces in a leaf of the tree.
LEAF = 8
# A node of the tree: centre and half the sides of its box, half their diagonal, mean normal of its
# faces, and half their thickness along it.
BOX, RADIUS, NORMAL, THICKNESS = 3, 6, 7, 10
NODE = 11
# Nodes that wait to be looked at, at the most: one for each level.
DEPTH = 64


@dataclass(frozen=True)
class FaceTree:
    """The faces of a part in a tree of boxes, each cut to the slab that its faces lie in.

    Attributes:
        vertices_m: (V, 3) [m].
        faces: (F, 3) in the order of the leaves, neighbours together.
        order: (F,) which of the part's faces each of them is.
        nodes: (2 L - 1, 11) from the root down; the children of node i are 2 i + 1 and 2 i + 2.
            Leaf l has the faces from F l / L to F (l + 1) / L.
    """

    vertices_m: np.ndarray
    faces: np.ndarray
    order: np.ndarray
    nodes: np.ndarray

    @staticmethod
    def of(vertices_m: np.ndarray, faces: np.ndarray) -> 'FaceTree':
        """Sort (F, 3) faces of (V, 3) vertices [m] along a space-filling curve."""
        vertices = np.ascontiguousarray(vertices_m, dtype=np.float64)
        low, high = bounding_box_m(vertices)
        extent = max(float((high - low).max()), 1e-12)
        order = np.argsort(_places_on_the_curve(vertices, faces, low, 1023.0 / extent))
        faces = np.ascontiguousarray(faces[order], dtype=np.int64)
        leaves = 1 << math.ceil(math.log2(max(1.0, len(faces) / LEAF)))
        return FaceTree(vertices, faces, order, _nodes(vertices, faces, leaves))


@njit(cache=True, nogil=True)
def _places_on_the_curve(vertices, faces, low, scale):
    """(F,) place of each face's centre on Morton's curve through 1024^3 cells."""
    places = np.zeros(len(faces), dtype=np.int32)
    for f in range(len(faces)):
        for k in range(3):
            centre = (
                vertices[faces[f, 0], k] + vertices[faces[f, 1], k] + vertices[faces[f, 2], k]
            ) / 3.0
            cell = int((centre - low[k]) * scale)
            for bit in range(10):
                places[f] |= ((cell >> bit) & 1) << (3 * bit + k)
    return places


@njit(cache=True, nogil=True)
def support(node, x, y, z):
    """How far a node reaches from its centre along a unit vector [m]."""
    along = min(1.0, abs(node[NORMAL] * x + node[NORMAL + 1] * y + node[NORMAL + 2] * z))
    across = math.sqrt(1.0 - along * along)
    return min(node[RADIUS], along * node[THICKNESS] + across * node[RADIUS])


@njit(cache=True, nogil=True)
def _along_normal(node, place):
    """How far a place lies from a node's centre along its normal [m]."""
    return (
        (place[0] - node[0]) * node[NORMAL]
        + (place[1] - node[1]) * node[NORMAL + 1]
        + (place[2] - node[2]) * node[NORMAL + 2]
    )


@njit(cache=True, nogil=True)
def _nodes(vertices, faces, leaves):
    """(2 L - 1, 11) boxes around all nodes, and slabs around what is in them."""
    nodes = np.zeros((2 * leaves - 1, NODE))
    low, high = np.full((len(nodes), 3), np.inf), np.full((len(nodes), 3), -np.inf)
    areas = np.zeros((len(nodes), 3))
    for node in range(len(nodes) - 1, -1, -1):
        at, leaf = nodes[node], node - (leaves - 1)
        inner = leaf < 0
        first = 0 if inner else len(faces) * leaf // leaves
        last = 0 if inner else len(faces) * (leaf + 1) // leaves
        for f in range(first, last):
            a, b, c = faces[f]
            for k in range(3):
                low[node, k] = min(low[node, k], vertices[a, k], vertices[b, k], vertices[c, k])
                high[node, k] = max(high[node, k], vertices[a, k], vertices[b, k], vertices[c, k])
                i, j = (k + 1) % 3, (k + 2) % 3
                areas[node, k] += (vertices[b, i] - vertices[a, i]) * (
                    vertices[c, j] - vertices[a, j]
                ) - (vertices[b, j] - vertices[a, j]) * (vertices[c, i] - vertices[a, i])
        children = range(2 * node + 1, 2 * node + 3 if inner else 2 * node + 1)
        for child in children:
            for k in range(3):
                low[node, k] = min(low[node, k], low[child, k])
                high[node, k] = max(high[node, k], high[child, k])
                areas[node, k] += areas[child, k]
        squared, area2 = 0.0, 1e-300
        for k in range(3):
            at[k] = 0.5 * (low[node, k] + high[node, k])
            at[BOX + k] = 0.5 * (high[node, k] - low[node, k])
            squared += at[BOX + k] ** 2
            area2 += areas[node, k] ** 2
        at[RADIUS] = math.sqrt(squared)
        for k in range(3):
            at[NORMAL + k] = areas[node, k] / math.sqrt(area2)
        for f in range(first, last):
            for corner in faces[f]:
                at[THICKNESS] = max(at[THICKNESS], abs(_along_normal(at, vertices[corner])))
        for child in children:
            reach = support(nodes[child], at[NORMAL], at[NORMAL + 1], at[NORMAL + 2])
            at[THICKNESS] = max(at[THICKNESS], abs(_along_normal(at, nodes[child])) + reach)
        at[THICKNESS] = min(at[THICKNESS], at[RADIUS])
    return nodes


@njit(cache=True, nogil=True)
def box_distance(p, node):
    """How far a point (x, y, z) is from a node's box [m]."""
    x = max(0.0, abs(p[0] - node[0]) - node[BOX])
    y = max(0.0, abs(p[1] - node[1]) - node[BOX + 1])
    z = max(0.0, abs(p[2] - node[2]) - node[BOX + 2])
    return math.sqrt(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def leaf_faces(nodes, faces, node):
    """First face of a leaf, and the one behind its last."""
    leaves = (len(nodes) + 1) // 2
    leaf = node - (leaves - 1)
    return len(faces) * leaf // leaves, len(faces) * (leaf + 1) // leaves


@njit(cache=True, nogil=True)
def wait(waiting, keys, left, node, first, second):
    """Let a node's children wait, the one with the lesser key first; return how many wait now."""
    one, other = 2 * node + 1, 2 * node + 2
    if first < second:
        one, other, first, second = other, one, second, first
    waiting[left], keys[left] = one, first
    waiting[left + 1], keys[left + 1] = other, second
    return left + 2


# A ray through a common edge meets one of both triangles, whatever was rounded.
ON_THE_EDGE = -1e-9
# Boxes are larger by this, so that rounding hides no flat one [m].
SLACK_M = 1e-9


def first_faces(tree: FaceTree, starts_m: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(N,) the face that each of N rays meets first, from either side, -1 for none."""
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
