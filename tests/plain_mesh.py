"""What `part` compiles for meshes, once more in plain NumPy and SciPy, to check it."""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, eye_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

WELD_M = 1e-6
NEARNESS = 12.0
LARGEST_CORRECTION_COSINE = np.cos(np.radians(15.0))
WORST_CONDITION = 1e8


def welded(vertices, faces):
    """Vertices closer than a micrometre made one, in the order in which they appear."""
    unique, label = np.unique(vertices, axis=0, return_inverse=True)
    close = cKDTree(unique).query_pairs(WELD_M, output_type='ndarray')
    links = coo_matrix((np.ones(len(close)), close.T), shape=(len(unique),) * 2)
    group = connected_components(links, directed=False)[1][label.ravel()]
    first = np.unique(group, return_index=True)[1]
    order = np.argsort(first)
    return vertices[first[order]], np.argsort(order)[group][faces]


def mean_normals(vertices, faces):
    """(V, 3) means of the triangles' unit normals by their angles."""
    corners = vertices[faces]
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    across = np.cross(ahead, behind)
    length = np.linalg.norm(across, axis=2)
    angle = np.arctan2(length, np.einsum('ijk,ijk->ij', ahead, behind))
    summed = np.zeros((len(vertices), 3))
    np.add.at(summed, faces, angle[:, :, None] * across / length[:, :, None])
    return summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12)


def surface_normals(vertices, faces):
    """(V, 3) normals of the parabola fitted to the vertices up to two edges away."""
    normals = mean_normals(vertices, faces)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    linked = csr_matrix((np.ones(len(start)), (start, end)), shape=(len(vertices),) * 2)
    linked = linked + linked.T + eye_array(len(vertices), format='csr')
    around = linked @ linked
    return np.stack(
        [
            _fitted(vertices[around.indices[low:high]] - vertex, normal)
            for vertex, normal, low, high in zip(
                vertices, normals, around.indptr[:-1], around.indptr[1:], strict=True
            )
        ]
    )


def _fitted(offsets, normal):
    distance = np.linalg.norm(offsets, axis=1)
    size = distance.max()
    if size == 0.0:
        return normal
    one = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    one /= np.linalg.norm(one)
    other = np.cross(normal, one)
    x, y, height = (offsets @ axis / size for axis in (one, other, normal))
    terms = np.stack([x, y, 0.5 * x * x, x * y, 0.5 * y * y], axis=1)
    weighted = np.exp(-NEARNESS * (distance / size) ** 2)[:, None] * terms
    left = weighted.T @ terms
    if np.linalg.cond(left) >= WORST_CONDITION:
        return normal
    along, across = np.linalg.solve(left, weighted.T @ height)[:2]
    fitted = normal - along * one - across * other
    cosine = 1.0 / np.linalg.norm(fitted)
    return fitted * cosine if cosine > LARGEST_CORRECTION_COSINE else normal
