"""Zones of a part, each with the film wanted there and what it may differ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paint_deposition.errors import PaintError
from paint_deposition.part.face_tree import FaceTree, Location, locate
from paint_deposition.part.points import box_words
from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface

# A point belongs to triangles that it lies over: so little beside them and, since a refined
# surface bulges from flat triangles, so far above or below [m]; normals agree to 45 degrees.
BESIDE_M, ABOVE_M, AGREE = 1e-3, 5e-3, 0.7
NONE = -1


@dataclass(frozen=True)
class Patch:
    """Triangles, and what lies over them."""

    corners_m: np.ndarray  # (F, 3, 3) [m]

    @cached_property
    def box_m(self) -> np.ndarray:
        """(2, 3) lowest and highest corner of a box around it [m]."""
        return np.stack([self.corners_m.min(axis=(0, 1)), self.corners_m.max(axis=(0, 1))])

    def holds(self, positions_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,) bool, which points (N, 3) [m] with outward unit normals (N, 3) lie over it."""
        near, over, place = self._over(positions_m, normals)
        held = np.zeros(len(positions_m), dtype=bool)
        held[near] = over & (np.cos(place.angle_rad) >= AGREE)
        return held

    def facing(self, surface: Surface) -> Patch:
        """The patch wound outward: most of the surface over its triangles says which way."""
        near, over, place = self._over(surface.vertices_m, None)
        cosine = np.einsum('ij,ij->i', place.normals, surface.normals[near])
        area = surface.vertex_areas_m2[near] * (over & (np.abs(cosine) >= AGREE))
        return Patch(self.corners_m[:, ::-1]) if area @ np.sign(cosine) < 0.0 else self

    def _over(
        self, positions_m: np.ndarray, normals: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, Location]:
        """Rows (n,) of points near the triangles, which of them lie over one (n,), and where."""
        low, high = self.box_m
        inside = (positions_m >= low - ABOVE_M) & (positions_m <= high + ABOVE_M)
        near = np.flatnonzero(inside.all(axis=1))
        wanted = None if normals is None else normals[near]
        place = locate(*self._tree, positions_m[near], wanted, least_cosine=AGREE)
        above = np.einsum('ij,ij->i', positions_m[near] - place.positions_m, place.normals)
        beside2 = np.maximum(place.distance_m**2 - above**2, 0.0)
        return near, (np.abs(above) <= ABOVE_M) & (beside2 <= BESIDE_M**2), place

    @cached_property
    def _tree(self) -> tuple[FaceTree, np.ndarray]:
        """The triangles, each with corners and a normal of its own."""
        corners = self.corners_m.reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        return FaceTree.of(corners, faces), np.repeat(face_normals(corners, faces), 3, axis=0)


@dataclass(frozen=True)
class Zone:
    """Part of a part's surface, in a box, over a patch, or both; and the film wanted there."""

    name: str
    target_um: float  # film wanted [um]
    tolerance_um: float  # what it may differ either way [um]
    box_m: np.ndarray | None = None  # (2, 3) lowest and highest corner, as the mesh has them [m]
    patch: Patch | None = None

    def holds(self, positions_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,) bool, which points (N, 3) [m] with outward unit normals (N, 3) lie in it."""
        held = np.ones(len(positions_m), dtype=bool)
        if self.box_m is not None:
            low, high = self.box_m
            held = np.all((positions_m >= low) & (positions_m <= high), axis=1)
        return held & self.patch.holds(positions_m, normals) if self.patch else held


@dataclass(frozen=True)
class Zones:
    """Zones of a part; the first that holds a point has it."""

    zones: tuple[Zone, ...]

    def __repr__(self) -> str:
        return f'Zones({", ".join(zone.name for zone in self.zones)})'

    def of(self, positions_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,) number of the zone of points (N, 3) [m] with unit normals (N, 3); -1: none."""
        number = np.full(len(positions_m), NONE)
        for k in reversed(range(len(self.zones))):
            number[self.zones[k].holds(positions_m, normals)] = k
        return number

    def on(self, surface: Surface) -> PointZones:
        """The zone of each vertex of a part.

        Raises:
            PaintError: a zone has no vertex of the part; says why, and the remedy.
        """
        facing = [
            replace(zone, patch=zone.patch and zone.patch.facing(surface)) for zone in self.zones
        ]
        zones = Zones(tuple(facing))
        found = PointZones(zones, zones.of(surface.vertices_m, surface.normals))
        for k, zone in enumerate(zones.zones):
            if np.any(found.number == k):
                continue
            inside = zone.holds(surface.vertices_m, surface.normals)
            if inside.any():
                names = ', '.join(one.name for one in zones.zones[:k])
                raise PaintError(
                    f"zone '{zone.name}': all {inside.sum()} vertices of the part in it belong to "
                    f'zones before it ({names}); put it before them'
                )
            places_m = [zone.box_m, zone.patch.box_m if zone.patch else None]
            boxes = ' and '.join(box_words(corners) for corners in places_m if corners is not None)
            raise PaintError(
                f"zone '{zone.name}' holds no vertex of the part: it lies within {boxes}, the "
                f'part within {box_words(surface.vertices_m)}; give it in the frame and unit of '
                'the mesh, or refine the mesh for a small zone'
            )
        return found


@dataclass(frozen=True)
class PointZones:
    """The zone of each of N points on a part."""

    zones: Zones
    number: np.ndarray  # (N,) of the zone, -1: none

    def __iter__(self) -> Iterator[tuple[Zone, np.ndarray]]:
        """Each zone that has points, and which (N,) bool these are."""
        for k, zone in enumerate(self.zones.zones):
            if (own := self.number == k).any():
                yield zone, own

    def select(self, rows: np.ndarray) -> PointZones:
        """The zones of some of the points."""
        return replace(self, number=self.number[rows])

    def at(self, positions_m: np.ndarray, normals: np.ndarray) -> PointZones:
        """The zones of points (N, 3) [m] of the same part, with outward unit normals (N, 3)."""
        return replace(self, number=self.zones.of(positions_m, normals))

    @property
    def names(self) -> np.ndarray:
        """(N,) of the zones, '' in none."""
        return np.array([*(zone.name for zone in self.zones.zones), ''])[self.number]

    def wanted_um(
        self, target_um: float | None = None, tolerance_um: float | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Target and tolerance (N,) [um], in no zone as given; NaN where nothing is wanted."""
        zones = self.zones.zones
        targets = np.array([*(zone.target_um for zone in zones), target_um or np.nan])
        tolerances = np.array([*(zone.tolerance_um for zone in zones), tolerance_um or 0.0])
        return targets[self.number], tolerances[self.number]
