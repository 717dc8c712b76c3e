"""Edges of a triangle mesh: creases, which split normals, and the rim, where the surface ends."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.part.edge_distance import without_seams
from paint_deposition.part.groups import connected
from paint_deposition.part.hems import hem_folds
from paint_deposition.part.refinement import face_areas_m2, face_normals

# Facets that meet at a larger angle are taken for a crease of the part, not for a coarse curve.
CREASE_RAD = np.radians(30.0)
# A convex fold at least this sharp ends the surface as a free edge does: a hem, the rim of a
# plate. Rims that are cut along one direction meet a crowned surface at less than a right angle.
RIM_FOLD_RAD = np.radians(60.0)


@dataclass(frozen=True)
class Edges:
    """Which triangle edges lie on each other.

    Half-edge h = 3 f + k runs from corner k of triangle f to its next corner.

    Attributes:
        paired: (E, 2) half-edges of two triangles with the same winding that share an edge.
        clashing: (C, 2) half-edges of two triangles of opposite winding that share an edge.
        single: (B,) half-edges without a partner, or with several.
    """

    paired: np.ndarray
    clashing: np.ndarray
    single: np.ndarray

    @staticmethod
    def of(faces: np.ndarray) -> 'Edges':
        """Match the edges of (F, 3) faces."""
        start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        key = np.minimum(start, end) * (faces.max() + 1) + np.maximum(start, end)
        order = np.argsort(key, kind='stable')
        _, first, count = np.unique(key[order], return_index=True, return_counts=True)
        pairs = np.stack([order[first[count == 2]], order[first[count == 2] + 1]], axis=1)
        opposed = start[pairs[:, 0]] != start[pairs[:, 1]]
        lonely = np.repeat(count, count) != 2
        return Edges(pairs[opposed], pairs[~opposed], np.sort(order[lonely]))


def next_half_edge(half_edges: np.ndarray) -> np.ndarray:
    """The half-edge that follows in the same triangle."""
    return half_edges - half_edges % 3 + (half_edges + 1) % 3


def half_edges_m(vertices_m: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(3 F, 2, 3) ends of all half-edges [m]."""
    return vertices_m[np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)]


def folds_rad(vertices_m: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
    """(E,) angle between the two triangles of each paired edge, positive if convex [rad]."""
    normals = face_normals(vertices_m, faces)
    one, other = normals[edges.paired[:, 0] // 3], normals[edges.paired[:, 1] // 3]
    start, end = half_edges_m(vertices_m, faces)[edges.paired[:, 0]].transpose(1, 0, 2)
    turning = np.cross(one, other)
    angle = np.arctan2(np.linalg.norm(turning, axis=1), np.einsum('ij,ij->i', one, other))
    convex = np.einsum('ij,ij->i', turning, end - start) >= 0.0
    return np.where(convex, angle, -angle)


def rim_folds(vertices_m: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
    """(E,) bool: paired edges at which the surface ends by folding back, at once or in a hem."""
    folds = folds_rad(vertices_m, faces, edges)
    ends = half_edges_m(vertices_m, faces)[edges.paired[:, 0]]
    area = face_areas_m2(vertices_m, faces)[edges.paired // 3].min(axis=1)
    width = 2.0 * area / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return (folds >= RIM_FOLD_RAD) | hem_folds(ends, folds, width, RIM_FOLD_RAD)


def split_at_creases(
    vertices_m: np.ndarray, faces: np.ndarray, edges: Edges, rim: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give each smooth patch its own vertices along creases and (E,) ``rim_folds``.

    Returns:
        (W,) the vertex each new vertex is a copy of, and (F, 3) faces on the new vertices.
    """
    sharp = np.abs(folds_rad(vertices_m, faces, edges)) > CREASE_RAD
    smooth = edges.paired[~sharp & ~rim]
    one, other = smooth.T
    joined = [[one, next_half_edge(other)], [next_half_edge(one), other]]
    count, label = connected(np.concatenate(joined, axis=1).T, faces.size)
    origin = np.empty(count, dtype=np.int64)
    origin[label] = faces.ravel()
    return origin, label.reshape(-1, 3).astype(np.int64)


def rim_segments_m(
    vertices_m: np.ndarray, faces: np.ndarray, edges: Edges, rim: np.ndarray
) -> np.ndarray:
    """(B, 2, 3) ends of segments where the surface ends or, at (E,) ``rim``, folds back [m]."""
    ends = half_edges_m(vertices_m, faces)
    return np.concatenate([without_seams(ends[edges.single]), ends[edges.paired[rim, 0]]])
