"""Derivatives on the surface: its curvature, and the slope of a field on it."""

import numpy as np
import scipy

from paint_deposition.part.creases import RIM_FOLD_RAD
from paint_deposition.part.edges import near_pairs
from paint_deposition.part.refinement import face_areas_m2, face_normals

RADIUS_M = 0.03
# Surface whose normal points further away than this is another side of the part.
OTHER_SIDE_COSINE = -0.25
# Surface that has turned so far away from the gun within the radius lies round a rim.
RIM_COSINE = np.cos(RIM_FOLD_RAD)
SAME_PLACE_M = 1e-6


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
        same_side = _same_side(normals[block][i], surface_normals[j], offset)
        i, j, offset = i[same_side], j[same_side], offset[same_side]
        weight = surface_areas_m2[j] * (1.0 - (distance_m[same_side] / radius_m) ** 2) ** 2
        axes = tangents(normals[block])
        place = np.einsum('kni,ni->kn', axes[:, i], offset)
        lean = np.einsum('kni,ni->kn', axes[:, i], surface_normals[j])
        result[block] = -_divergence(i, weight, place, lean, len(axes[0]))
    return result


def _same_side(normals: np.ndarray, others: np.ndarray, offset_m: np.ndarray) -> np.ndarray:
    """(K,) bool: whether surface is of the same side of the part; a hollow may turn further."""
    cosine = np.einsum('ij,ij->i', normals, others)
    # Copies of a vertex on both sides of a rim lie at one place, but for the last bits.
    convex = np.einsum('ij,ij->i', others - normals, offset_m) > -SAME_PLACE_M
    return cosine > np.where(convex, RIM_COSINE, OTHER_SIDE_COSINE)


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
