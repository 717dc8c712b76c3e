"""Hems and rounded rims: strips where the surface turns away within a sheet's thickness."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from paint_deposition.part.refinement import face_areas_m2

# A turn counts as that of a rim if it is made within this distance [m].
REACH_M = 0.01
# Folds that turn more slowly belong to a curved surface.
LEAST_RATE_PER_M = 20.0
WIDEST_STRIP_M = 0.02
LEAST_FOLD_RAD = np.radians(4.0)
PIECE_M = 0.005
PARALLEL_COSINE = 0.8
BLOCK = 4096


def hem_folds(
    ends_m: np.ndarray, folds_rad: np.ndarray, width_m: np.ndarray, turn_rad: float
) -> np.ndarray:
    """(E,) bool: folds of which several in a row turn convexly by at least a rim's turn.

    Args:
        ends_m: (E, 2, 3) each fold's ends [m].
        folds_rad: (E,) turn over each, positive if convex [rad].
        width_m: (E,) height of the lower of its two triangles [m].
        turn_rad: turn of a rim [rad].
    """
    hem = np.zeros(len(folds_rad), dtype=bool)
    close = (folds_rad > LEAST_FOLD_RAD) & (folds_rad > LEAST_RATE_PER_M * width_m)
    rows = np.flatnonzero(close)
    if not len(rows):
        return hem
    along = ends_m[rows, 1] - ends_m[rows, 0]
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-12)
    along = along / length[:, None]
    count = np.maximum(1, np.ceil(length / PIECE_M)).astype(int)
    whose = np.repeat(np.arange(len(rows)), count)
    step = np.arange(len(whose)) - np.repeat(np.cumsum(count) - count, count)
    half = 0.5 * (length / count)[whose]
    middle = ends_m[rows, 0][whose] + ((2 * step + 1) * half)[:, None] * along[whose]
    fold = folds_rad[rows]
    tree = cKDTree(middle)
    turn = fold[whose]
    for start in range(0, len(middle), BLOCK):
        near = cKDTree(middle[start : start + BLOCK]).sparse_distance_matrix(
            tree, REACH_M, output_type='ndarray'
        )
        i, j = near['i'] + start, near['j']
        parallel = np.abs(np.einsum('ij,ij->i', along[whose[i]], along[whose[j]]))
        beside = (whose[i] != whose[j]) & (parallel > PARALLEL_COSINE)
        i, j = i[beside], j[beside]
        ahead = np.abs(np.einsum('ij,ij->i', middle[j] - middle[i], along[whose[i]]))
        # Of a fold beside it in several pieces each counts as far as it lies abreast.
        abreast = 0.5 + (half[j] - ahead) / (2.0 * np.minimum(half[i], half[j]))
        turn += np.bincount(i, np.clip(abreast, 0.0, 1.0) * fold[whose[j]], minlength=len(turn))
    rim = np.bincount(whose, turn >= turn_rad, minlength=len(rows)) > 0
    hem[rows[rim]] = True
    return hem


def strip_vertices(
    vertices_m: np.ndarray, patches: np.ndarray, hem_half_edges: np.ndarray
) -> np.ndarray:
    """(V,) bool: vertices of patches so narrow that they belong to a hem.

    Args:
        vertices_m: (V, 3) [m].
        patches: (F, 3) triangles on vertices that no two smooth patches share.
        hem_half_edges: (H,) both half-edges of each fold of a hem, as numbered by ``Edges``.
    """
    patch = _patch_of_vertex(patches, len(vertices_m))
    ends = vertices_m[patches], vertices_m[np.roll(patches, -1, axis=1)]
    length_m = np.linalg.norm(ends[1] - ends[0], axis=2).ravel()[hem_half_edges]
    of_face = patch[patches[:, 0]]
    border = np.bincount(of_face[hem_half_edges // 3], length_m, minlength=patch.max() + 1)
    area = np.bincount(of_face, face_areas_m2(vertices_m, patches), minlength=patch.max() + 1)
    # A strip has a fold on both its sides.
    return (2.0 * area < WIDEST_STRIP_M * border)[patch]


def carried_over(flagged: np.ndarray, fine: np.ndarray, count: int) -> np.ndarray:
    """(count,) bool: the flag of patches' first vertices, for all vertices of the refined ones."""
    patch = _patch_of_vertex(fine, count)
    return np.bincount(patch[: len(flagged)], flagged, minlength=patch.max() + 1)[patch] > 0


def _patch_of_vertex(faces: np.ndarray, count: int) -> np.ndarray:
    linked = np.concatenate([faces[:, :2], faces[:, 1:]]).T
    links = coo_matrix((np.ones(linked.shape[1]), linked), shape=(count, count))
    return connected_components(links, directed=False)[1]
