"""Part meshes as people have them: good, odd and broken."""

import numpy as np
import pytest
import trimesh
from trimesh.creation import box, icosphere

from paint_deposition.errors import MeshError
from paint_deposition.files.meshes import read_mesh, write_mesh_ply
from surfaces import triangulated


def sheet(size_m=0.4) -> trimesh.Trimesh:
    """Two triangles facing -y."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1.0]]) * size_m
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def saved(mesh: trimesh.Trimesh, path, **options):
    mesh.export(path, **options)
    return path


@pytest.mark.parametrize(
    ('name', 'options'),
    [
        ('part.stl', {'file_type': 'stl_ascii'}), ('PART.STL', {'file_type': 'stl'}),
        ('part.ply', {'encoding': 'ascii'}), ('part.obj', {}),
    ],
)  # fmt: skip
def test_formats_give_the_same_part(tmp_path, name, options):
    ball = icosphere(subdivisions=3, radius=0.2)
    surface = read_mesh(saved(ball, tmp_path / name, **options))
    assert surface.area_m2 == pytest.approx(ball.area, rel=1e-5)
    assert len(surface.vertices_m) == len(np.unique(surface.vertices_m.round(6), axis=0))
    outward = np.einsum('ij,ij->i', surface.normals, surface.vertices_m) / 0.2
    np.testing.assert_allclose(outward, 1.0, atol=0.01)
    assert surface.notes == ()


def test_an_open_surface_faces_as_it_is_wound(tmp_path):
    mesh = sheet()
    front = read_mesh(saved(mesh, tmp_path / 'front.stl'))
    mesh.invert()
    back = read_mesh(saved(mesh, tmp_path / 'back.stl'))
    np.testing.assert_allclose(front.normals[0], [0, -1, 0])
    np.testing.assert_allclose(back.normals[0], [0, 1, 0])


def test_a_body_inside_out_is_turned_round(tmp_path):
    body = box((0.3, 0.2, 0.1))
    body.invert()
    surface = read_mesh(saved(body, tmp_path / 'body.stl'))
    assert (np.einsum('ij,ij->i', surface.normals, surface.vertices_m) > 0).all()
    assert surface.notes == ('the closed body was inside out and was turned round',)


@pytest.mark.parametrize('turned', [[0], list(range(500, 512))])
def test_triangles_wound_against_the_rest_are_turned(tmp_path, turned):
    vertices, faces = triangulated(lambda x, z: x**2, 0.02)
    faces[turned] = faces[turned, ::-1]
    path = saved(trimesh.Trimesh(vertices, faces, process=False), tmp_path / 'part.stl')
    surface = read_mesh(path)
    assert (surface.normals[:, 1] < 0).all()
    assert surface.notes == (
        f'{len(turned)} triangles wound against their neighbours were turned round',
    )


def test_triangles_without_area_are_left_out_with_a_note(tmp_path):
    mesh = sheet()
    faces = [[0, 1, 2], [0, 2, 3], [0, 0, 1], [1, 1, 1]]
    path = saved(trimesh.Trimesh(mesh.vertices, faces, process=False), tmp_path / 'part.stl')
    surface = read_mesh(path)
    assert surface.area_m2 == pytest.approx(0.16)
    assert surface.notes == ('2 of 4 triangles without area were left out',)


def test_text_in_any_encoding_is_read(tmp_path):
    text = sheet().export(file_type='stl_ascii').replace('solid', 'solid Türhaut')
    path = tmp_path / 'part.stl'
    path.write_bytes(text.encode('latin-1'))
    assert read_mesh(path).area_m2 == pytest.approx(0.16)


def broken(path, kind):
    """Write a file that is no part."""
    corners = sheet().vertices.copy()
    faces = [[0, 1, 1], [2, 2, 3]] if kind == 'no area' else sheet().faces
    if kind == 'not finite':
        corners[2, 1] = np.nan
    if kind in ('garbage', 'empty file'):
        path.write_bytes(bytes(range(256)) * 9 * (kind == 'garbage'))
    elif kind == 'truncated':
        path.write_bytes(saved(icosphere(), path).read_bytes()[:32042])
    elif kind == 'points only':
        trimesh.PointCloud(corners).export(path)
    else:
        saved(trimesh.Trimesh(corners, faces, process=False), path)
    return path


@pytest.mark.parametrize(
    ('name', 'kind', 'says'),
    [
        ('part.stl', 'garbage', 'neither a text STL nor'),
        ('part.ply', 'garbage', 'not readable as a mesh'),
        ('part.glb', 'garbage', 'not readable as a mesh'),
        ('part.3mf', 'garbage', 'not readable as a mesh'),
        ('part.stl', 'empty file', 'no triangles'),
        ('part.stl', 'truncated', '32042 bytes, a complete binary one'),
        ('part.ply', 'not finite', 'not finite'),
        ('part.stl', 'no area', 'none of its 2 triangles has an area'),
        ('part.ply', 'points only', 'no triangles'),
    ],
)
def test_broken_files_are_refused_in_one_line(tmp_path, name, kind, says):
    path = broken(tmp_path / name, kind)
    with pytest.raises(MeshError, match=says) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(str(path))
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('size_m', 'options', 'says'),
    [
        (400.0, {}, 'looks like millimetres; use --mesh-scale 0.001'),
        (0.004, {}, 'only 4 mm large'),
        (0.4, {'scale': 0.0}, 'mesh_scale = 0; give a number above 0'),
        (0.4, {'max_edge_length_m': -0.02}, 'max_edge_length_m = -0.02; give'),
        (0.4, {'down': [0, 0, 0]}, 'down = .*direction of gravity'),
    ],
)
def test_absurd_sizes_are_refused_with_the_remedy(tmp_path, size_m, options, says):
    path = saved(sheet(size_m), tmp_path / 'part.stl')
    with pytest.raises(MeshError, match=says):
        read_mesh(path, **options)


def test_the_painted_mesh_carries_the_film(tmp_path):
    surface = read_mesh(saved(sheet(), tmp_path / 'part.stl'), max_edge_length_m=0.05)
    film = np.linspace(0.0, 25.0, len(surface.vertices_m))
    colours = np.full((len(film), 3), [10, 200, 30], dtype=np.uint8)
    painted = tmp_path / 'film.ply'
    write_mesh_ply(painted, surface, colours, thickness_um=film)
    again = trimesh.load(painted, process=False)
    np.testing.assert_allclose(again.vertices, surface.vertices_m, atol=1e-7)
    np.testing.assert_array_equal(again.faces, surface.faces)
    columns = again.metadata['_ply_raw']['vertex']['data']
    np.testing.assert_allclose(columns['thickness_um'].ravel(), film, rtol=1e-6)
    np.testing.assert_array_equal(again.visual.vertex_colors[:, :3], colours)
    assert b'property float thickness_um' in painted.read_bytes()[:1000]
    assert sorted(p.name for p in tmp_path.iterdir()) == ['film.ply', 'part.stl']
