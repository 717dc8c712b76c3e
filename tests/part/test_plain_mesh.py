"""What is compiled for meshes gives what plain NumPy does: the same order, the same bits."""

import numpy as np
import pytest
from tests import plain_mesh
from tests.surfaces import solid, triangulated
from trimesh.creation import box, icosphere

from paint_deposition.part.normals import surface_normals
from paint_deposition.part.welding import weld


def _sheet():
    return triangulated(lambda x, z: 0.3 * x**2 + 0.7 * np.abs(z), 0.02, jitter=0.3)


def _with_faults():
    """A sheet with a fin on one edge, triangles wound the other way, and holes."""
    vertices, faces = _sheet()
    faces = np.delete(faces, slice(40, 60), axis=0)
    faces[::9] = faces[::9, ::-1]
    fin = np.array([[faces[0, 0], faces[0, 1], len(vertices)]])
    return np.concatenate([vertices, [[0.0, -0.1, 0.0]]]), np.concatenate([faces, fin])


def _of(body):
    return np.array(body.vertices), np.array(body.faces)


MESHES = {
    'sheet': _sheet,
    'sheet with faults': _with_faults,
    'plate': lambda: solid(*_sheet(), 0.01),
    'box': lambda: _of(box((0.4, 0.3, 0.02))),
    'ball': lambda: _of(icosphere(3, 0.3)),
    'one triangle': lambda: (np.eye(3), np.array([[0, 1, 2]])),
}


@pytest.fixture(params=list(MESHES))
def mesh(request):
    vertices, faces = MESHES[request.param]()
    return vertices, np.asarray(faces, dtype=np.int64)


def test_normals_agree_to_rounding(mesh):
    vertices, faces = mesh
    fitted = surface_normals(vertices, faces)
    assert np.abs(fitted - plain_mesh.surface_normals(*mesh)).max() < 1e-10
    if len(vertices) > 2000:
        return
    # Large enough for several threads: each vertex is the work of one.
    copies = 2 + 4096 // len(vertices)
    many = np.concatenate([faces + k * len(vertices) for k in range(copies)])
    repeated = surface_normals(np.tile(vertices, (copies, 1)), many)
    assert np.array_equal(repeated, np.tile(fitted, (copies, 1)))


@pytest.mark.parametrize('off_m', [0.0, 3e-7, 9e-7, 2e-6])
@pytest.mark.parametrize('place_m', [0.0, 1.0, -40.0])
def test_the_same_vertices_are_welded(mesh, off_m, place_m):
    vertices, faces = mesh
    corners = vertices[faces].reshape(-1, 3) + place_m
    corners += np.random.default_rng(5).uniform(-off_m, off_m, corners.shape)
    apart = np.arange(len(corners)).reshape(-1, 3)
    for one, other in zip(weld(corners, apart), plain_mesh.welded(corners, apart), strict=True):
        assert np.array_equal(one, other)
