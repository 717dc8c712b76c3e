"""The faces of a part in a tree of boxes: closest places, horizons and first hits of rays.

Whether a ray meets anything at all is Embree's, see ``visibility``: millions of rays pay for it.
"""

import math
from dataclasses import dataclass

import numpy as np

from paint_deposition.kernel.blocks import bounding_box_m
from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.fast_math import cross, difference, dot, length

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
@named_for_its_code
def support(node, way):
    """How far a node reaches from its centre along a unit vector [m]."""
    along = min(1.0, abs(dot(node[NORMAL:THICKNESS], way)))
    across = math.sqrt(1.0 - along * along)
    return min(node[RADIUS], along * node[THICKNESS] + across * node[RADIUS])


@njit(cache=True, nogil=True)
@named_for_its_code
def _nodes(vertices, faces, leaves):
    """(2 L - 1, 11) boxes around all nodes, and slabs around what is in them."""
    nodes = np.zeros((2 * leaves - 1, NODE))
    low, high = np.full((len(nodes), 3), np.inf), np.full((len(nodes), 3), -np.inf)
    areas = np.zeros((len(nodes), 3))
    for node in range(len(nodes) - 1, -1, -1):
        at, leaf = nodes[node], node - (leaves - 1)
        normal = at[NORMAL:THICKNESS]
        inner = leaf < 0
        first = 0 if inner else len(faces) * leaf // leaves
        last = 0 if inner else len(faces) * (leaf + 1) // leaves
        for f in range(first, last):
            a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
            area = cross(difference(b, a), difference(c, a))
            for k in range(3):
                low[node, k] = min(low[node, k], a[k], b[k], c[k])
                high[node, k] = max(high[node, k], a[k], b[k], c[k])
                areas[node, k] += area[k]
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
            normal[k] = areas[node, k] / math.sqrt(area2)
        for f in range(first, last):
            for corner in faces[f]:
                away = abs(dot(difference(vertices[corner], at), normal))
                at[THICKNESS] = max(at[THICKNESS], away)
        for child in children:
            away = abs(dot(difference(nodes[child], at), normal))
            at[THICKNESS] = max(at[THICKNESS], away + support(nodes[child], normal))
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
@named_for_its_code
def _face_hit(p, way, vertices, face):
    """How far along a ray from p it meets a triangle, its border included; inf: never.

    Möller and Trumbore, Fast, minimum storage ray/triangle intersection, 1997.
    """
    a = vertices[face[0]]
    to_b, to_c = difference(vertices[face[1]], a), difference(vertices[face[2]], a)
    across = cross(way, to_c)
    determinant = dot(to_b, across)
    if determinant == 0.0:
        return np.inf
    to_p = difference(p, a)
    of_b = dot(to_p, across) / determinant
    beside = cross(to_p, to_b)
    of_c, hit = dot(way, beside) / determinant, dot(to_c, beside) / determinant
    inside = min(of_b, of_c, 1.0 - of_b - of_c) >= -1e-9
    return hit if inside and hit >= 0.0 else np.inf


@njit(cache=True, nogil=True)
@named_for_its_code
def first_hits(starts, ways, vertices, faces, nodes, met, start, stop):
    """Set the row in ``faces`` of what each ray (N, 3) meets first, from either side, or -1.

    Of the rays from ``start`` to ``stop``.
    """
    inner = len(nodes) // 2
    waiting, entries = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    for ray in range(start, stop):
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


# How much further away than the nearest surface the side that a normal points out of may be.
THICKNESS_M = 0.06


def locate(
    tree: FaceTree,
    vertex_normals: np.ndarray,
    points_m: np.ndarray,
    normals: np.ndarray | None = None,
    side: np.ndarray | None = None,
    least_cosine: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """See ``Surface.locate``; without ``normals`` the back of the only ``side`` is not taken.

    Surface agrees with ``normals`` if the cosine between them is no less than ``least_cosine``.
    """
    points: np.ndarray = np.ascontiguousarray(points_m, dtype=np.float64).reshape(-1, 3)
    if not np.isfinite(points).all():
        raise ValueError('points to be located are not finite')
    wanted: np.ndarray
    if normals is not None:
        wanted = np.ascontiguousarray(normals, dtype=np.float64).reshape(-1, 3)
        least = least_cosine
    elif side is not None:
        # Surface that leans further than this from the side that is painted is its back.
        wanted, least = np.broadcast_to(side, points.shape).astype(np.float64), -0.5
    else:
        wanted, least = np.zeros_like(points), -1.0
    face, place = np.empty(len(points), dtype=np.int64), np.empty(points.shape)
    _find(
        points, wanted, least, tree.vertices_m, vertex_normals, tree.faces, tree.nodes, face, place
    )
    corners = tree.faces[face]
    # Barycentric weights (N, 3) of the corners at the places in their triangles.
    a, b, c = tree.vertices_m[corners].transpose(1, 0, 2)
    whole = np.cross(b - a, c - a)
    size2 = np.einsum('ij,ij->i', whole, whole)
    of_b = np.einsum('ij,ij->i', np.cross(place - a, c - a), whole) / size2
    of_c = np.einsum('ij,ij->i', np.cross(b - a, place - a), whole) / size2
    weights = np.clip(np.stack([1.0 - of_b - of_c, of_b, of_c], axis=1), 0.0, 1.0)
    weights /= weights.sum(axis=1, keepdims=True)
    outward = np.einsum('nk,nki->ni', weights, vertex_normals[corners])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    return place, outward, np.linalg.norm(points - place, axis=1)


@njit(cache=True, nogil=True)
@named_for_its_code
def closest_place(a, b, c, p):
    """The place on a triangle that is closest to a point; all are (x, y, z).

    Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    ab, ac, ap = difference(b, a), difference(c, a), difference(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    abab, abac, acac = dot(ab, ab), dot(ab, ac), dot(ac, ac)
    # The same from b and from c, and the areas of the triangles that the point makes.
    d3, d4, d5, d6 = d1 - abab, d2 - abac, d1 - abac, d2 - acac
    of_a, of_b, of_c = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif of_c <= 0.0 <= d1 and d3 <= 0.0:
        v, w = d1 / (d1 - d3), 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif of_b <= 0.0 <= d2 and d6 <= 0.0:
        v, w = 0.0, d2 / (d2 - d6)
    elif of_a <= 0.0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        area = of_a + of_b + of_c
        v, w = of_b / area, of_c / area
    return (
        a[0] + v * ab[0] + w * ac[0],
        a[1] + v * ab[1] + w * ac[1],
        a[2] + v * ab[2] + w * ac[2],
    )


@njit(cache=True, nogil=True)
@named_for_its_code
def _find(points, wanted, least, vertices, normals, faces, nodes, found, places):
    """Set the row in ``faces`` and the place (N, 3) closest to each point.

    Surface that agrees less than ``least`` with what is wanted counts as THICKNESS_M further away.
    """
    inner = len(nodes) // 2
    waiting, away = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    for i in range(len(points)):
        p, nearest = points[i], np.inf
        waiting[0], away[0], left = 0, 0.0, 1
        while left:
            left -= 1
            if not away[left] < nearest:
                continue
            node = waiting[left]
            if node < inner:
                first = box_distance(p, nodes[2 * node + 1])
                second = box_distance(p, nodes[2 * node + 2])
                left = wait(waiting, away, left, node, first, second)
                continue
            for f in range(*leaf_faces(nodes, faces, node)):
                a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
                place = closest_place(vertices[a], vertices[b], vertices[c], p)
                distance = length(difference(place, p))
                if distance < nearest:
                    agreement = 0.0
                    for k in range(3):
                        sides = normals[a, k] + normals[b, k] + normals[c, k]
                        agreement += wanted[i, k] * sides
                    if agreement / 3.0 < least:
                        distance += THICKNESS_M
                if distance < nearest:
                    nearest, found[i] = distance, f
                    places[i, 0], places[i, 1], places[i, 2] = place
