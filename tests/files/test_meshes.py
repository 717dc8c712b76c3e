"""Meshes: what is read, put right and refused; their units, and several bodies in one file."""

import importlib.util
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.creation import box, icosphere
from trimesh.transformations import translation_matrix

from paint_deposition.errors import MeshError
from paint_deposition.files import meshes
from paint_deposition.files.meshes import read_mesh, write_mesh_ply
from refusals import refusal
from surfaces import triangulated


def sheet(size_m=0.4) -> trimesh.Trimesh:
    """Two triangles facing -y."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1.0]]) * size_m
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def saved(mesh: trimesh.Trimesh, path, **options):
    mesh.export(path, **options)
    return path


@pytest.mark.parametrize(('name', 'options'), [
    ('part.stl', {'file_type': 'stl_ascii'}), ('PART.STL', {'file_type': 'stl'}),
    ('part.ply', {'encoding': 'ascii'}), ('part.obj', {}),
])  # fmt: skip
def test_formats_give_the_same_part(tmp_path, name, options):
    ball = icosphere(subdivisions=3, radius=0.2)
    surface = read_mesh(saved(ball, tmp_path / name, **options))
    assert surface.area_m2 == pytest.approx(ball.area, rel=1e-5)
    assert len(surface.vertices_m) == len(np.unique(surface.vertices_m.round(6), axis=0))
    outward = np.einsum('ij,ij->i', surface.normals, surface.vertices_m) / 0.2
    np.testing.assert_allclose(outward, 1.0, atol=0.01)
    assert surface.notes == ()


def test_an_open_surface_faces_as_it_is_wound_and_a_closed_one_outward(tmp_path):
    mesh, body = sheet(), box((0.3, 0.2, 0.1))
    front = read_mesh(saved(mesh, tmp_path / 'front.stl'))
    mesh.invert()
    back = read_mesh(saved(mesh, tmp_path / 'back.stl'))
    np.testing.assert_allclose([front.normals[0], back.normals[0]], [[0, -1, 0], [0, 1, 0]])
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
    (note,) = surface.notes
    assert note == f'{len(turned)} triangles wound against their neighbours were turned round'


def test_triangles_without_area_are_left_out_with_a_note(tmp_path):
    faces = [[0, 1, 2], [0, 2, 3], [0, 0, 1], [1, 1, 1]]
    mesh = trimesh.Trimesh(sheet().vertices, faces, process=False)
    surface = read_mesh(saved(mesh, tmp_path / 'part.stl'))
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
    elif kind == 'bodies':
        path.write_text('\no '.join(['v 0 0 0', *(f'{k}\nf 1 1 1' for k in range(21_000))]))
    elif kind == 'points only':
        trimesh.PointCloud(corners).export(path)
    else:
        saved(trimesh.Trimesh(corners, faces, process=False), path)
    return path


@pytest.mark.parametrize(('name', 'kind', 'says'), [
    ('part.stl', 'garbage', 'neither a text STL nor'),
    ('part.ply', 'garbage', 'not readable as a mesh'),
    ('part.glb', 'garbage', 'not readable as a mesh'),
    ('part.stl', 'empty file', 'no triangles'),
    ('part.stl', 'truncated', '32042 bytes, a complete binary one'),
    ('part.ply', 'not finite', 'not finite'),
    ('part.stl', 'no area', 'none of its 2 triangles has an area'),
    ('part.ply', 'points only', 'no triangles'),
    ('part.obj', 'bodies', 'has 21000 bodies, over 20000; join them, or export fewer'),
])  # fmt: skip
def test_broken_files_are_refused_in_one_line(tmp_path, name, kind, says):
    path = broken(tmp_path / name, kind)
    line = refusal(MeshError, read_mesh, path)
    assert says in line
    assert line.startswith(str(path))


def test_a_pipe_as_a_buffer_is_not_read(tmp_path):
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'part.gltf').write_text('{"buffers": [{"uri": "pipe"}]}')
    assert 'a device or a pipe' in refusal(MeshError, read_mesh, tmp_path / 'part.gltf')


def test_absurd_sizes_are_refused_with_the_remedy(tmp_path):
    for size_m, options, says in (
        (400.0, {}, 'looks like millimetres; use --mesh-scale 0.001'),
        (0.004, {}, 'only 4 mm large'),
        (0.4, {'scale': 0.0}, 'mesh_scale = 0; give a number above 0'),
        (0.4, {'max_edge_length_m': -0.02}, 'max_edge_length_m = -0.02; give'),
        (0.4, {'down': [0, 0, 0]}, 'down = .*direction of gravity'),
    ):
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


# Upright panels that face -y, as CAD programs export them (AP203).
PARTS = Path(__file__).with_name('parts')
DOOR_M, FLANGE_M = (1.2, 0.04, 0.8), (1.2, 0.1, 0.02)
needs_step = pytest.mark.skipif(
    importlib.util.find_spec('cascadio') is None, reason='STEP is read by cascadio'
)


def two_bodies(scale: float = 1.0) -> trimesh.Scene:
    """A door about the origin, and a flange that its node places below."""
    scene = trimesh.Scene()
    scene.add_geometry(box(np.multiply(DOOR_M, scale)), node_name='door')
    below = translation_matrix([0.0, 0.1 * scale, -0.6 * scale])
    scene.add_geometry(box(np.multiply(FLANGE_M, scale)), node_name='flange', transform=below)
    return scene


def area_m2(*sizes) -> float:
    return sum(2.0 * (a * b + b * c + c * a) for a, b, c in sizes)


def box_m(surface) -> list:
    return np.round([surface.vertices_m.min(axis=0), surface.vertices_m.max(axis=0)], 6).tolist()


@pytest.mark.parametrize('name', ['car.glb', 'car.gltf'])
def test_gltf_is_in_metres_and_its_bodies_are_one_part(tmp_path, name):
    if name.endswith('.glb'):
        two_bodies().export(tmp_path / name)
    else:  # with its buffers beside it
        for file, content in trimesh.exchange.gltf.export_gltf(two_bodies()).items():
            (tmp_path / file.replace('model.gltf', name)).write_bytes(content)
    surface = read_mesh(tmp_path / name, max_edge_length_m=0.2)
    assert surface.area_m2 == pytest.approx(area_m2(DOOR_M, FLANGE_M))
    assert box_m(surface) == [[-0.6, -0.02, -0.61], [0.6, 0.15, 0.4]]
    unit, bodies = surface.notes
    assert unit == f'{name}: glTF, in metres by its standard'
    expected = ': its 2 bodies were taken as one part: door, flange; --body NAME takes one of them'
    assert bodies.startswith(f'{name}{expected}')


def test_one_body_is_taken_by_its_name_also_of_an_obj_and_a_text_stl(tmp_path):
    two_bodies().export(tmp_path / 'car.glb')
    surface = read_mesh(tmp_path / 'car.glb', max_edge_length_m=0.2, body='flange')
    assert box_m(surface) == [[-0.6, 0.05, -0.61], [0.6, 0.15, -0.59]]
    assert surface.notes[1] == "car.glb: of its 2 bodies 'flange' was taken"
    with pytest.raises(MeshError, match=r"car\.glb has no body 'flang'; did you mean 'flange'\?"):
        read_mesh(tmp_path / 'car.glb', body='flang')
    (tmp_path / 'part.obj').write_text(
        'o left\nv 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nf 1 2 3 4\no right\nv 2 0 0\nv 2 0 1\n'
        'f 2 5 6 3\n'
    )
    assert read_mesh(tmp_path / 'part.obj', body='right').vertices_m[:, 0].min() == 1.0
    solids = [box((0.2, 0.2, 0.2)), box((0.2, 0.2, 0.2), translation_matrix([1.0, 0.0, 0.0]))]
    text = [
        solid.export(file_type='stl_ascii').replace('solid', f'solid {name}', 1)
        for name, solid in zip(('near', 'far'), solids, strict=True)
    ]
    (tmp_path / 'part.stl').write_text('\n'.join(text))
    assert read_mesh(tmp_path / 'part.stl', body='far').vertices_m[:, 0].min() > 0.8
    assert read_mesh(tmp_path / 'part.stl').area_m2 == pytest.approx(0.48)


@needs_step
@pytest.mark.parametrize('name', ['door_mm.step', 'door_m.step'])
def test_step_is_read_in_its_own_unit_and_a_part_of_it_by_its_name(name):
    surface = read_mesh(PARTS / name, max_edge_length_m=0.2)
    assert box_m(surface) == [[0.0, 0.0, 0.0], [1.2, 0.0, 0.8]]
    assert surface.area_m2 == pytest.approx(0.96, rel=1e-6)
    assert surface.notes == (f'{name}: STEP, its unit converted to metres',)
    path = PARTS / 'doors.stp'
    assert '2 bodies' in read_mesh(path, max_edge_length_m=0.2).notes[1]
    right = read_mesh(path, max_edge_length_m=0.2, body='right')
    assert box_m(right) == [[1.8, 0.0, 0.0], [3.0, 0.0, 0.8]]


def test_without_its_reader_step_is_refused_with_what_to_install(monkeypatch):
    monkeypatch.setattr(meshes, 'STEP_READER', 'a_reader_that_is_not_there')
    with pytest.raises(MeshError, match='run: pip install a_reader_that_is_not_there, or export'):
        read_mesh(PARTS / 'door_mm.step')
