"""The sides of a part: each as a smooth height over a plane before it, and the faces of a part."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import binary_closing, distance_transform_edt, gaussian_filter

from paint_deposition.errors import PaintError
from paint_deposition.part.edges import (
    connected,
    edge_distance_m,
    edges_of,
    half_edges_by_edge,
    half_edges_m,
)
from paint_deposition.part.points import across_axis, downhill_axis
from paint_deposition.part.refinement import face_areas_m2, face_normals
from paint_deposition.part.surface import Surface


def pass_axes(
    surface: Surface, direction: str = 'horizontal', outward: ArrayLike | None = None
) -> np.ndarray:
    """(3, 3) unit vectors along which passes are laid, a row each: travel, across and outward.

    Horizontal passes run to the right as the gun sees it, vertical ones down; ``across`` lies to
    the right of that. ``outward`` leads from the part to the gun, any length; default: the mean
    normal.

    Raises:
        PaintError: the part has no side to paint from.
    """
    if outward is None:
        outward = surface.vertex_areas_m2 @ surface.normals
        # Mean normals shorter than this share have no side: a closed body.
        if np.linalg.norm(outward) < 0.2 * surface.area_m2:
            raise PaintError(
                'the part is closed, it has no side to paint from; say where the gun stands '
                '(outward)'
            )
    side = np.asarray(outward, dtype=float)
    side = side / np.linalg.norm(side)
    toward = across_axis if direction == 'horizontal' else downhill_axis
    travel = toward(side, surface.down)
    return np.stack([travel, np.cross(-side, travel), side])


class SurfaceMap:
    """Smoothed height and slope of the painted side over (travel, across).

    The axes are those of ``pass_axes``, from the middle of the part. About each place a plane is
    fitted to the surface with Gaussian weights of half the radius [m].
    Past the part's edges height and slope go over to what they are at the edge.

    Attributes:
        painted: (V,) bool, vertices of the painted side.
        extent_m: (2, 2) least and greatest coordinate along travel and across [m].
    """

    def __init__(self, surface: Surface, axes: np.ndarray, radius_m: float) -> None:
        self.axes, self.radius_m, self.origin_m = axes, radius_m, surface.centre_m
        self.painted = painted_side(surface, axes[2])
        if not self.painted.any():
            raise PaintError(
                f'no surface faces the gun at {" ".join(f"{one:.2g}" for one in axes[2])} '
                'from the part; give another direction to it (outward)'
            )
        self.surface_m = (surface.vertices_m[self.painted] - self.origin_m) @ axes.T
        facing = surface.normals @ axes[2]
        weight = surface.vertex_areas_m2[self.painted] * facing[self.painted]
        cell = min(max(radius_m / 5.0, 0.004), 0.02)
        cell = max(cell, surface.longest_edge_m)
        margin = 3.0 * radius_m + 2.0 * cell
        least, most = self.surface_m[:, :2].min(axis=0), self.surface_m[:, :2].max(axis=0)
        self.extent_m = np.stack([least, most], axis=1)
        low, high = least - margin, most + margin
        cell = max(cell, math.sqrt(float(np.prod(high - low)) / 1_000_000))
        count = np.ceil((high - low) / cell).astype(int) + 1
        self._lines = [low[k] + cell * np.arange(count[k]) for k in range(2)]
        self._cell_m = cell
        # Outside their grid splines keep the values of its border.
        self._splines = [
            RectBivariateSpline(*self._lines, field) for field in self._smoothed(weight)
        ]

    def height_m(self, travel_m: np.ndarray, across_m: np.ndarray) -> np.ndarray:
        """(N,) smoothed coordinate along outward [m]."""
        return self._splines[0].ev(travel_m, across_m)

    def normals(self, travel_m: np.ndarray, across_m: np.ndarray) -> np.ndarray:
        """(N, 3) unit normals of the smoothed surface, in the part's frame."""
        slopes = [spline.ev(travel_m, across_m) for spline in self._splines[1:]]
        normals = np.stack([-slopes[0], -slopes[1], np.ones(len(slopes[0]))], axis=1)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True) @ self.axes

    def places_m(self, travel_m: np.ndarray, across_m: np.ndarray) -> np.ndarray:
        """(N, 3) places on the smoothed surface, in the part's frame [m]."""
        height_m = self.height_m(travel_m, across_m)
        return self.origin_m + np.stack([travel_m, across_m, height_m], axis=1) @ self.axes

    def extent_near_m(self, across_m: float, band_m: float) -> tuple[float, float]:
        """Ends along travel of the surface in a band about a line; of the nearest if none is."""
        distance = np.abs(self.surface_m[:, 1] - across_m)
        near = self.surface_m[distance <= max(band_m, distance.min() + self._cell_m), 0]
        return float(near.min()), float(near.max())

    def _smoothed(self, weight: np.ndarray) -> list[np.ndarray]:
        """Height and both slopes on the grid, by planes fitted with Gaussian weights."""
        shape = tuple(len(line) for line in self._lines)
        origin = np.array([line[0] for line in self._lines])
        at = np.rint((self.surface_m[:, :2] - origin) / self._cell_m).astype(int)
        cells = np.ravel_multi_index((at[:, 0], at[:, 1]), shape)
        u, v, z = self.surface_m.T
        deviation = 0.5 * self.radius_m / self._cell_m

        def moment(values: np.ndarray) -> np.ndarray:
            binned = np.bincount(cells, weight * values, minlength=math.prod(shape))
            return gaussian_filter(binned.reshape(shape), deviation, mode='constant', truncate=4.0)

        total = np.maximum(moment(np.ones(len(u))), 1e-300)
        mean_u, mean_v, mean_z = (moment(values) / total for values in (u, v, z))
        # A bit of the kernel's own spread keeps slopes finite where hardly any surface is near.
        ridge = 1e-3 * self.radius_m**2
        uu = moment(u * u) / total - mean_u**2 + ridge
        vv = moment(v * v) / total - mean_v**2 + ridge
        uv = moment(u * v) / total - mean_u * mean_v
        uz = moment(u * z) / total - mean_u * mean_z
        vz = moment(v * z) / total - mean_v * mean_z
        determinant = uu * vv - uv**2
        slope_u = (uz * vv - vz * uv) / determinant
        slope_v = (vz * uu - uz * uv) / determinant
        grid_u, grid_v = np.meshgrid(*self._lines, indexing='ij')
        height = mean_z + slope_u * (grid_u - mean_u) + slope_v * (grid_v - mean_v)
        # Outside the part a field is what it is at the nearest place inside.
        occupied = np.bincount(cells, minlength=math.prod(shape)).reshape(shape) > 0
        inside = binary_closing(occupied, iterations=3) | occupied
        nearest = distance_transform_edt(~inside, return_distances=False, return_indices=True)
        held = [field[tuple(nearest)] for field in (height, slope_u, slope_v)]
        # Well inside the fitted plane stands; at the edge it goes over to a blend with what
        # stands in for it outside.
        near = gaussian_filter(inside.astype(float), deviation, mode='nearest')
        share = np.clip(2.0 * near - 1.0, 0.0, 1.0)
        blended = [gaussian_filter(field, deviation, mode='nearest') for field in held]
        return [share * a + (1.0 - share) * b for a, b in zip(held, blended, strict=True)]


def painted_side(surface: Surface, outward: np.ndarray) -> np.ndarray:
    """(V,) bool, vertices that face a gun that is ``outward`` (3,), with nothing before them."""
    starts = surface.vertices_m + 1e-3 * outward
    directions = np.ascontiguousarray(np.broadcast_to(outward, starts.shape))
    in_front = surface.first_faces(starts, directions) < 0
    # Surface that leans further from the gun's side than this is not painted from it.
    return (surface.normals @ outward > math.cos(math.radians(75.0))) & in_front


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
    # (V,) number of the place of each vertex: along creases several vertices share one.
    rounded = np.round(surface.vertices_m / 1e-6).astype(np.int64)
    place = np.unique(rounded, axis=0, return_inverse=True)[1].ravel()
    # (N, 2) triangles that share an edge.
    half_edges, first = half_edges_by_edge(place[surface.faces])
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
    edge, found = edges_of(place[surface.faces])[1], []
    for name in names[order]:
        kept = label == name
        seam = np.flatnonzero((kept[:, None] & np.isin(edge, edge[~kept])).ravel())
        ends_m = half_edges_m(surface.vertices_m, surface.faces, seam)
        own, rows = patch(surface, kept)
        found.append(Face(own, rows, edge_distance_m(own.vertices_m, ends_m)))
    return tuple(found)


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
