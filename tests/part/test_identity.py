"""When two refined meshes count as the same."""

from dataclasses import replace

import numpy as np

from paint_deposition.part.surface import Surface

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], dtype=float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def test_the_same_mesh_has_the_same_name():
    one, other = (Surface.from_triangles(CORNERS, FACES, 0.2) for _ in range(2))
    assert one.mesh_id == other.mesh_id
    assert len(one.mesh_id) == 16


def test_another_refinement_place_or_winding_is_another_mesh():
    part = Surface.from_triangles(CORNERS, FACES, 0.2)
    others = [
        Surface.from_triangles(CORNERS, FACES, 0.1),
        Surface.from_triangles(CORNERS + 1e-9, FACES, 0.2),
        replace(part, faces=part.faces[:, ::-1]),
    ]
    assert len({surface.mesh_id for surface in (part, *others)}) == 4
