"""How high the part stands around each of its points: rays from above that meet nothing."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import get_num_threads, njit

# Faces in a leaf of the tree.
LEAF = 8
# Lower horizons are not told apart [sine]: hardly any paint comes from there.
LEAST_SINE = 0.05
# What rounding may hide [sine], and how near a point a face passes through it [m].
SLACK_SINE, TOUCHING_M = 0.03, 1e-6
# Fewer points are done before a second thread wakes.
LEAST_BLOCK = 2048
# Points with a part of the surface as high over them [sine] are not looked at any longer.
HIGH_SINE = 0.8
# A node of the tree: centre and half the sides of its box, half their diagonal, mean normal of its
# faces, and half their thickness along it.
BOX, RADIUS, NORMAL, THICKNESS = 3, 6, 7, 10
NODE = 11


@dataclass(frozen=True)
class Horizon:
    """The faces of a part in a tree of boxes, each cut to the slab that its faces lie in.

    Attributes:
        vertices_m: (V, 3) [m].
        faces: (F, 3) in the order of the leaves, neighbours together.
        nodes: (2 L - 1, 11) from the root down; the children of node i are 2 i + 1 and 2 i + 2.
    """

    vertices_m: np.ndarray
    faces: np.ndarray
    nodes: np.ndarray

    @staticmethod
    def of(vertices_m: np.ndarray, faces: np.ndarray) -> 'Horizon':
        """Sort (F, 3) faces of (V, 3) vertices [m] along a space-filling curve."""
        vertices = np.ascontiguousarray(vertices_m, dtype=np.float64)
        low, extent = vertices.min(axis=0), max(float(np.ptp(vertices, axis=0).max()), 1e-12)
        order = np.argsort(_places_on_the_curve(vertices, faces, low, 1023.0 / extent))
        faces = np.ascontiguousarray(faces[order], dtype=np.int64)
        leaves = 1 << math.ceil(math.log2(max(1.0, len(faces) / LEAF)))
        return Horizon(vertices, faces, _nodes(vertices, faces, leaves))

    def sines(self, points_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,) sine of the highest elevation at which a point sees any of the part.

        Elevations are those over the plane at right angles to the point's normal (N, 3). A ray
        that comes to the point from higher up meets nothing on its way. No less than LEAST_SINE,
        and 1 where it is above HIGH_SINE.
        """
        found = np.empty(len(points_m))
        blocks = max(1, min(get_num_threads(), len(points_m) // LEAST_BLOCK))
        bounds = np.linspace(0, len(points_m), blocks + 1).astype(np.int64)
        points = np.ascontiguousarray(points_m, dtype=np.float64)
        upward = np.ascontiguousarray(normals, dtype=np.float64)

        def fill(part: tuple[int, int]) -> None:
            _fill(points, upward, self.vertices_m, self.faces, self.nodes, *part, found)

        with ThreadPoolExecutor(blocks) as threads:
            list(threads.map(fill, pairwise(bounds)))
        return found


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
def _support(node, x, y, z):
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
            reach = _support(nodes[child], at[NORMAL], at[NORMAL + 1], at[NORMAL + 2])
            at[THICKNESS] = max(at[THICKNESS], abs(_along_normal(at, nodes[child])) + reach)
        at[THICKNESS] = min(at[THICKNESS], at[RADIUS])
    return nodes


@njit(cache=True, nogil=True)
def _edge_sine(ax, ay, az, ah, bx, by, bz, bh):
    """Highest sine of elevation along an edge from a to b, seen from the origin.

    ``ah`` and ``bh`` are the heights of a and b over the plane at the origin.
    """
    best = -1.0
    a2 = ax * ax + ay * ay + az * az
    if a2 > TOUCHING_M * TOUCHING_M:
        best = ah / math.sqrt(a2)
    ex, ey, ez, eh = bx - ax, by - ay, bz - az, bh - ah
    e2 = ex * ex + ey * ey + ez * ez
    ae = ax * ex + ay * ey + az * ez
    below = eh * ae - ah * e2
    if below != 0.0:
        # Where height over distance is level along the edge.
        s = (ah * ae - eh * a2) / below
        if 0.0 < s < 1.0:
            w2 = a2 + s * (2.0 * ae + s * e2)
            if w2 > TOUCHING_M * TOUCHING_M:
                best = max(best, (ah + s * eh) / math.sqrt(w2))
    return best


@njit(cache=True, nogil=True)
def _face_sine(p, n, vertices, face):
    """Highest sine of elevation of a triangle over the plane at p with unit normal n."""
    i, j, k = face[0], face[1], face[2]
    ax, ay, az = vertices[i, 0] - p[0], vertices[i, 1] - p[1], vertices[i, 2] - p[2]
    bx, by, bz = vertices[j, 0] - p[0], vertices[j, 1] - p[1], vertices[j, 2] - p[2]
    cx, cy, cz = vertices[k, 0] - p[0], vertices[k, 1] - p[1], vertices[k, 2] - p[2]
    ah = ax * n[0] + ay * n[1] + az * n[2]
    bh = bx * n[0] + by * n[1] + bz * n[2]
    ch = cx * n[0] + cy * n[1] + cz * n[2]
    if max(ah, bh, ch) <= 0.0:
        return 0.0
    # Straight above p: the normal through p on one side of all three edges.
    u = n[0] * (ay * bz - az * by) + n[1] * (az * bx - ax * bz) + n[2] * (ax * by - ay * bx)
    v = n[0] * (by * cz - bz * cy) + n[1] * (bz * cx - bx * cz) + n[2] * (bx * cy - by * cx)
    w = n[0] * (cy * az - cz * ay) + n[1] * (cz * ax - cx * az) + n[2] * (cx * ay - cy * ax)
    area = u + v + w
    inside = area != 0.0 and (min(u, v, w) >= 0.0 or max(u, v, w) <= 0.0)
    if inside and (v * ah + w * bh + u * ch) / area > TOUCHING_M:
        return 1.0
    return max(
        _edge_sine(ax, ay, az, ah, bx, by, bz, bh),
        _edge_sine(bx, by, bz, bh, cx, cy, cz, ch),
        _edge_sine(cx, cy, cz, ch, ax, ay, az, ah),
    )


@njit(cache=True, nogil=True)
def _bound(p, n, node):
    """No part of a node is seen from p under a higher sine of elevation, if that is below 1."""
    x, y, z = node[0] - p[0], node[1] - p[1], node[2] - p[2]
    height = n[0] * x + n[1] * y + n[2] * z + _support(node, n[0], n[1], n[2])
    if height <= 0.0:
        return 0.0
    x = max(0.0, abs(x) - node[BOX])
    y = max(0.0, abs(y) - node[BOX + 1])
    z = max(0.0, abs(z) - node[BOX + 2])
    nearest = math.sqrt(x * x + y * y + z * z)
    return height / nearest if nearest > 0.0 else np.inf


@njit(cache=True, nogil=True)
def _fill(points, normals, vertices, faces, nodes, start, stop, found):
    leaves = (len(nodes) + 1) // 2
    waiting, bounds = np.empty(64, dtype=np.int64), np.empty(64)
    highest_face = 0
    for i in range(start, stop):
        p = (points[i, 0], points[i, 1], points[i, 2])
        n = (normals[i, 0], normals[i, 1], normals[i, 2])
        # Neighbours mostly share the face that is highest.
        highest = max(LEAST_SINE - SLACK_SINE, _face_sine(p, n, vertices, faces[highest_face]))
        waiting[0], bounds[0], left = 0, np.inf, 1
        while left and highest < HIGH_SINE:
            left -= 1
            if not bounds[left] > highest + SLACK_SINE:
                continue
            node = waiting[left]
            leaf = node - (leaves - 1)
            if leaf < 0:
                one, other = 2 * node + 1, 2 * node + 2
                first, second = _bound(p, n, nodes[one]), _bound(p, n, nodes[other])
                if first > second:
                    one, other, first, second = other, one, second, first
                waiting[left], bounds[left] = one, first
                waiting[left + 1], bounds[left + 1] = other, second
                left += 2
                continue
            for f in range(len(faces) * leaf // leaves, len(faces) * (leaf + 1) // leaves):
                sine = _face_sine(p, n, vertices, faces[f])
                if sine > highest:
                    highest, highest_face = sine, f
        found[i] = highest + SLACK_SINE if highest < HIGH_SINE else 1.0
