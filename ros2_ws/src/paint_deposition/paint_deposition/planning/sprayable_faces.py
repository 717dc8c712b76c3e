"""A part's faces: connected patches that can each be sprayed from one side."""

from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.part.edges import (
    connected,
    edge_distance_m,
    edges_of,
    half_edges_by_edge,
    half_edges_m,
)
from paint_deposition.part.refinement import face_areas_m2, face_normals
from paint_deposition.part.surface import Surface

# Within a face normals turn away from its mean by no more, but for a small share of its area.
WIDEST_RAD, BEYOND = np.radians(40.0), 0.05
# What is smaller than this share of the part goes with the neighbour that it leans least from.
LEAST_SHARE = 0.02


@dataclass(frozen=True)
class Face:
    """A patch of a part."""

    surface: Surface  # the patch alone
    vertices: np.ndarray  # (N,) rows of its vertices in the part
    # (N,) straight distance to the nearest other face, inf without one [m].
    seam_distance_m: np.ndarray

    def without_margin(self, margin_m: float) -> 'Face':
        """The face less a margin along its seams, which leaves its middle in any case [m]."""
        depth_m = self.seam_distance_m[self.surface.faces].min(axis=1)
        # A margin leaves 15 % of the triangles of a face, those farthest from its seams.
        middle_m = float(np.sort(depth_m)[int(0.85 * len(depth_m))])
        margin_m = min(margin_m, middle_m)
        if margin_m <= 0.0 or np.isinf(depth_m).all():
            return self
        surface, rows = patch(self.surface, depth_m >= margin_m)
        return Face(surface, self.vertices[rows], self.seam_distance_m[rows])


def sprayable_faces(surface: Surface, widest_rad: float = WIDEST_RAD) -> tuple[Face, ...]:
    """Split the outward side of a part, an open sheet, the largest face first.

    The normals are grouped about as few mean directions as keep 95 % of the area within the angle
    (k-means on the sphere). Connected triangles of one group are a face; small ones go to a
    neighbour.
    """
    normals = face_normals(surface.vertices_m, surface.faces)
    areas = face_areas_m2(surface.vertices_m, surface.faces)
    # (N, 2) triangles that share an edge.
    half_edges, first = half_edges_by_edge(_places(surface)[surface.faces])
    follows = np.ones(len(half_edges), dtype=bool)
    follows[first[:-1]] = False
    same = np.flatnonzero(follows)
    pairs = np.column_stack([half_edges[same - 1], half_edges[same]]) // 3
    side = _sides(normals, areas, widest_rad)
    one_side = pairs[side[pairs[:, 0]] == side[pairs[:, 1]]]
    _, label = connected(one_side, len(side))
    label = _without_small(label, pairs, normals, areas)
    names = np.unique(label)
    order = np.argsort([-areas[label == name].sum() for name in names])
    return tuple(_face(surface, label == names[k]) for k in order)


def patch(surface: Surface, kept: np.ndarray) -> tuple[Surface, np.ndarray]:
    """The triangles kept, (F,) bool, as a surface, and the rows of its vertices."""
    faces = surface.faces[kept]
    rows, inverse = np.unique(faces, return_inverse=True)
    thirds = np.repeat(face_areas_m2(surface.vertices_m, faces) / 3.0, 3)
    inverse = inverse.ravel()
    found = replace(
        surface,
        vertices_m=surface.vertices_m[rows],
        faces=inverse.reshape(-1, 3),
        normals=surface.normals[rows],
        vertex_areas_m2=np.bincount(inverse, thirds, minlength=len(rows)),
        in_hem=None if surface.in_hem is None else surface.in_hem[rows],
        neighbours=None,
    )
    return found, rows


def _face(surface: Surface, kept: np.ndarray) -> Face:
    found, rows = patch(surface, kept)
    edge = edges_of(_places(surface)[surface.faces])[1]
    seam = np.flatnonzero((kept[:, None] & np.isin(edge, edge[~kept])).ravel())
    ends_m = half_edges_m(surface.vertices_m, surface.faces, seam)
    return Face(found, rows, edge_distance_m(found.vertices_m, ends_m))


def _places(surface: Surface) -> np.ndarray:
    """(V,) number of the place of each vertex: along creases several vertices share one."""
    rounded = np.round(surface.vertices_m / 1e-6).astype(np.int64)
    return np.unique(rounded, axis=0, return_inverse=True)[1].ravel()


def _sides(normals: np.ndarray, areas: np.ndarray, widest_rad: float) -> np.ndarray:
    """(F,) number of the mean direction that each normal belongs to, by as few as will do."""
    means = normals[[int(np.argmax(normals @ (areas @ normals)))]]
    for _ in range(12):  # sides, at the most
        for _ in range(30):
            side = np.argmax(normals @ means.T, axis=1)
            sums = np.stack([areas[side == k] @ normals[side == k] for k in range(len(means))])
            moved = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)
            settled = np.allclose(moved, means, atol=1e-6)
            means = moved
            if settled:
                break
        cosine = np.einsum('fk,fk->f', normals, means[side])
        far = cosine < np.cos(widest_rad)
        if areas[far].sum() <= BEYOND * areas.sum():
            break
        means = np.vstack([means, normals[np.argmin(cosine)]])
    return side


def _without_small(
    label: np.ndarray, pairs: np.ndarray, normals: np.ndarray, areas: np.ndarray
) -> np.ndarray:
    """Give small patches, the smallest first, to the neighbour that they lean least from."""
    label = label.copy()
    while True:
        names, owner = np.unique(label, return_inverse=True)
        owner = owner.ravel()
        total = np.bincount(owner, areas)
        sums = np.stack([np.bincount(owner, areas * normals[:, k]) for k in range(3)], axis=1)
        means = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)
        for small in np.argsort(total):
            if total[small] >= LEAST_SHARE * total.sum():
                return label
            ends = owner[pairs]
            beside = np.unique(ends[(ends == small).any(axis=1)])
            beside = beside[beside != small]
            if len(beside):
                nearest = beside[np.argmax(means[beside] @ means[small])]
                label[owner == small] = names[nearest]
                break
        else:
            return label
