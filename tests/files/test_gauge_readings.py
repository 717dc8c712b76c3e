"""Readings, zones and brushes in files: what is read, and one clear line for each fault."""

import re
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

import paint_deposition as pd
from brushes import SET_POINTS, two_brushes
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.errors import ReadingsError, RecordingError
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.files.model_file import read_model, write_model
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.provenance import model_digest
from paint_deposition.part.surface import turned
from refusals import refusal

HEADER = 'x_m,y_m,z_m,thickness_um'


@pytest.fixture
def table(file):
    """`table(line, ...)`: a CSV file of these lines."""
    return lambda *lines: file('door.csv', '\n'.join(lines) + '\n')


def test_every_column_arrives_and_without_labels_readings_at_one_place_are_repeats(table):
    path = table(
        f'point,{HEADER},operator,group,sigma_um,nx,ny,nz,session',
        'A1,0.1,0.2,0.3,21.5,Kim,left,0.8,0,-2,0,morning',
        'A2,0.4,0.5,0.6,22.5,Kim,right,,0,0,3,',
    )
    readings = read_readings(path)
    assert readings.positions_m == pytest.approx(np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]))
    assert readings.thickness_um.tolist() == [21.5, 22.5]
    assert readings.point.tolist() == ['A1', 'A2']
    assert readings.group.tolist() == ['left', 'right']
    assert readings.session.tolist() == ['morning', '']
    assert readings.sigma_um[0] == 0.8
    assert np.isnan(readings.sigma_um[1])
    assert readings.normals.tolist() == [[0, -1, 0], [0, 0, 1]]
    assert readings.source == str(path)
    readings = read_readings(table(f'{HEADER},point', '0,0,0,20,', '0,0,0.01,21,', '1,0,0,9,A'))
    assert len(set(readings.point)) == 3
    readings = read_readings(table(HEADER, '0,0,0,20', '1,0,0,30', '0,0,0,21', '0,0,1e-4,22'))
    first, second, third, fourth = readings.point
    assert first == third
    assert len({first, second, fourth}) == 3


@pytest.mark.parametrize(
    ('lines', 'message'),
    [
        (
            ['x_m,y_m,thickness_um', '0,0,20'],
            r"known as z \(columns: 'x_m', 'y_m', 'thickness_um'\); give it with columns: {z: ",
        ),
        (['x_mm,y_m,z_m,thickness_um', '0,0,0,20'], 'x, y, z are in .* give all in one of m, mm'),
        (['x,y,z,DFT', 'ell,ell,ell,um', '0,0,0,20'], "x, y, z are in 'ell'; give all in one"),
        (['x_m,y_m,z_m,thickness_m', '0,0,0,1'], 'no column is known as the thick'),
        (['x,y,z,dft_um,film_um', '0,0,0,1,2'], "may be in 'dft_um', 'film_um'; name one"),
        (
            ['x,y,z,base_um', '0,0,0,1'],
            r"'base_um'\); call it thickness_um, DFT, film thickness or",
        ),
        (['point,thickness_um', 'A,20'], 'no coordinates .* a list of measuring points'),
        ([], 'there is nothing to read in it'),
        ([HEADER, '0,0,0,20', '', '0,0,1,20,5'], 'line 4: 5 values under 4 column names'),
        (
            [HEADER, '0,0,0,'],
            "no readings below the header: 1 rows without one under 'thickness_um'",
        ),
        ([HEADER], 'no readings below the header$'),
        (
            ['P1,0,0,0,20', 'P2,0,0,1,21'],
            r"no headings \(it begins with 'P1 0 0 0 20'\); put a row of headings on top, or numb",
        ),
        (['x_m,y_m,z_m,DFT %', '0,0,0,1'], "'DFT %' is in '%': give it in µm, mil or mm"),
        ([HEADER, '0,0 um,0,20'], "line 2: y_m is '0 um'; expected a number with a decimal point"),
        ([HEADER, '0,nan,0,20'], 'line 2: y_m is nan; expected a finite number'),
        ([HEADER, '0,0,0,-9'], 'line 2: thickness_um is -9; expected -5 to 5000 micrometres'),
        ([f'{HEADER},x_m', '0,0,0,20,0'], "two columns are called 'x_m'"),
        ([f'{HEADER},sigma_um', '0,0,0,20,0'], 'line 2: sigma_um is 0; expected above 0'),
        ([f'{HEADER},nx,ny', '0,0,0,20,0,1'], 'has nx, ny only; give all of nx,ny,nz or none'),
        ([f'{HEADER},nx,ny,nz', '0,0,0,20,0,0,0'], 'line 2: the normal nx,ny,nz has length zero'),
        (
            [f'{HEADER},point', '0,0,0,20,A', '0.2,0,0,20,A'],
            "point 'A' is used 0.200 m apart; give each place a label of its own",
        ),
    ],
)
def test_a_fault_is_refused_in_one_line(table, lines, message):
    path = table(*lines)
    line = refusal(ReadingsError, read_readings, path)
    assert re.search(message, line), line
    assert line.startswith(str(path))


def test_all_faults_of_a_file_are_named_at_once(table):
    path = table(HEADER, '0,a,0,20', '0,0,0,21', '0,0,0,9999', '0,0', '0,0,0,20', 'b,0,0,20')
    text = refusal(ReadingsError, read_readings, path)
    assert '4 errors: line 2: y_m' in text
    assert all(f'; line {line}: ' in text for line in (4, 5, 7))


def test_a_file_that_is_no_table_is_refused(tmp_path):
    with pytest.raises(ReadingsError, match='no such file; give a table as CSV'):
        read_readings(tmp_path / 'none.csv')
    path = tmp_path / 'file'
    package = BytesIO()
    with zipfile.ZipFile(package, 'w') as opened:
        opened.writestr('content.xml', '<office:document-content/>')
    for content, kind in (
        (b'x_m,\xff\xfe\x00', 'text'), (b'PK\x03\x04 and none', 'a workbook'),
        (package.getvalue(), r'a workbook \(an \.ods or \.xlsb; save it as \.xlsx\); give'),
    ):  # fmt: skip
        path.write_bytes(content)
        with pytest.raises(ReadingsError, match=f'cannot be read as {kind}'):
            read_readings(path)


BAND = 'target_um: 30, tolerance_um: 5'


@pytest.fixture(scope='module')
def bracket(tmp_path_factory):
    """A wall 400 mm high with a floor before it, folded by 80 degrees, in mm, in several files."""
    folder = tmp_path_factory.mktemp('bracket')
    up, out = [0, 0, 400], [0, -400 * np.cos(np.radians(10)), -400 * np.sin(np.radians(10))]
    corners = np.array([[0, 0, 0], [400, 0, 0], up, [400, 0, 400], out, [400, *out[1:]]], float)
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 5, 1], [4, 1, 0]])
    trimesh.Trimesh(corners, faces, process=False).export(folder / 'part.stl')
    trimesh.Trimesh(corners, faces[2:], process=False).export(folder / 'floor.stl')
    trimesh.Trimesh(corners, faces[2:, ::-1], process=False).export(folder / 'wound_on.stl')
    lines = [f'v {x} {y} {z}' for x, y, z in corners]
    for name, own in (('Wall', faces[:2]), ('Floor', faces[2:])):
        lines += [f'o {name}', *(f'f {a} {b} {c}' for a, b, c in own + 1)]
    (folder / 'part.obj').write_text('\n'.join(lines))
    return folder


def zones_of(folder, *zones, mesh='part.stl'):
    path = folder / 'zones.yaml'
    path.write_text('zones:\n' + ''.join(f'  - {{{zone}}}\n' for zone in zones))
    return pd.read_zones(path, folder / mesh, 1e-3)


@pytest.mark.parametrize(
    ('place', 'mesh'),
    [
        ('faces: [2-3]', 'part.stl'), ('faces: [2, 3]', 'part.stl'), ('body: Floor', 'part.obj'),
        ('mesh: floor.stl', 'part.stl'), ('mesh: wound_on.stl', 'part.stl'),
        ('mesh: part.obj, body: Floor', 'part.stl'), ('body: Floor, faces: [0-1]', 'part.obj'),
        ('box: [[-1, -1, -1], [1, 1, 1]], body: Floor', 'part.obj'),
    ],
)  # fmt: skip
def test_a_region_is_the_same_however_it_is_told(bracket, place, mesh):
    """The crease belongs to both faces of the fold: each side of it to its own."""
    for surface in (part := pd.read_mesh(bracket / mesh, 1e-3), turned(part)):
        wanted = np.abs(surface.normals[:, 2]) > 0.5
        found = zones_of(bracket, f'name: floor, {BAND}, {place}', mesh=mesh).on(surface)
        np.testing.assert_array_equal(found.number == 0, wanted)


def test_the_first_zone_that_holds_a_point_has_it_and_others_none(bracket):
    surface = pd.read_mesh(bracket / 'part.stl', 1e-3)
    found = zones_of(
        bracket, f'name: left, {BAND}, box: [[-1, -1, 0], [0.2, 1, 1]]',
        'name: wall, target_um: 50, tolerance_um: 9, faces: [0-1]',
    ).on(surface)  # fmt: skip
    x, wall = surface.vertices_m[:, 0], np.abs(surface.normals[:, 2]) < 0.5
    np.testing.assert_array_equal(found.names[wall], np.where(x[wall] <= 0.2, 'left', 'wall'))
    target, tolerance = found.wanted_um(40.0, 8.0)
    assert set(zip(found.names, target, tolerance, strict=True)) == {
        ('left', 30.0, 5.0), ('wall', 50.0, 9.0), ('', 40.0, 8.0),
    }  # fmt: skip
    assert np.isnan(found.wanted_um()[0][found.number < 0]).all()


@pytest.mark.parametrize(
    ('zones', 'message'),
    [
        (('name: a, target_um: 30',), "zone 1 has no 'tolerance_um'"),
        ((f'name: null, {BAND}, faces: [0]',), 'name is None; expected what to call it'),
        ((f'name: 12.10, {BAND}, faces: [0]',), 'name: 12.1 is no text; put it in quotes'),
        ((f'name: a, {BAND}',), 'no place; give box, body, faces or mesh'),
        (('name: a, target_um: 5, tolerance_um: 5, faces: [0]',), 'give a smaller one'),
        ((f'name: a, {BAND}, faces: [0-x]',), "'0-x' is no number and no range"),
        ((f'name: a, {BAND}, faces: [3-1]',), 'swap the two'),
        ((f'name: a, {BAND}, faces: [0-4]',), 'no triangle 4, its last is 3'),
        ((f'name: a, {BAND}, mesh: part.obj, faces: [0]',), 'several bodies.*name one with body'),
        ((f'name: a, {BAND}, body: Flour',), "zone 'a'.*no body 'Flour'"),
        ((f'name: a, {BAND}, box: [[1, 0, 0], [0, 1, 1]]',), 'lowest corner first'),
        ((f'name: a, {BAND}, mesh_scale: 1, faces: [0]',), 'mesh_scale has no mesh'),
        ((f'name: a, {BAND}, faces: [0]',) * 2, "two zones are called 'a'"),
        (
            (f'name: a, {BAND}, box: [[5, 5, 5], [6, 6, 6]]',),
            "zone 'a' holds no vertex of the part.* x 5.000 to 6.000, .* m, the part within",
        ),
        (
            (f'name: a, {BAND}, mesh: part.stl', f'name: b, {BAND}, faces: [0]'),
            r'belong to zones before it \(a\); put it before them',
        ),
    ],
)
def test_what_is_wrong_is_named_with_the_remedy(bracket, zones, message):
    with pytest.raises(pd.PaintError, match=message):
        zones_of(bracket, *zones).on(pd.read_mesh(bracket / 'part.stl', 1e-3))


@pytest.mark.parametrize('text', ['', 'zones: []', 'zones: {a: 1}', 'zone: [{name: a}]'])
def test_a_file_without_zones_is_refused(tmp_path, file, text):
    with pytest.raises(pd.PaintError, match='zones'):
        pd.read_zones(file('zones.yaml', text), tmp_path / 'part.stl')


MODEL = two_brushes(effects=(EFFECTS['edge_build'].typical(),))
HEAD = 'x_m,y_m,z_m,qx,qy,qz,qw'
POSE = '0,0,0,1,0,0,0'


def test_brushes_are_written_and_read_back_without_loss(tmp_path: Path):
    path = tmp_path / 'model.yaml'
    write_model(path, MODEL)
    assert read_model(path) == MODEL
    content = yaml.safe_load(path.read_text())
    assert 'planar' not in content
    assert content['brushes'] == {
        brush.number: {'planar': brush.planar.model_dump(), **SET_POINTS[brush.number]}
        for brush in MODEL.brushes
    }
    assert all('#' in line for line in path.read_text().splitlines() if ': ' in line)
    first, second = MODEL.brushes
    thinner = second.model_copy(update={'solids': 0.5})
    other = pd.DepositionModel(brushes=[first, thinner], effects=MODEL.effects)
    assert model_digest(other) != model_digest(MODEL) == model_digest(read_model(path))


def test_a_table_of_poses_names_the_brush_from_its_row_on(file):
    states = '1,2', '1,3', '0,0', '1,2'
    rows = ''.join(f'0.{k},{POSE},{state}\n' for k, state in enumerate(states))
    read = read_recording(file('poses.csv', f't,{HEAD},gun,brush\n{rows}'))
    assert read.trigger_flow.tolist() == [1.0, 1.0, 0.0, 1.0]
    assert read.trigger_brush.tolist() == [2, 3, 0, 2]
    assert 'gun by gun, brush by brush' in read.notes[0]
    # Without a trigger the gun sprays throughout, with these brushes.
    path = file('poses.csv', f't,{HEAD},brush\n0,{POSE},2\n0.1,{POSE},3\n')
    assert [(flow, brush) for _, flow, brush in read_recording(path).triggers] == [(1, 2), (1, 3)]
    path = file('poses.csv', f't,{HEAD},brush\n0,{POSE},2\n0.1,{POSE},2.5\n')
    with pytest.raises(RecordingError, match=r'line 3: brush is 2\.5; give the number of a brush'):
        read_recording(path)


def test_a_programmed_table_takes_the_brush_of_each_move(file):
    text = (
        f'{HEAD},speed_m_per_s,spraying,brush\n'
        '0,0,0,1,0,0,0,1,0,0\n0.5,0,0,1,0,0,0,1,1,4\n1,0,0,1,0,0,0,1,1,9\n2,0,0,1,0,0,0,1,0,9\n'
    )
    assert read_recording(file('passes.csv', text)).triggers == [
        (0, 1.0, 4), (500_000_000, 1.0, 9), (1_000_000_000, 0.0, 9)
    ]  # fmt: skip
