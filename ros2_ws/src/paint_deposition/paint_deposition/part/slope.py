"""Derivative of a field on the surface along the pull of gravity in it."""

from __future__ import annotations

import numpy as np
import scipy

from paint_deposition.part.refinement import face_areas_m2, face_normals


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
    """Slope at n points from a field on (points, neighbours above, neighbours below).

    Args:
        centres_m, above_m, below_m: (n, 3) the points and their neighbours on the surface [m].
        way: (n, 3) ``downhill`` at the points.

    Returns:
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
