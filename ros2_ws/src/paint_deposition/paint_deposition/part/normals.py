"""Vertex normals of the curved surface that a triangulation stands for."""

import numpy as np
from scipy.sparse import csr_matrix, eye_array

from paint_deposition.part.curvature import tangents
from paint_deposition.part.refinement import face_normals

# Near vertices shape the parabola by far the most.
NEARNESS = 12.0
# A fit that turns the normal further than this has met something else than a curve.
LARGEST_CORRECTION_COSINE = np.cos(np.radians(15.0))
WORST_CONDITION = 1e8
BLOCK = 8192


def surface_normals(vertices_m: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) outward unit normals of the curve through the vertices of smooth patches.

    The normal of a parabola through each vertex, fitted to those around it (Cazals and Pouget,
    Estimating differential quantities using polynomial fitting of osculating jets, 2005). Unlike
    the mean of the triangles' normals it does not depend on their sizes, nor lean on a border,
    where all triangles lie to one side. Where no parabola fits, that mean is taken.
    """
    normals = mean_normals(vertices_m, faces)
    around = _neighbours(faces, len(vertices_m))
    for start in range(0, len(vertices_m), BLOCK):
        block = slice(start, start + BLOCK)
        normals[block] = _fitted_normals(vertices_m, normals[block], around[block], start)
    return normals


def mean_normals(vertices_m: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) unit normals, each the mean of its triangles' weighted by their angle there."""
    corners = vertices_m[faces]
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    angle = np.arctan2(
        np.linalg.norm(np.cross(ahead, behind), axis=2), np.einsum('ijk,ijk->ij', ahead, behind)
    )
    weighted = angle[:, :, None] * face_normals(vertices_m, faces)[:, None, :]
    summed = np.zeros((len(vertices_m), 3))
    np.add.at(summed, faces, weighted)
    return summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12)


def _neighbours(faces: np.ndarray, count: int) -> csr_matrix:
    """(V, V) sparse: which vertices shape the parabola at each, those up to two edges away."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    linked = csr_matrix((np.ones(len(start)), (start, end)), shape=(count, count))
    linked = linked + linked.T + eye_array(count, format='csr')
    return linked @ linked


def _fitted_normals(
    vertices_m: np.ndarray, normals: np.ndarray, around: csr_matrix, first_row: int
) -> np.ndarray:
    rows = np.arange(len(normals))
    i = np.repeat(rows, np.diff(around.indptr))
    offset = vertices_m[around.indices] - vertices_m[first_row + i]
    distance = np.linalg.norm(offset, axis=1)
    size = np.maximum.reduceat(distance, around.indptr[:-1])[i]
    axes = tangents(normals)
    x, y = np.einsum('kni,ni->kn', axes[:, i], offset) / size
    height = np.einsum('ni,ni->n', normals[i], offset) / size
    terms = np.stack([x, y, 0.5 * x * x, x * y, 0.5 * y * y, height], axis=1)
    weight = np.exp(-NEARNESS * (distance / size) ** 2)
    products = weight[:, None, None] * terms[:, :5, None] * terms[:, None, :]
    sums = np.add.reduceat(products, around.indptr[:-1], axis=0)
    left, right = sums[:, :, :5], sums[:, :, 5:]
    sound = np.linalg.cond(left) < WORST_CONDITION
    left = np.where(sound[:, None, None], left, np.eye(5))
    slope = np.linalg.solve(left, right)[:, :2, 0]
    fitted = normals - slope[:, :1] * axes[0] - slope[:, 1:] * axes[1]
    cosine = 1.0 / np.linalg.norm(fitted, axis=1)
    sound &= cosine > LARGEST_CORRECTION_COSINE
    return np.where(sound[:, None], fitted * cosine[:, None], normals)
