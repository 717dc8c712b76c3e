"""Whether a gun looks at the outward side of the part."""

from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface

MAX_POSES = 2000


@dataclass(frozen=True)
class Facing:
    """What the axis of the gun meets first, in poses.

    Attributes:
        front: poses that look at the outward side.
        back: poses that look at the other side.
        past: poses whose axis misses the part.
    """

    front: int
    back: int
    past: int

    @property
    def reversed(self) -> bool:
        """Whether most poses that look at the part look at its back."""
        return self.back > self.front


def facing(surface: Surface, positions_m: np.ndarray, z_axes: np.ndarray) -> Facing:
    """Count what the gun looks at.

    Args:
        positions_m: (N, 3) TCP [m]; long recordings are thinned to MAX_POSES.
        z_axes: (N, 3) tool z, from the bell to the surface.
    """
    some = slice(None, None, max(1, len(positions_m) // MAX_POSES))
    positions_m, z_axes = np.asarray(positions_m)[some], np.asarray(z_axes)[some]
    face = surface.occluder.first_faces(positions_m, z_axes)
    met = face >= 0
    normals = face_normals(surface.vertices_m, surface.faces[face[met]])
    front = int(np.sum(np.einsum('ij,ij->i', normals, z_axes[met]) < 0.0))
    return Facing(front, int(met.sum()) - front, int(np.sum(~met)))


def toward_the_gun(surface: Surface, positions_m: np.ndarray, z_axes: np.ndarray) -> Surface:
    """Turn a part round that is sprayed from behind, with a note: it would stay bare.

    Which side of an open skin is outward depends on the program that exported it; the gun knows.

    Args:
        surface, positions_m, z_axes: as for ``facing``.

    Returns:
        The surface, turned and with a note if most poses that look at it look at its back.
    """
    seen = facing(surface, positions_m, z_axes)
    if not seen.reversed:
        return surface
    note = (
        f'{seen.back} of {seen.back + seen.front} poses look at the back of the mesh: its '
        'triangles were turned round'
    )
    return replace(
        surface,
        faces=np.ascontiguousarray(surface.faces[:, ::-1]),
        normals=-surface.normals,
        notes=(*surface.notes, note),
    )
