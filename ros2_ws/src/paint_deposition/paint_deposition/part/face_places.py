"""Places on a part's face as one measures them by hand: from its left and from its lower edge.

The face is the part as the gun sees it, along its mean outward normal: the left edge is the
leftmost point of the part, the lower edge its lowest.
"""

import numpy as np

from paint_deposition.part.axes import across_axis, downhill_axis
from paint_deposition.part.surface import Surface

# How far before the part rays begin [m].
BEFORE_M = 0.1


def on_face_m(surface: Surface, from_left_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the surface that lie straight before places on its face.

    Args:
        surface: the part.
        from_left_m: (N, 2) distance from the left edge and height over the lower edge [m].

    Returns:
        Points (N, 3) in the mesh frame [m], and (N,) bool, whether there is surface at all; points
        without are nan.
    """
    outward, vertices = surface.outward, surface.vertices_m
    right, up, left, low = _face(surface)
    front = (vertices @ outward).max() + BEFORE_M
    places = np.nan_to_num(np.asarray(from_left_m, dtype=float))
    starts = np.outer(left + places[:, 0], right) + np.outer(low + places[:, 1], up)
    starts += front * outward
    face = surface.first_faces(starts, np.broadcast_to(-outward, starts.shape))
    hit = (face >= 0) & np.isfinite(from_left_m).all(axis=1)
    corners = vertices[surface.faces[np.maximum(face, 0)]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.einsum('nk,nk->n', starts - corners[:, 0], normals)
    way = height / np.where(hit, normals @ outward, 1.0)
    return np.where(hit[:, np.newaxis], starts - way[:, np.newaxis] * outward, np.nan), hit


def from_edges_m(surface: Surface, points_m: np.ndarray) -> np.ndarray:
    """(N, 2) distance of points (N, 3) from the left edge and height over the lower edge [m]."""
    right, up, left, low = _face(surface)
    return np.column_stack([points_m @ right - left, points_m @ up - low])


def _face(surface: Surface) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Unit vectors (3,) to the right and up, and where left and lower edge lie along them [m]."""
    outward = surface.outward
    right, up = across_axis(outward, surface.down), -downhill_axis(outward, surface.down)
    vertices = surface.vertices_m
    return right, up, float((vertices @ right).min()), float((vertices @ up).min())
