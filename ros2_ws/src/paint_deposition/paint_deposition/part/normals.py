"""Vertex normals of the curved surface that a triangulation stands for."""

import math

import numpy as np

from paint_deposition.kernel.compiler import njit
from paint_deposition.kernel.threads import shared_among_threads
from paint_deposition.part.edges import rows_by_number

# Near vertices shape the parabola by far the most.
NEARNESS = 12.0
# A fit that turns the normal further than this has met something else than a curve.
LARGEST_CORRECTION_COSINE = math.cos(math.radians(15.0))
# Of the fit's equations, by the Frobenius norm.
WORST_CONDITION = 1e8
TERMS = 5


def surface_normals(vertices_m: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) outward unit normals of the curve through the vertices of smooth patches.

    The normal of a parabola through each vertex, fitted to those around it, up to two edges away
    (Cazals and Pouget, Estimating differential quantities using polynomial fitting of osculating
    jets, 2005). Unlike the mean of the triangles' normals it does not depend on their sizes, nor
    lean on a border, where all triangles lie to one side. Where no parabola fits, that mean is
    taken.
    """
    vertices = np.ascontiguousarray(vertices_m, dtype=np.float64)
    triangles = np.ascontiguousarray(faces, dtype=np.int64)
    # Corners 3 f + k at the vertices: those of v are corner[first[v] : first[v + 1]].
    corner, first = rows_by_number(triangles.ravel(), len(vertices))
    normals = np.empty((len(vertices), 3))

    def fill(start: int, stop: int) -> None:
        _fill(vertices, triangles, first, corner, start, stop, normals)

    shared_among_threads(len(vertices), fill)
    return normals


@njit(cache=True, nogil=True, error_model='numpy')
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])


@njit(cache=True, nogil=True, error_model='numpy')
def _mean_normal(vertices, faces, corners, out):
    ahead, behind, across = np.empty(3), np.empty(3), np.empty(3)
    for axis in range(3):
        out[axis] = 0.0
    for c in corners:
        f, k = c // 3, c % 3
        here = faces[f, k]
        for axis in range(3):
            ahead[axis] = vertices[faces[f, (k + 1) % 3], axis] - vertices[here, axis]
            behind[axis] = vertices[faces[f, (k + 2) % 3], axis] - vertices[here, axis]
        length = _cross(ahead, behind, across)
        cosine = ahead[0] * behind[0] + ahead[1] * behind[1] + ahead[2] * behind[2]
        angle = math.atan2(length, cosine)
        for axis in range(3):
            out[axis] += angle * (across[axis] / length)
    length = max(math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]), 1e-12)
    for axis in range(3):
        out[axis] /= length


@njit(cache=True, nogil=True)
def _gather(faces, first, corner, v, seen, passed, near):
    """Put v and the vertices up to two edges from it into ``near``; return how many."""
    count = 0
    for c in corner[first[v] : first[v + 1]]:
        for side in range(3):
            u = faces[c // 3, side]
            if passed[u] == v + 1:
                continue
            passed[u] = v + 1
            for d in corner[first[u] : first[u + 1]]:
                for other in range(3):
                    w = faces[d // 3, other]
                    if seen[w] != v + 1:
                        seen[w] = v + 1
                        near[count] = w
                        count += 1
    return count


@njit(cache=True, nogil=True, error_model='numpy')
def _equations(vertices, v, normal, near, system):
    """Fill ``system`` (5, 6) with the normal equations of the parabola over the plane at v."""
    n0, n1, n2 = normal[0], normal[1], normal[2]
    # Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6(1), 2017.
    sign = math.copysign(1.0, n2)
    a = -1.0 / (sign + n2)
    b = n0 * n1 * a
    first = (1.0 + sign * n0 * n0 * a, sign * b, -sign * n0)
    second = (b, sign + n1 * n1 * a, -n1)
    farthest2 = 0.0
    for w in near:
        o0 = vertices[w, 0] - vertices[v, 0]
        o1 = vertices[w, 1] - vertices[v, 1]
        o2 = vertices[w, 2] - vertices[v, 2]
        farthest2 = max(farthest2, o0 * o0 + o1 * o1 + o2 * o2)
    size = math.sqrt(farthest2)
    terms = np.empty(TERMS + 1)
    for i in range(TERMS):
        for j in range(TERMS + 1):
            system[i, j] = 0.0
    for w in near:
        o0 = (vertices[w, 0] - vertices[v, 0]) / size
        o1 = (vertices[w, 1] - vertices[v, 1]) / size
        o2 = (vertices[w, 2] - vertices[v, 2]) / size
        x = first[0] * o0 + first[1] * o1 + first[2] * o2
        y = second[0] * o0 + second[1] * o1 + second[2] * o2
        terms[0], terms[1] = x, y
        terms[2], terms[3], terms[4] = 0.5 * x * x, x * y, 0.5 * y * y
        terms[5] = n0 * o0 + n1 * o1 + n2 * o2
        weight = math.exp(-NEARNESS * (o0 * o0 + o1 * o1 + o2 * o2))
        for i in range(TERMS):
            share = weight * terms[i]
            for j in range(i, TERMS + 1):
                system[i, j] += share * terms[j]
    for i in range(TERMS):
        for j in range(i):
            system[i, j] = system[j, i]
    return first, second


@njit(cache=True, nogil=True, error_model='numpy')
def _solved(system, work):
    """Slopes along both axes, and the condition of the equations (Gauss and Jordan)."""
    size2 = 0.0
    for i in range(TERMS):
        for j in range(TERMS):
            size2 += system[i, j] * system[i, j]
            work[i, TERMS + 1 + j] = 1.0 if i == j else 0.0
        for j in range(TERMS + 1):
            work[i, j] = system[i, j]
    for k in range(TERMS):
        pivot = k
        for i in range(k + 1, TERMS):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        if work[pivot, k] == 0.0:
            return 0.0, 0.0, np.inf
        for j in range(2 * TERMS + 1):
            work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
        scale = 1.0 / work[k, k]
        for j in range(2 * TERMS + 1):
            work[k, j] *= scale
        for i in range(TERMS):
            if i != k:
                share = work[i, k]
                for j in range(2 * TERMS + 1):
                    work[i, j] -= share * work[k, j]
    inverse2 = 0.0
    for i in range(TERMS):
        for j in range(TERMS):
            inverse2 += work[i, TERMS + 1 + j] ** 2
    return work[0, TERMS], work[1, TERMS], math.sqrt(size2 * inverse2)


@njit(cache=True, nogil=True, error_model='numpy')
def _fill(vertices, faces, first, corner, start, stop, normals):
    """Set the normals of vertices from start to stop."""
    seen = np.zeros(len(vertices), dtype=np.int32)
    passed, near = np.zeros_like(seen), np.empty_like(seen)
    system, work = np.empty((TERMS, TERMS + 1)), np.empty((TERMS, 2 * TERMS + 1))
    for v in range(start, stop):
        normal = normals[v]
        _mean_normal(vertices, faces, corner[first[v] : first[v + 1]], normal)
        count = _gather(faces, first, corner, v, seen, passed, near)
        one, other = _equations(vertices, v, normal, near[:count], system)
        along, across, condition = _solved(system, work)
        cosine = 1.0 / math.sqrt(1.0 + along * along + across * across)
        if condition < WORST_CONDITION and cosine > LARGEST_CORRECTION_COSINE:
            for axis in range(3):
                slope = along * one[axis] + across * other[axis]
                normal[axis] = (normal[axis] - slope) * cosine
