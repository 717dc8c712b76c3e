"""The same content has the same bytes, however it came into memory."""

import numpy as np
from tests.surfaces import triangulated
from trimesh import Trimesh

from paint_deposition.batch.cases import content_digest
from paint_deposition.files import surface_cache
from paint_deposition.files.meshes import read_mesh


def test_a_part_seen_before_has_the_digest_of_the_part_prepared(tmp_path, monkeypatch):
    monkeypatch.setenv(surface_cache.FOLDER_VARIABLE, str(tmp_path / 'cache'))
    monkeypatch.setattr(surface_cache, 'LEAST_VERTICES', 0)
    part = tmp_path / 'part.stl'
    sheet = triangulated(lambda x, z: 0.3 * x**2, 0.04, jitter=0.3)
    Trimesh(*sheet, process=False).export(part)
    prepared, found = read_mesh(part), read_mesh(part)
    assert len(list((tmp_path / 'cache' / 'parts').iterdir())) == 1
    assert len(prepared.curved_edges) > 10
    assert content_digest(prepared) == content_digest(found)


def test_arrays_count_by_their_values():
    values = np.arange(12.0).reshape(3, 4)
    elsewhere = np.frombuffer(bytearray(values.tobytes()), np.dtype('f8', copy=True))
    digest = content_digest({'values': values})
    assert content_digest({'values': elsewhere.reshape(3, 4)}) == digest
    assert content_digest({'values': np.asfortranarray(values)}) == digest
    others = (values + np.eye(3, 4), values.reshape(4, 3), values.astype(np.float32), [values])
    for other in others:
        assert content_digest({'values': other}) != digest
