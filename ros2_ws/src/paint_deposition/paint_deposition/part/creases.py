"""Edges of a triangle mesh: creases, which split normals, and the rim, where the surface ends."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from paint_deposition.kernel.code_cache import named_for_its_code
from paint_deposition.part.edge_distance import without_seams
from paint_deposition.part.groups import joined_groups, numbered_groups
from paint_deposition.part.half_edges import matched
from paint_deposition.part.hems import LEAST_FOLD_RAD, hem_folds
from paint_deposition.part.refinement import face_areas_m2, face_normals

# Facets that meet at a larger angle are taken for a crease of the part, not for a coarse curve.
CREASE_RAD = np.radians(30.0)
# A convex fold at least this sharp ends the surface as a free edge does: a hem, the rim of a
# plate. Rims that are cut along one direction meet a crowned surface at less than a right angle.
RIM_FOLD_RAD = np.radians(60.0)


@dataclass(frozen=True)
class Edges:
    """Which triangle edges lie on each other.

    Half-edges are numbered as in ``half_edges``.

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
        return Edges(*matched(faces))


def next_half_edge(half_edges: np.ndarray) -> np.ndarray:
    """The half-edge that follows in the same triangle."""
    return half_edges - half_edges % 3 + (half_edges + 1) % 3


def half_edges_m(vertices_m: np.ndarray, faces: np.ndarray, half_edges: np.ndarray) -> np.ndarray:
    """(H, 2, 3) ends of half-edges [m]."""
    corners = faces.ravel()
    return vertices_m[np.stack([corners[half_edges], corners[next_half_edge(half_edges)]], axis=1)]


def folds_rad(vertices_m: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
    """(E,) angle between the two triangles of each paired edge, positive if convex [rad]."""
    normals = face_normals(vertices_m, faces)
    sine, cosine, convex = _turns(normals, vertices_m, faces, edges.paired)
    angle = np.arctan2(sine, cosine)
    return np.where(convex, angle, -angle)


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
    faces: np.ndarray, edges: Edges, folds: np.ndarray, rim: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give each smooth patch its own vertices along creases and (E,) ``rim_folds``.

    Returns:
        (W,) the vertex each new vertex is a copy of, and (F, 3) faces on the new vertices.
    """
    smooth = (np.abs(folds) <= CREASE_RAD) & ~rim
    parent = np.arange(faces.size, dtype=np.int32)
    _join_across(edges.paired, smooth, parent)
    count, label = numbered_groups(parent)
    origin = np.empty(count, dtype=np.int64)
    origin[label] = faces.ravel()
    return origin, label.reshape(-1, 3).astype(np.int64)


def rim_segments_m(
    vertices_m: np.ndarray, faces: np.ndarray, edges: Edges, rim: np.ndarray
) -> np.ndarray:
    """(B, 2, 3) ends of segments where the surface ends or, at (E,) ``rim``, folds back [m]."""
    single = half_edges_m(vertices_m, faces, edges.single)
    return np.concatenate(
        [without_seams(single), half_edges_m(vertices_m, faces, edges.paired[rim, 0])]
    )


@njit(cache=True, nogil=True)
def _turns(normals, vertices, faces, paired):
    """Sine and cosine of the angle across each paired edge, and whether it is convex."""
    sine, cosine = np.empty(len(paired)), np.empty(len(paired))
    convex = np.empty(len(paired), dtype=np.bool_)
    for e in range(len(paired)):
        f, k = paired[e, 0] // 3, paired[e, 0] % 3
        start, end = faces[f, k], faces[f, (k + 1) % 3]
        ax, ay, az = normals[f]
        bx, by, bz = normals[paired[e, 1] // 3]
        x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        sine[e] = np.sqrt(x * x + y * y + z * z)
        cosine[e] = ax * bx + ay * by + az * bz
        x *= vertices[end, 0] - vertices[start, 0]
        y *= vertices[end, 1] - vertices[start, 1]
        z *= vertices[end, 2] - vertices[start, 2]
        convex[e] = x + y + z >= 0.0
    return sine, cosine, convex


@njit(cache=True, nogil=True)
@named_for_its_code
def _join_across(paired, smooth, parent):
    """Make the corners of both triangles one at the ends of every smooth edge."""
    for e in range(len(paired)):
        if smooth[e]:
            one, other = paired[e]
            joined_groups(parent, one, other + 1 if other % 3 < 2 else other - 2)
            joined_groups(parent, one + 1 if one % 3 < 2 else one - 2, other)
