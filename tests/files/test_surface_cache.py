"""A part seen before is the part prepared anew, to the last bit, whatever became of its file."""

import os
from dataclasses import replace

import numpy as np
import pytest
from trimesh import Trimesh

from paint_deposition.files import surface_cache
from paint_deposition.files.meshes import read_mesh
from paint_deposition.part.surface import Surface
from surfaces import triangulated


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(surface_cache.FOLDER_VARIABLE, str(tmp_path / 'cache'))
    monkeypatch.setattr(surface_cache, 'LEAST_VERTICES', 0)
    return tmp_path / 'cache' / 'parts'


@pytest.fixture
def part(tmp_path):
    return written(tmp_path / 'part.stl', 0.7)


def written(path, fold):
    sheet = triangulated(lambda x, z: 0.3 * x**2 + fold * np.abs(z), 0.1, jitter=0.3)
    faces = sheet[1].copy()
    faces[0] = faces[0, ::-1]  # gives a note
    Trimesh(sheet[0], faces, process=False).export(path)
    return path


def assert_same(one: Surface, other: Surface):
    names = 'vertices_m', 'faces', 'normals', 'vertex_areas_m2', 'down', 'rim_m', 'in_hem'
    for name in (*names, 'neighbours'):
        a, b = getattr(one, name), getattr(other, name)
        assert a.dtype == b.dtype
        assert np.array_equal(a, b), name
    assert one.notes == other.notes
    for name, values in vars(one.curved_edges).items():
        assert np.array_equal(values, getattr(other.curved_edges, name)), name
    assert one.mesh_id == other.mesh_id


def test_the_second_time_it_is_found_and_the_same(folder, part):
    first = read_mesh(part)
    (place,) = folder.iterdir()
    assert first.notes
    assert len(first.curved_edges)
    assert_same(read_mesh(part), first)
    # What is kept is what is given.
    surface_cache.keep(place, replace(first, notes=('kept',)))
    assert read_mesh(part).notes == ('kept',)


def test_another_file_name_or_wish_is_another_part(folder, part, tmp_path):
    read_mesh(part)
    other = written(tmp_path / 'other.stl', 0.2)
    renamed = tmp_path / 'renamed.stl'
    renamed.write_bytes(part.read_bytes())
    for count, (path, options) in enumerate(
        [
            (other, {}), (renamed, {}), (part, {'max_edge_length_m': 0.03}),
            (part, {'scale': 0.5}), (part, {'down': [0, -1, 0]}), (part, {'body': 'part'}),
        ],
        start=2,
    ):  # fmt: skip
        read_mesh(path, **options)
        assert len(list(folder.iterdir())) == count


@pytest.mark.parametrize(
    'spoil',
    [
        lambda content: content[: len(content) // 2],
        lambda content: content[:2000] + bytes([content[2000] ^ 1]) + content[2001:],
    ],
    ids=['cut', 'one bit'],
)
def test_a_broken_file_is_made_anew(folder, part, spoil):
    first = read_mesh(part)
    (place,) = folder.iterdir()
    place.write_bytes(spoil(place.read_bytes()))
    assert surface_cache.find(place) is None
    assert_same(read_mesh(part), first)
    assert_same(surface_cache.find(place), first)


def test_the_parts_unused_for_longest_make_room(folder, tmp_path, monkeypatch):
    paths = [written(tmp_path / f'{k}.stl', 0.1 * k) for k in range(3)]
    for path in paths[:2]:
        read_mesh(path)
    first, second = (surface_cache.place_of(p, 1.0, 0.02, None, None) for p in paths[:2])
    for age, place in enumerate((first, second)):
        os.utime(place, (1000 + age, 1000 + age))
    read_mesh(paths[0])  # used again
    monkeypatch.setattr(surface_cache, 'MOST_BYTES', int(2.5 * first.stat().st_size))
    read_mesh(paths[2])
    assert first.exists()
    assert not second.exists()
    assert len(list(folder.iterdir())) == 2


def test_nothing_is_kept_where_that_is_not_wanted_or_not_possible(folder, part, monkeypatch):
    first = read_mesh(part)
    for nowhere in (str(part), ''):  # no folder
        monkeypatch.setenv(surface_cache.FOLDER_VARIABLE, nowhere)
        assert_same(read_mesh(part), first)
    assert len(list(folder.iterdir())) == 1
