"""Creases, which split normals, and rims and hems, where the surface ends."""

import numpy as np

from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.part.edges import (
    Edges,
    cut_segments,
    half_edges_m,
    join,
    near_pairs,
    numbered,
    patch_of_vertex,
    without_seams,
)
from paint_deposition.part.refinement import edge_lengths_m, face_areas_m2, face_normals

# Facets that meet at a larger angle are taken for a crease of the part, not for a coarse curve.
CREASE_RAD = np.radians(30.0)
# A convex fold at least this sharp ends the surface as a free edge does: a hem, the rim of a
# plate. Rims that are cut along one direction meet a crowned surface at less than a right angle.
RIM_FOLD_RAD = np.radians(60.0)
# A turn counts as that of a rim if it is made within this distance [m].
REACH_M = 0.01
# Folds that turn more slowly belong to a curved surface.
WIDEST_STRIP_M = 0.02
LEAST_FOLD_RAD = np.radians(4.0)
PIECE_M = 0.005
PARALLEL_COSINE = 0.8


def folds_rad(vertices_m: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
    """(E,) angle between the two triangles of each paired edge, positive if convex [rad]."""
    return _folds_rad(vertices_m, faces, face_normals(vertices_m, faces), edges.paired)


@njit(cache=True, nogil=True)
def _folds_rad(vertices, faces, normals, paired):
    folds = np.empty(len(paired))
    for e in range(len(paired)):
        f, k = paired[e, 0] // 3, paired[e, 0] % 3
        a, b, c = normals[f]
        u, v, w = normals[paired[e, 1] // 3]
        x, y, z = b * w - c * v, c * u - a * w, a * v - b * u
        angle = np.arctan2(np.sqrt(x * x + y * y + z * z), a * u + b * v + c * w)
        start, end = vertices[faces[f, k]], vertices[faces[f, (k + 1) % 3]]
        along = x * (end[0] - start[0]) + y * (end[1] - start[1]) + z * (end[2] - start[2])
        folds[e] = angle if along >= 0.0 else -angle
    return folds


def rim_folds(
    vertices_m: np.ndarray, faces: np.ndarray, edges: Edges, folds: np.ndarray
) -> np.ndarray:
    """(E,) bool: paired edges at which the surface ends by folding back, at once or in a hem."""
    rim = folds >= RIM_FOLD_RAD
    rows = np.flatnonzero(folds > LEAST_FOLD_RAD)
    ends = half_edges_m(vertices_m, faces, edges.paired[rows, 0])
    beside = faces[edges.paired[rows] // 3].reshape(-1, 3)
    area = face_areas_m2(vertices_m, beside).reshape(-1, 2).min(axis=1)
    width = 2.0 * area / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    rim[rows] |= hem_folds(ends, folds[rows], width, RIM_FOLD_RAD)
    return rim


def split_at_creases(
    faces: np.ndarray, edges: Edges, smooth: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give each patch whose paired edges are all ``smooth`` (E,) its own vertices.

    Returned are (W,) the vertex each new vertex is a copy of, and (F, 3) faces on the new
    vertices.
    """
    corners = np.arange(faces.size, dtype=np.int32)
    _join_corners(corners, edges.paired, smooth)
    count, label = numbered(corners)
    origin = np.empty(count, dtype=np.int64)
    origin[label] = faces.ravel()
    return origin, label.reshape(-1, 3)


@njit(cache=True, nogil=True)
@named_for_its_code
def _join_corners(corners, paired, smooth):
    """Make the corners at both ends of smooth edges hang together."""
    for e in range(len(paired)):
        if smooth[e]:
            one, other = paired[e]
            join(corners, one, other // 3 * 3 + (other + 1) % 3)
            join(corners, one // 3 * 3 + (one + 1) % 3, other)


def rim_segments_m(
    vertices_m: np.ndarray, faces: np.ndarray, edges: Edges, rim: np.ndarray
) -> np.ndarray:
    """(B, 2, 3) ends of segments where the surface ends or, at (E,) ``rim``, folds back [m]."""
    single = half_edges_m(vertices_m, faces, edges.single)
    return np.concatenate(
        [without_seams(single), half_edges_m(vertices_m, faces, edges.paired[rim, 0])]
    )


def hem_folds(
    ends_m: np.ndarray, folds_rad: np.ndarray, width_m: np.ndarray, turn_rad: float
) -> np.ndarray:
    """(E,) bool: folds of which several in a row turn convexly by at least ``turn_rad``.

    Of each its ends (E, 2, 3), its angle, positive if convex, and the height of the lower
    triangle.
    """
    hem = np.zeros(len(folds_rad), dtype=bool)
    # Folds that turn more slowly belong to a curved surface.
    close = (folds_rad > LEAST_FOLD_RAD) & (folds_rad > 20.0 * width_m)
    rows = np.flatnonzero(close)
    if not len(rows):
        return hem
    along = ends_m[rows, 1] - ends_m[rows, 0]
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-12)
    along = along / length[:, None]
    pieces, whose = cut_segments(ends_m[rows], PIECE_M)
    half = 0.5 * (length / np.bincount(whose))[whose]
    middle = pieces.mean(axis=1)
    fold = folds_rad[rows]
    turn = fold[whose]
    for block, i, j, _ in near_pairs(middle, middle, REACH_M):
        i = i + block.start
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
    """(V,) bool: vertices of patches (F, 3) so narrow that they belong to a hem.

    No two smooth patches share vertices; of each fold of a hem both half-edges are given.
    """
    if not len(hem_half_edges):
        return np.zeros(len(vertices_m), dtype=bool)
    patch = patch_of_vertex(patches, len(vertices_m))
    length_m = edge_lengths_m(vertices_m, patches).ravel()[hem_half_edges]
    of_face = patch[patches[:, 0]]
    border = np.bincount(of_face[hem_half_edges // 3], length_m, minlength=patch.max() + 1)
    area = np.bincount(of_face, face_areas_m2(vertices_m, patches), minlength=patch.max() + 1)
    # A strip has a fold on both its sides.
    return (2.0 * area < WIDEST_STRIP_M * border)[patch]


def carried_over(flagged: np.ndarray, fine: np.ndarray, count: int) -> np.ndarray:
    """(count,) bool: the flag of patches' first vertices, for all vertices of the refined ones."""
    if not flagged.any():
        return np.zeros(count, dtype=bool)
    patch = patch_of_vertex(fine, count)
    return np.bincount(patch[: len(flagged)], flagged, minlength=patch.max() + 1)[patch] > 0
