"""The faces of a part in a tree of boxes: closest places, horizons and first hits of rays.

Whether a ray meets anything at all is Embree's, see ``visibility``: millions of rays pay for it.
"""

import math
from dataclasses import dataclass

import numpy as np

from paint_deposition.kernel.blocks import bounding_box_m
from paint_deposition.kernel.compiler import named_for_its_code, njit

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
    """The faces of a part in a tree of boxes, each cut to the slab that its faces lie in."""

    vertices_m: np.ndarray  # (V, 3) [m]
    faces: np.ndarray  # (F, 3) in the order of the leaves, neighbours together
    order: np.ndarray  # (F,) which of the part's faces each of them is
    # (2 L - 1, 11) from the root down; the children of node i are 2 i + 1 and 2 i + 2. Leaf l has
    # the faces from F l / L to F (l + 1) / L.
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


@njit(cache=True, nogil=True, error_model='numpy')
def _box_entry(p, way, node):
    """How far along a ray from p it enters a node's box, in lengths of its way; inf: never."""
    enters, leaves = 0.0, np.inf
    for k in range(3):
        reach = node[BOX + k] * (1.0 + 1e-12) + 1e-12
        if way[k] == 0.0:
            if abs(p[k] - node[k]) > reach:
                return np.inf
            continue
        near, far = (node[k] - reach - p[k]) / way[k], (node[k] + reach - p[k]) / way[k]
        enters, leaves = max(enters, min(near, far)), min(leaves, max(near, far))
    return enters if enters <= leaves else np.inf


@njit(cache=True, nogil=True, error_model='numpy')
def _face_hit(p, way, vertices, face):
    """How far along a ray from p it meets a triangle, its border included; inf: never.

    Möller and Trumbore, Fast, minimum storage ray/triangle intersection, 1997.
    """
    a, b, c = vertices[face[0]], vertices[face[1]], vertices[face[2]]
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    u, v, w = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    i, j, k = way[1] * w - way[2] * v, way[2] * u - way[0] * w, way[0] * v - way[1] * u
    determinant = x * i + y * j + z * k
    if determinant == 0.0:
        return np.inf
    r, s, t = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    of_b = (r * i + s * j + t * k) / determinant
    e, g, h = s * z - t * y, t * x - r * z, r * y - s * x
    of_c = (way[0] * e + way[1] * g + way[2] * h) / determinant
    hit = (u * e + v * g + w * h) / determinant
    inside = min(of_b, of_c, 1.0 - of_b - of_c) >= -1e-9
    return hit if inside and hit >= 0.0 else np.inf


@njit(cache=True, nogil=True)
@named_for_its_code
def first_hits(starts, ways, vertices, faces, nodes, met):
    """Set the row in ``faces`` of what each ray (N, 3) meets first, from either side, or -1."""
    inner = len(nodes) // 2
    waiting, entries = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    for ray in range(len(starts)):
        p, way, nearest = starts[ray], ways[ray], np.inf
        met[ray] = -1
        waiting[0], entries[0], left = 0, 0.0, 1
        while left:
            left -= 1
            if not entries[left] < nearest:
                continue
            node = waiting[left]
            if node < inner:
                first = _box_entry(p, way, nodes[2 * node + 1])
                second = _box_entry(p, way, nodes[2 * node + 2])
                left = wait(waiting, entries, left, node, first, second)
                continue
            for f in range(*leaf_faces(nodes, faces, node)):
                hit = _face_hit(p, way, vertices, faces[f])
                if hit < nearest:
                    nearest, met[ray] = hit, f
