"""The part's surface as a refined triangle mesh: where points lie on it, which side guns see."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from paint_deposition.kernel.blocks import (
    box_centre_m,
    neighbours_together,
    shared_among_threads,
)
from paint_deposition.part import creases, derivatives
from paint_deposition.part.creases import CURVED_EDGE
from paint_deposition.part.edges import (
    edge_distance_m,
    half_edges_m,
    matched_half_edges,
    without_seams,
)
from paint_deposition.part.face_tree import FaceTree, first_hits, locate
from paint_deposition.part.points import (
    CANCELLED,
    ONE_SIDED,
    SurfacePoints,
    gravity,
    heights,
    mean_normal,
    outward_side,
)
from paint_deposition.part.refinement import edge_lengths_m, face_areas_m2, face_normals, refine
from paint_deposition.part.visibility import Obstacle, sky_view_factor


@dataclass(frozen=True)
class Surface:
    """A part's surface; its outward side, where paint lands, is the one its triangles turn out.

    Attributes:
        vertices_m: (V, 3) [m]; along creases and rims of the same place several times, once for
            each smooth patch.
        faces: (F, 3) int, right-handed about the outward normal.
        normals: (V, 3) outward unit normals of the curved surface.
        vertex_areas_m2: (V,) a third of the adjoining triangles [m^2]; sums to the surface's area.
        down: (3,) unit vector of gravity in the mesh frame.
        rim_m: (B, 2, 3) segments of the free edges [m].
        notes: what had to be put right in the file, for the user to read.
        gun_side: (3,) mean direction from the part to the gun, or None; it shows the painted
            side of a part whose surface has several, a closed body.
        in_hem: (V,) bool, vertices on the narrow strips of a hem or rim; None: there are none.
        curved_edges: (E,) CURVED_EDGE, where the mesh as read is coarser than its curvature.
        neighbours: (V,) vertices in the order in which they are painted, see
            ``kernel.blocks.neighbours_together``; None: they are sorted when they are.
    """

    vertices_m: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    vertex_areas_m2: np.ndarray
    down: np.ndarray
    rim_m: np.ndarray = field(default_factory=lambda: np.empty((0, 2, 3)))
    notes: tuple[str, ...] = ()
    gun_side: np.ndarray | None = None
    in_hem: np.ndarray | None = None
    curved_edges: np.ndarray = field(default_factory=lambda: np.empty(0, CURVED_EDGE))
    neighbours: np.ndarray | None = None

    def __repr__(self) -> str:
        return f'Surface({len(self.vertices_m)} vertices, {self.area_m2:.2f} m²)'

    def __getstate__(self) -> dict[str, Any]:
        """What is kept of rays and searches stays behind: it can be made again."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    @staticmethod
    def from_triangles(
        vertices_m: np.ndarray,
        faces: np.ndarray,
        max_edge_length_m: float,
        down: np.ndarray | None = None,
        notes: tuple[str, ...] = (),
    ) -> 'Surface':
        """Refine clean triangles: finite, welded, consistently wound, none without area.

        Args:
            vertices_m: (V, 3) [m].
            faces: (F, 3), right-handed about the outward normal.
            max_edge_length_m: longest edge after refinement [m].
            down: gravity in the mesh frame, any length; default as ``gravity`` guesses.
            notes: kept with the surface.

        Raises:
            MeshError: refinement would give too many triangles.
        """
        vertices_m = np.ascontiguousarray(vertices_m, dtype=np.float64)
        faces = np.ascontiguousarray(faces, dtype=np.int64)
        paired, clashing, single = matched_half_edges(faces)
        folds = creases.folds_rad(vertices_m, faces, face_normals(vertices_m, faces), paired)
        rim = creases.rim_folds(vertices_m, faces, paired, folds)
        smooth = (np.abs(folds) <= creases.CREASE_RAD) & ~rim
        origin, patches = creases.split_at_creases(faces, paired[smooth])
        # Where the surface ends, and where it folds back.
        single_m = half_edges_m(vertices_m, faces, single)
        folded_m = half_edges_m(vertices_m, faces, paired[rim, 0])
        rim_m = np.concatenate([without_seams(single_m), folded_m])
        corners = vertices_m[origin]
        read_normals = derivatives.surface_normals(corners, patches)
        unjoined = paired[~smooth, 1], clashing.ravel(), single
        hem = paired[rim].ravel()
        half_edges = np.concatenate([paired[:, 0], *unjoined])
        curved_edges = creases.curved_edges(corners, read_normals, patches, half_edges)
        del paired, folds, half_edges, unjoined  # large ones, before the next are made
        vertices, normals, fine = refine(corners, read_normals, patches, max_edge_length_m)
        areas = np.repeat(face_areas_m2(vertices, fine) / 3.0, 3)
        vertex_areas = np.bincount(fine.ravel(), areas, minlength=len(vertices))
        if down is None:
            down, guess = gravity(vertices, normals, vertex_areas)
            notes = (*notes, guess) if guess else notes
        down = np.asarray(down, dtype=np.float64)
        return Surface(
            vertices, fine, normals, vertex_areas, down / np.linalg.norm(down), rim_m, notes,
            in_hem=creases.strip_vertices(corners, patches, hem, fine, len(vertices)),
            curved_edges=curved_edges, neighbours=neighbours_together(vertices),
        )  # fmt: skip

    @cached_property
    def mesh_id(self) -> str:
        """Digest of the refined mesh: the same for the same vertices and faces in one order."""
        content = self.vertices_m.astype('<f8').tobytes() + self.faces.astype('<i8').tobytes()
        return hashlib.sha256(content).hexdigest()[:16]

    @property
    def area_m2(self) -> float:
        """Area of the surface [m^2]."""
        return float(self.vertex_areas_m2.sum())

    @cached_property
    def outward(self) -> np.ndarray:
        """(3,) mean outward unit normal of the side that is painted."""
        return outward_side(self.normals, self.vertex_areas_m2, self.down, self.gun_side)

    @cached_property
    def centre_m(self) -> np.ndarray:
        """(3,) centre of the bounding box [m]."""
        return box_centre_m(self.vertices_m)

    @cached_property
    def tree(self) -> FaceTree:
        """The triangles, sorted for rays and searches."""
        return FaceTree.of(self.vertices_m, self.faces)

    @cached_property
    def obstacle(self) -> Obstacle:
        """The part as an obstacle to rays; Embree takes a second for a million triangles."""
        # It works in single precision: coordinates are kept small.
        scene, corners = EmbreeScene(robust=True), (self.vertices_m - self.centre_m).astype('f4')
        return scene, self.centre_m, TriangleMesh(scene, corners, self.tree.faces.astype('i4'))

    def first_faces(self, starts_m: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(N,) the triangle that each ray meets first, from either side, -1 for none."""
        tree, met = self.tree, np.empty(len(starts_m), dtype=np.int64)
        starts = np.ascontiguousarray(starts_m, dtype=np.float64)
        ways = np.ascontiguousarray(directions, dtype=np.float64)

        fill = partial(first_hits, starts, ways, tree.vertices_m, tree.faces, tree.nodes, met)
        shared_among_threads(len(starts), fill)
        return np.where(met >= 0, tree.order[met], -1)

    def points(self) -> SurfacePoints:
        """The vertices, with their areas; covariates are computed when used."""
        return SurfacePoints(
            self.vertices_m,
            self.normals,
            area_m2=self.vertex_areas_m2,
            neighbours=self.neighbours,
            slope_per_m=lambda: derivatives.slope_operator(
                self.vertices_m, self.faces, self.normals, self.down
            ),
            **self._covariates(self.vertices_m, self.normals),
        )

    def locate(
        self, points_m: np.ndarray, normals: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The closest places on the surface.

        Args:
            points_m: (N, 3) [m].
            normals: (N, 3) outward, any length; between two sides of a thin part the one that
                agrees is taken. Without them it is the one that the gun paints, if only one is.

        Returns:
            (N, 3) the places [m], (N, 3) outward unit normals of the surface there, and (N,) the
            distance of each point from its place [m].
        """
        # A gun whose mean direction is shorter has turned to more sides of the part than one.
        one_side = self.gun_side is not None and np.linalg.norm(self.gun_side) >= 0.9
        side = self.outward if one_side else None
        return locate(self.tree, self.normals, points_m, normals, side)

    def at(
        self,
        points_m: np.ndarray,
        normals: np.ndarray | None = None,
        stencil_m: float | None = None,
    ) -> SurfacePoints:
        """The surface at points near it, gauge readings for instance.

        Args:
            points_m, normals: as in ``locate``; each is moved to the closest place.
            stencil_m: if given, the N points are followed by N neighbours this far up the surface
                and N this far down, and the slope is defined on the first N.
        """
        positions, outward, _ = self.locate(points_m, normals)
        operator = None
        if stencil_m is not None and len(positions):
            way = derivatives.downhill(outward, self.down)
            unit = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
            above_m, above_normals, _ = self.locate(positions - stencil_m * unit, outward)
            below_m, below_normals, _ = self.locate(positions + stencil_m * unit, outward)
            operator = derivatives.slope_at_stencil(positions, above_m, below_m, way)
            positions = np.concatenate([positions, above_m, below_m])
            outward = np.concatenate([outward, above_normals, below_normals])
        return SurfacePoints(
            positions, outward, slope_per_m=operator, **self._covariates(positions, outward)
        )

    def _covariates(self, positions_m: np.ndarray, normals: np.ndarray) -> dict[str, Any]:
        return {
            'down': self.down,
            'outward': self.outward,
            'centre_m': self.centre_m,
            'extent_m': np.ptp(self.vertices_m, axis=0),
            'curvature_per_m': lambda: self._curvature_per_m(positions_m, normals),
            'edge_distance_m': lambda: edge_distance_m(positions_m, self.rim_m),
            'sky_view_factor': lambda: sky_view_factor(
                self.tree, self.obstacle, positions_m, normals
            ),
            'height_fraction': lambda: heights(positions_m, self.vertices_m, self.down),
        }

    @cached_property
    def longest_edge_m(self) -> float:
        """Longest edge after refinement [m]."""
        return float(edge_lengths_m(self.vertices_m, self.faces).max())

    def _curvature_per_m(self, positions_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        centre_normals = self.normals[self.faces].sum(axis=1)
        centre_normals /= np.linalg.norm(centre_normals, axis=1, keepdims=True)
        vertex_areas, areas = self.vertex_areas_m2, face_areas_m2(self.vertices_m, self.faces)
        if self.in_hem is not None:
            vertex_areas = vertex_areas * ~self.in_hem
            areas = areas * ~self.in_hem[self.faces[:, 0]]
        return derivatives.curvature_per_m(
            positions_m,
            normals,
            np.concatenate([self.vertices_m, self.vertices_m[self.faces].mean(axis=1)]),
            np.concatenate([self.normals, centre_normals]),
            np.concatenate([vertex_areas, areas]),
            max(derivatives.RADIUS_M, self.longest_edge_m),
        )


def toward_the_guns(surface: Surface, motions: Iterable[tuple[np.ndarray, np.ndarray]]) -> Surface:
    """Turn a part round that is sprayed from behind, and give a closed one its outward side.

    Which side of an open surface is outward depends on the program that exported it, and a closed
    body has a surface on every side; the first gun, (positions_m, z_axes), whose axis meets the
    part decides. The surface itself is returned if it faces the gun; turned and with a note, since
    it would stay bare, if most poses that look at it look at its back.
    """
    for positions_m, z_axes in motions:
        front, back, axes = facing(surface, positions_m, z_axes)
        if len(axes):
            break
    else:
        return surface
    if back > front:
        note = (
            f'{back} of {back + front} poses look at the back of the mesh: its '
            'triangles were turned round'
        )
        surface = replace(turned(surface), notes=(*surface.notes, note))
    mean = mean_normal(surface.normals, surface.vertex_areas_m2)
    if np.linalg.norm(mean) >= ONE_SIDED:  # it has one outward side by itself, as an open sheet
        return surface
    gun_side = -axes.mean(axis=0)
    if np.linalg.norm(gun_side) < CANCELLED:
        return surface
    known = replace(surface, gun_side=gun_side)
    # What rays and searches need is shared.
    made = vars(surface).items()
    vars(known).update({key: value for key, value in made if key in ('tree', 'obstacle')})
    settled = surface.gun_side is not None and np.array_equal(known.outward, surface.outward)
    return surface if settled else known


def turned(surface: Surface) -> Surface:
    """The part with its other side outward."""
    edges = surface.curved_edges.copy()
    for name in ('normal', 'curved_normal'):
        edges[name] *= -1.0
    return replace(
        surface,
        faces=np.ascontiguousarray(surface.faces[:, ::-1]),
        normals=-surface.normals,
        curved_edges=edges,
    )


def facing(
    surface: Surface, positions_m: np.ndarray, z_axes: np.ndarray
) -> tuple[int, int, np.ndarray]:
    """What the gun looks at from TCPs (N, 3) [m] along its axis, tool z (N, 3).

    Returned are how many poses look at the outward side and how many at the other, and tool z
    (M, 3) of both.
    """
    some = slice(None, None, max(1, len(positions_m) // 2000))  # 2000 poses tell it
    positions_m, z_axes = np.asarray(positions_m)[some], np.asarray(z_axes)[some]
    face = surface.first_faces(positions_m, z_axes)
    met = face >= 0
    normals = face_normals(surface.vertices_m, surface.faces[face[met]])
    front = int(np.sum(np.einsum('ij,ij->i', normals, z_axes[met]) < 0.0))
    return front, len(normals) - front, z_axes[met]
