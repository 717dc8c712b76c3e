"""Zones of a part, each with the film wanted there and what it may differ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from paint_deposition.errors import PaintError
from paint_deposition.part.face_tree import FaceTree, locate
from paint_deposition.part.points import angles_rad, box_words
from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface

# A point belongs to triangles that it lies over: so little beside them and, since a refined
# surface bulges from flat triangles, so far above or below [m]; normals agree to 45 degrees.
BESIDE_M, ABOVE_M, AGREE = 1e-3, 5e-3, 0.7
NONE = -1


@dataclass(frozen=True)
class Zone:
    """Part of a part's surface, in a box, over triangles, or both; and the film wanted there."""

    name: str
    target_um: float  # film wanted [um]
    tolerance_um: float  # what it may differ either way [um]
    box_m: np.ndarray | None = None  # (2, 3) lowest and highest corner, as the mesh has them [m]
    triangles_m: np.ndarray | None = None  # (F, 3, 3) corners [m]

    def holds(self, positions_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,) bool, which points (N, 3) [m] with outward unit normals (N, 3) lie in it."""
        held = np.ones(len(positions_m), dtype=bool)
        if self.box_m is not None:
            low, high = self.box_m
            held = np.all((positions_m >= low) & (positions_m <= high), axis=1)
        if self.triangles_m is not None:
            near, over, outward = self._over(self.triangles_m, positions_m, normals)
            inside = np.zeros(len(positions_m), dtype=bool)
            inside[near] = over & (np.cos(angles_rad(outward, normals[near])) >= AGREE)
            held &= inside
        return held

    def facing(self, surface: Surface) -> Zone:
        """The zone, its triangles wound outward: most of the surface over them says which way."""
        if self.triangles_m is None:
            return self
        near, over, outward = self._over(self.triangles_m, surface.vertices_m, None)
        cosine = np.einsum('ij,ij->i', outward, surface.normals[near])
        area = surface.vertex_areas_m2[near] * (over & (np.abs(cosine) >= AGREE))
        if area @ np.sign(cosine) < 0.0:
            return replace(self, triangles_m=self.triangles_m[:, ::-1])
        return self

    @staticmethod
    def _over(
        triangles_m: np.ndarray, positions_m: np.ndarray, normals: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows (n,) of points near the triangles, which of them lie over one (n,), its normals."""
        corners = triangles_m.reshape(-1, 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        inside = (positions_m >= low - ABOVE_M) & (positions_m <= high + ABOVE_M)
        near = np.flatnonzero(inside.all(axis=1))
        wanted = None if normals is None else normals[near]
        # Each triangle with corners and a normal of its own.
        faces = np.arange(len(corners)).reshape(-1, 3)
        of_corners = np.repeat(face_normals(corners, faces), 3, axis=0)
        tree = FaceTree.of(corners, faces)
        place_m, outward, distance_m = locate(
            tree, of_corners, positions_m[near], wanted, least_cosine=AGREE
        )
        above = np.einsum('ij,ij->i', positions_m[near] - place_m, outward)
        beside2 = np.maximum(distance_m**2 - above**2, 0.0)
        return near, (np.abs(above) <= ABOVE_M) & (beside2 <= BESIDE_M**2), outward


@dataclass(frozen=True)
class Zones:
    """Zones of a part, and the zone of each of N points on it: the first that holds it."""

    zones: tuple[Zone, ...]
    # (N,) of the zone, -1: none; without points as long as these are not on a part.
    number: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))

    def __repr__(self) -> str:
        return f'Zones({", ".join(zone.name for zone in self.zones)})'

    def __iter__(self) -> Iterator[tuple[Zone, np.ndarray]]:
        """Each zone that has points, and which (N,) bool these are."""
        for k, zone in enumerate(self.zones):
            if (own := self.number == k).any():
                yield zone, own

    def at(self, positions_m: np.ndarray, normals: np.ndarray) -> Zones:
        """The zones of points (N, 3) [m] of the part, with outward unit normals (N, 3)."""
        number = np.full(len(positions_m), NONE)
        for k in reversed(range(len(self.zones))):
            number[self.zones[k].holds(positions_m, normals)] = k
        return replace(self, number=number)

    def on(self, surface: Surface) -> Zones:
        """The zones of the vertices of a part.

        Raises:
            PaintError: a zone has no vertex of the part; says why, and the remedy.
        """
        facing = Zones(tuple(zone.facing(surface) for zone in self.zones))
        found = facing.at(surface.vertices_m, surface.normals)
        for k, zone in enumerate(found.zones):
            if np.any(found.number == k):
                continue
            inside = zone.holds(surface.vertices_m, surface.normals)
            if inside.any():
                names = ', '.join(one.name for one in found.zones[:k])
                raise PaintError(
                    f"zone '{zone.name}': all {inside.sum()} vertices of the part in it belong to "
                    f'zones before it ({names}); put it before them'
                )
            places_m = [zone.box_m, zone.triangles_m]
            boxes = ' and '.join(
                box_words(corners.reshape(-1, 3)) for corners in places_m if corners is not None
            )
            raise PaintError(
                f"zone '{zone.name}' holds no vertex of the part: it lies within {boxes}, the "
                f'part within {box_words(surface.vertices_m)}; give it in the frame and unit of '
                'the mesh, or refine the mesh for a small zone'
            )
        return found

    def select(self, rows: np.ndarray) -> Zones:
        """The zones of some of the points."""
        return replace(self, number=self.number[rows])

    @property
    def names(self) -> np.ndarray:
        """(N,) of the zones, '' in none."""
        return np.array([*(zone.name for zone in self.zones), ''])[self.number]

    def wanted_um(
        self, target_um: float | None = None, tolerance_um: float | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Target and tolerance (N,) [um], in no zone as given; NaN where nothing is wanted."""
        targets = np.array([*(zone.target_um for zone in self.zones), target_um or np.nan])
        tolerances = np.array([*(zone.tolerance_um for zone in self.zones), tolerance_um or 0.0])
        return targets[self.number], tolerances[self.number]
