"""Derivatives on the surface: its normals, its curvature, and the slope of a field on it."""

import math
from functools import partial

import numpy as np
import scipy

from paint_deposition.kernel.blocks import shared_among_threads
from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.fast_math import cross, difference, dot, length
from paint_deposition.part.creases import RIM_FOLD_RAD
from paint_deposition.part.edges import near_pairs, rows_by_number
from paint_deposition.part.refinement import face_areas_m2, face_normals

# Of a parabola through a point: two slopes and three second derivatives.
UNKNOWNS = 5


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

    fill = partial(_fill, vertices, triangles, first, corner, normals)
    shared_among_threads(len(vertices), fill)
    return normals


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
@named_for_its_code
def _equations(vertices, v, normal, near, system):
    """Fill ``system`` (5, 6) with the normal equations of the parabola over the plane at v.

    Returns unit vectors that make a right-handed frame with the normal, as ``tangents``.
    """
    n0, n1, n2 = normal
    sign = math.copysign(1.0, n2)
    a = -1.0 / (sign + n2)
    b = n0 * n1 * a
    first = (1.0 + sign * n0 * n0 * a, sign * b, -sign * n0)
    second = (b, sign + n1 * n1 * a, -n1)
    farthest2 = 0.0
    for w in near:
        offset = difference(vertices[w], vertices[v])
        farthest2 = max(farthest2, dot(offset, offset))
    size = math.sqrt(farthest2)
    terms = np.empty(UNKNOWNS + 1)
    system[:] = 0.0
    for w in near:
        away = difference(vertices[w], vertices[v])
        offset = (away[0] / size, away[1] / size, away[2] / size)
        x, y = dot(first, offset), dot(second, offset)
        terms[0], terms[1] = x, y
        terms[2], terms[3], terms[4] = 0.5 * x * x, x * y, 0.5 * y * y
        terms[5] = dot(normal, offset)
        # Near vertices shape the parabola by far the most.
        weight = math.exp(-12.0 * dot(offset, offset))
        for i in range(UNKNOWNS):
            share = weight * terms[i]
            for j in range(i, UNKNOWNS + 1):
                system[i, j] += share * terms[j]
    for i in range(UNKNOWNS):
        for j in range(i):
            system[i, j] = system[j, i]
    return first, second


@njit(cache=True, nogil=True, error_model='numpy')
def _solved(system, work):
    """Slopes along both axes, and the condition of the equations (Gauss and Jordan)."""
    size2 = 0.0
    for i in range(UNKNOWNS):
        for j in range(UNKNOWNS):
            size2 += system[i, j] * system[i, j]
            work[i, UNKNOWNS + 1 + j] = 1.0 if i == j else 0.0
    work[:, : UNKNOWNS + 1] = system
    for k in range(UNKNOWNS):
        pivot = k
        for i in range(k + 1, UNKNOWNS):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        if work[pivot, k] == 0.0:
            return 0.0, 0.0, np.inf
        for j in range(2 * UNKNOWNS + 1):
            work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
        scale = 1.0 / work[k, k]
        for j in range(2 * UNKNOWNS + 1):
            work[k, j] *= scale
        for i in range(UNKNOWNS):
            if i != k:
                share = work[i, k]
                for j in range(2 * UNKNOWNS + 1):
                    work[i, j] -= share * work[k, j]
    inverse2 = 0.0
    for i in range(UNKNOWNS):
        for j in range(UNKNOWNS):
            inverse2 += work[i, UNKNOWNS + 1 + j] ** 2
    return work[0, UNKNOWNS], work[1, UNKNOWNS], math.sqrt(size2 * inverse2)


@njit(cache=True, nogil=True, error_model='numpy')
@named_for_its_code
def _fill(vertices, faces, first, corner, normals, start, stop):
    """Set the normals of vertices from start to stop."""
    seen = np.zeros(len(vertices), dtype=np.int32)
    passed, near = np.zeros_like(seen), np.empty_like(seen)
    system, work = np.empty((UNKNOWNS, UNKNOWNS + 1)), np.empty((UNKNOWNS, 2 * UNKNOWNS + 1))
    for v in range(start, stop):
        normal = normals[v]
        normal[:] = 0.0
        for c in corner[first[v] : first[v + 1]]:
            f, k = c // 3, c % 3
            ahead = difference(vertices[faces[f, (k + 1) % 3]], vertices[v])
            behind = difference(vertices[faces[f, (k + 2) % 3]], vertices[v])
            spanned = cross(ahead, behind)
            size = length(spanned)
            angle = math.atan2(size, dot(ahead, behind))
            for axis in range(3):
                normal[axis] += angle * (spanned[axis] / size)
        normal /= max(length(normal), 1e-12)
        count = _gather(faces, first, corner, v, seen, passed, near)
        one, other = _equations(vertices, v, normal, near[:count], system)
        along, across, condition = _solved(system, work)
        cosine = 1.0 / math.sqrt(1.0 + along * along + across * across)
        # A fit with ill-conditioned equations, by the Frobenius norm, or one that turns the normal
        # further has met something else than a curve.
        if condition < 1e8 and cosine > math.cos(math.radians(15.0)):
            for axis in range(3):
                slope = along * one[axis] + across * other[axis]
                normal[axis] = (normal[axis] - slope) * cosine


# Normals within this radius tell the curvature [m].
RADIUS_M = 0.03


def curvature_per_m(
    points_m: np.ndarray,
    normals: np.ndarray,
    surface_m: np.ndarray,
    surface_normals: np.ndarray,
    surface_areas_m2: np.ndarray,
    radius_m: float = RADIUS_M,
) -> np.ndarray:
    """Sum k1 + k2 of the principal curvatures, positive where concave toward the gun [1/m].

    It is minus the divergence of the outward normal along the surface. The sum is what matters for
    the electric field E over a conductor, dE/dn = (k1 + k2) E in this sign: stronger toward convex
    surface. A cylinder's ridge of radius R has -1/R, a ball -2/R, a valley +1/R.

    The divergence is that of a linear function fitted to the normals of the surface, given by
    samples (S, 3) with areas (S,), within the radius: a fold narrower than it appears smoothed,
    and the triangulation does not show. Surface round a rim does not count: a sheet drawn with its
    thickness has the curvature of one without.
    """
    result = np.empty(len(points_m))
    for block, i, j, distance_m in near_pairs(points_m, surface_m, radius_m):
        offset = surface_m[j] - points_m[block][i]
        own, other = normals[block][i], surface_normals[j]
        # Copies of a vertex on both sides of a rim lie at one place, but for the last bits [m].
        convex = np.einsum('ij,ij->i', other - own, offset) > -1e-6
        # Surface that has turned so far within the radius lies round a rim, or is another side; in
        # a hollow it may turn further.
        least = np.where(convex, np.cos(RIM_FOLD_RAD), -0.25)
        same_side = np.einsum('ij,ij->i', own, other) > least
        i, j, offset = i[same_side], j[same_side], offset[same_side]
        weight = surface_areas_m2[j] * (1.0 - (distance_m[same_side] / radius_m) ** 2) ** 2
        axes = tangents(normals[block])
        place = np.einsum('kni,ni->kn', axes[:, i], offset)
        lean = np.einsum('kni,ni->kn', axes[:, i], surface_normals[j])
        result[block] = -_divergence(i, weight, place, lean, len(axes[0]))
    return result


def tangents(normals: np.ndarray) -> np.ndarray:
    """(2, N, 3) unit vectors that make a right-handed frame with the (N, 3) unit normals."""
    # Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6(1), 2017.
    x, y, z = normals.T
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    second = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.stack([first, second])


def _divergence(
    group: np.ndarray, weight: np.ndarray, place: np.ndarray, lean: np.ndarray, count: int
) -> np.ndarray:
    """Trace of the matrix J of the weighted fit lean = constant + J place, a group at a time."""

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(group, weight * values, minlength=count) / total

    total = np.maximum(np.bincount(group, weight, minlength=count), 1e-300)
    x, y = (component - mean(component)[group] for component in place)
    u, v = lean
    xx, xy, yy = mean(x * x), mean(x * y), mean(y * y)
    ux, uy, vx, vy = mean(u * x), mean(u * y), mean(v * x), mean(v * y)
    # A hair of ridge: neighbours on one line say nothing across it.
    ridge = 1e-6 * (xx + yy) + 1e-18
    xx, yy = xx + ridge, yy + ridge
    return (ux * yy - uy * xy + vy * xx - vx * xy) / (xx * yy - xy * xy)


def downhill(normals: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(N, 3) component of ``down`` along the surface: length 1 where vertical, 0 where level."""
    return down - (normals @ down)[:, None] * normals


def slope_operator(
    vertices_m: np.ndarray, faces: np.ndarray, normals: np.ndarray, down: np.ndarray
) -> scipy.sparse.csr_matrix:
    """Sparse (V, V) matrix to the derivative of a vertex field along ``downhill`` [1/m].

    On each triangle the gradient is that of the linear interpolant; a vertex takes the mean of
    its triangles', weighted by area. Exact for linear fields on a plane.
    """
    areas = face_areas_m2(vertices_m, faces)
    up = face_normals(vertices_m, faces)
    corners = vertices_m[faces]
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    # Gradient of the hat function of each corner, times the triangle's area.
    hats = 0.5 * np.cross(up[:, None, :], opposite)
    way = downhill(normals, down)
    share = np.bincount(faces.ravel(), np.repeat(areas, 3), minlength=len(vertices_m))
    values = np.einsum('fai,fbi->fab', way[faces], hats) / share[faces][:, :, None]
    rows = np.broadcast_to(faces[:, :, None], values.shape)
    columns = np.broadcast_to(faces[:, None, :], values.shape)
    count = len(vertices_m)
    entries = values.ravel(), (rows.ravel(), columns.ravel())
    return scipy.sparse.csr_matrix(entries, shape=(count, count))


def slope_at_stencil(
    centres_m: np.ndarray, above_m: np.ndarray, below_m: np.ndarray, way: np.ndarray
) -> scipy.sparse.csr_matrix:
    """Slope at n points from a field on them, n neighbours above and n below; ``way`` downhill.

    Sparse (3 n, 3 n); only the first n rows are not zero [1/m].
    """
    count = len(centres_m)
    steepness = np.linalg.norm(way, axis=1)
    unit = way / np.maximum(steepness, 1e-12)[:, None]
    distance = np.einsum('ij,ij->i', below_m - above_m, unit)
    usable = distance > 1e-6
    value = np.where(usable, steepness / np.where(usable, distance, 1.0), 0.0)
    points = np.arange(count)
    return scipy.sparse.csr_matrix(
        (
            np.concatenate([-value, value]),
            (np.tile(points, 2), np.concatenate([count + points, 2 * count + points])),
        ),
        shape=(3 * count, 3 * count),
    )
