"""The part's surface as a taught path sees it: a smooth height over a plane before the part."""

import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import binary_closing, distance_transform_edt, gaussian_filter

from paint_deposition.errors import PlanError
from paint_deposition.part.points import across_axis, downhill_axis
from paint_deposition.part.surface import Surface


def pass_axes(
    surface: Surface, direction: str = 'horizontal', outward: ArrayLike | None = None
) -> np.ndarray:
    """(3, 3) unit vectors along which passes are laid, a row each: travel, across and outward.

    Horizontal passes run to the right as the gun sees it, vertical ones down; ``across`` lies to
    the right of that. ``outward`` leads from the part to the gun, any length; default: the mean
    normal.

    Raises:
        PlanError: the part has no side to paint from.
    """
    if outward is None:
        outward = surface.vertex_areas_m2 @ surface.normals
        # Mean normals shorter than this share have no side: a closed body.
        if np.linalg.norm(outward) < 0.2 * surface.area_m2:
            raise PlanError(
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
    """

    def __init__(self, surface: Surface, axes: np.ndarray, radius_m: float) -> None:
        self.axes, self.radius_m, self.origin_m = axes, radius_m, surface.centre_m
        self.painted = painted_side(surface, axes[2])
        if not self.painted.any():
            raise PlanError(
                f'no surface faces the gun at {" ".join(f"{one:.2g}" for one in axes[2])} '
                'from the part; give another direction to it (outward)'
            )
        self.surface_m = (surface.vertices_m[self.painted] - self.origin_m) @ axes.T
        facing = surface.normals @ axes[2]
        weight = surface.vertex_areas_m2[self.painted] * facing[self.painted]
        cell = min(max(radius_m / 5.0, 0.004), 0.02)
        cell = max(cell, surface.longest_edge_m)
        margin = 3.0 * radius_m + 2.0 * cell
        low = self.surface_m[:, :2].min(axis=0) - margin
        high = self.surface_m[:, :2].max(axis=0) + margin
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

    @cached_property
    def extent_m(self) -> np.ndarray:
        """(2, 2) least and greatest coordinate along travel and across [m]."""
        return np.stack(
            [self.surface_m[:, :2].min(axis=0), self.surface_m[:, :2].max(axis=0)], axis=1
        )

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
