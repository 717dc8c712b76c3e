"""Meshes of CAD and graphics programs: their units, and several bodies in one file."""

import importlib.util
import zipfile

import numpy as np
import pytest
import trimesh
from trimesh.creation import box
from trimesh.transformations import translation_matrix

from files.step_panels import step_panels
from paint_deposition.errors import MeshError
from paint_deposition.files import meshes
from paint_deposition.files.meshes import read_mesh

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
    assert surface.notes == (
        f'{name}: glTF, in metres by its standard',
        f'{name}: its 2 bodies were taken as one part: door, flange; --body NAME takes one of '
        'them',
    )


def test_one_body_is_taken_by_its_name(tmp_path):
    two_bodies().export(tmp_path / 'car.glb')
    surface = read_mesh(tmp_path / 'car.glb', max_edge_length_m=0.2, body='flange')
    assert box_m(surface) == [[-0.6, 0.05, -0.61], [0.6, 0.15, -0.59]]
    assert surface.notes[1] == "car.glb: of its 2 bodies 'flange' was taken"
    with pytest.raises(MeshError, match=r"car\.glb has no body 'flang'; did you mean 'flange'\?"):
        read_mesh(tmp_path / 'car.glb', body='flang')


@pytest.mark.parametrize(('unit', 'per_metre'), [('inch', 1 / 0.0254), ('meter', 1.0)])
def test_3mf_is_read_in_its_own_unit(tmp_path, unit, per_metre):
    path = tmp_path / 'door.3mf'
    in_millimetres = tmp_path / 'as_written.3mf'
    two_bodies(per_metre).export(in_millimetres)
    with zipfile.ZipFile(in_millimetres) as old, zipfile.ZipFile(path, 'w') as new:
        for item in old.namelist():
            content = old.read(item).replace(b'unit="millimeter"', f'unit="{unit}"'.encode())
            new.writestr(item, content)
    surface = read_mesh(path, max_edge_length_m=0.2)
    assert surface.area_m2 == pytest.approx(area_m2(DOOR_M, FLANGE_M), rel=1e-5)
    assert unit.removesuffix('er') in surface.notes[0]
    assert '2 bodies' in surface.notes[1]


def test_objects_of_an_obj_and_solids_of_a_text_stl_have_names(tmp_path):
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
@pytest.mark.parametrize(
    ('unit', 'per_metre'), [('.MILLI.', 1e3), ('$', 1.0)], ids=['mm', 'metres']
)
def test_step_is_read_in_its_own_unit(tmp_path, unit, per_metre):
    path = tmp_path / 'door.step'
    path.write_text(step_panels(1.2 * per_metre, 0.8 * per_metre, unit))
    surface = read_mesh(path, max_edge_length_m=0.2)
    assert box_m(surface) == [[0.0, 0.0, 0.0], [1.2, 0.0, 0.8]]
    assert surface.area_m2 == pytest.approx(0.96, rel=1e-6)
    assert surface.notes == ('door.step: STEP, its unit converted to metres',)


@needs_step
def test_a_part_of_a_step_file_is_taken_by_its_name(tmp_path):
    path = tmp_path / 'doors.stp'
    path.write_text(step_panels(1200.0, 800.0, names=('left', 'right')))
    assert '2 bodies' in read_mesh(path, max_edge_length_m=0.2).notes[1]
    right = read_mesh(path, max_edge_length_m=0.2, body='right')
    assert box_m(right) == [[1.8, 0.0, 0.0], [3.0, 0.0, 0.8]]


def test_without_its_reader_step_is_refused_with_what_to_install(tmp_path, monkeypatch):
    (tmp_path / 'door.step').write_text(step_panels(1.0, 1.0))
    monkeypatch.setattr(meshes, 'STEP_READER', 'a_reader_that_is_not_there')
    with pytest.raises(MeshError, match='run: pip install a_reader_that_is_not_there, or export'):
        read_mesh(tmp_path / 'door.step')
