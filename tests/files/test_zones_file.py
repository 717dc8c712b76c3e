"""Zones of a part from the files that people have: boxes, bodies, triangles."""

import numpy as np
import pytest
import trimesh

import paint_deposition as pd
from paint_deposition.part.surface import turned

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
        ('mesh: part.obj, body: Floor', 'part.stl'),
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
        ((f'name: a, {BAND}',), 'no place; give box, body, faces or mesh'),
        (('name: a, target_um: 5, tolerance_um: 5, faces: [0]',), 'give a smaller one'),
        ((f'name: a, {BAND}, faces: [0-x]',), "'0-x' is no number and no range"),
        ((f'name: a, {BAND}, faces: [3-1]',), 'swap the two'),
        ((f'name: a, {BAND}, faces: [0-4]',), 'no triangle 4, its last is 3'),
        ((f'name: a, {BAND}, body: Flour',), "zone 'a'.*no body 'Flour'"),
        ((f'name: a, {BAND}, box: [[1, 0, 0], [0, 1, 1]]',), 'lowest corner first'),
        ((f'name: a, {BAND}, mesh_scale: 1, faces: [0]',), 'mesh_scale has no mesh'),
        ((f'name: a, {BAND}, faces: [0]',) * 2, "two zones are called 'a'"),
        ((f'name: a, {BAND}, box: [[5, 5, 5], [6, 6, 6]]',),
         r"zone 'a' holds no vertex of the part.* x 5.000 to 6.000, .* m, the part within"),
        ((f'name: a, {BAND}, mesh: part.stl', f'name: b, {BAND}, faces: [0]'),
         r'belong to zones before it \(a\); put it before them'),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_the_remedy(bracket, zones, message):
    with pytest.raises(pd.PaintError, match=message):
        zones_of(bracket, *zones).on(pd.read_mesh(bracket / 'part.stl', 1e-3))


@pytest.mark.parametrize('text', ['', 'zones: []', 'zones: {a: 1}', 'zone: [{name: a}]'])
def test_a_file_without_zones_is_refused(tmp_path, text):
    (tmp_path / 'zones.yaml').write_text(text)
    with pytest.raises(pd.PaintError, match='zones'):
        pd.read_zones(tmp_path / 'zones.yaml', tmp_path / 'part.stl')
