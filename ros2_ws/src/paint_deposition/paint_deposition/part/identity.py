"""Whether two refined meshes are the same."""

import hashlib

from paint_deposition.part.surface import Surface


def mesh_id(surface: Surface) -> str:
    """Digest of the refined mesh: the same for the same vertices and faces in the same order."""
    digest = hashlib.sha256()
    digest.update(surface.vertices_m.astype('<f8').tobytes())
    digest.update(surface.faces.astype('<i8').tobytes())
    return digest.hexdigest()[:16]
