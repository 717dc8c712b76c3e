"""Whether a gun looks at the outward side of the part."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from paint_deposition.part.orientation import CANCELLED, ONE_SIDED, mean_normal
from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface


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
            return _settled(surface, front, back, axes)
    return surface


def toward_the_gun(surface: Surface, positions_m: np.ndarray, z_axes: np.ndarray) -> Surface:
    """Turn a part as ``toward_the_guns`` does, for one gun."""
    return toward_the_guns(surface, [(positions_m, z_axes)])


def turned(surface: Surface) -> Surface:
    """The part with its other side outward."""
    return replace(
        surface,
        faces=np.ascontiguousarray(surface.faces[:, ::-1]),
        normals=-surface.normals,
        curved_edges=surface.curved_edges.turned(),
    )


def _settled(surface: Surface, front: int, back: int, axes: np.ndarray) -> Surface:
    """The part with the side outward that these poses look at."""
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
    known = surface.seen_from(gun_side)
    settled = surface.gun_side is not None and np.array_equal(known.outward, surface.outward)
    return surface if settled else known


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
