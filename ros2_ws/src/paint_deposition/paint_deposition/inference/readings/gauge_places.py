"""Places on a part: where a gauge can stand, and as one measures them by hand."""

import numpy as np
from scipy.spatial import cKDTree

from paint_deposition.part.edges import near_pairs
from paint_deposition.part.orientation import across_axis, downhill_axis
from paint_deposition.part.surface import Surface


def on_face_m(surface: Surface, from_left_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the surface that lie straight before places on its face.

    The face is the part as the gun sees it, along its mean outward normal; places (N, 2) are from
    the part's leftmost point and over its lowest [m]. The points (N, 3) are nan where there is no
    surface; (N,) bool says whether there is.
    """
    outward, vertices = surface.outward, surface.vertices_m
    right, up, left, low = _face(surface)
    # How far before the part rays begin [m].
    front = (vertices @ outward).max() + 0.1
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


# The foot of a usual gauge, from its middle to its rim [m].
FOOT_M = 0.015


def can_stand(surface: Surface, foot_m: float = FOOT_M) -> np.ndarray:
    """(V,) bool, whether a foot of this radius [m] stands level around each vertex."""
    positions, normals = surface.vertices_m, surface.normals
    lean = np.zeros(len(positions))
    for block, one, other, _ in near_pairs(positions, positions, foot_m):
        cosine = np.einsum('nk,nk->n', normals[block][one], normals[other])
        # What faces the other way is the back of the sheet.
        turned = np.where(cosine > 0.0, np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)
        np.maximum.at(lean, block.start + one, turned)
    # Under the foot the surface turns away by no more: a radius of about 85 mm.
    return (surface.points().edge_distance_m > foot_m) & (lean <= np.radians(10.0))


def spread_places(surface: Surface, usable: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    """About ``count`` of the usable vertices (V,) bool, drawn at a distance; their rows."""
    area_m2 = float(surface.vertex_areas_m2[usable].sum())
    # Area that discs thrown at random take up until none fits any more, for a disc of diameter 1.
    apart_m = np.sqrt(area_m2 / (1.436 * count))
    order = np.random.default_rng(seed).permutation(np.flatnonzero(usable))
    tree, free, kept = cKDTree(surface.vertices_m[order]), np.ones(len(order), dtype=bool), []
    for row, vertex in enumerate(order):
        if free[row]:
            kept.append(vertex)
            free[tree.query_ball_point(surface.vertices_m[vertex], apart_m)] = False
    return np.array(kept, dtype=int)


def grid_places(surface: Surface, usable: np.ndarray, count: int) -> np.ndarray:
    """``count`` of the usable vertices (V,) bool on a square grid over the face; their rows.

    The widest grid that has as many; what it has too many is left out here and there.
    """
    rows = np.flatnonzero(usable)
    face = from_edges_m(surface, surface.vertices_m)
    tree, size = cKDTree(surface.vertices_m), face.max(axis=0)
    pitch_m = 1.5 * np.sqrt(surface.vertex_areas_m2[rows].sum() / count)
    while True:
        # Places at a pitch along both sides, as far from both of their ends.
        steps = [np.arange(int(length / pitch_m) + 1) for length in size]
        across, up = (
            0.5 * (length - step[-1] * pitch_m) + pitch_m * step
            for length, step in zip(size, steps, strict=True)
        )
        places, hit = on_face_m(surface, np.stack(np.meshgrid(across, up), -1).reshape(-1, 2))
        near = np.unique(tree.query(places[hit])[1])
        near = near[usable[near]]
        if len(near) >= count or pitch_m < 0.005:
            return near[np.linspace(0, len(near) - 1, min(count, len(near))).round().astype(int)]
        pitch_m *= 0.98
