"""Pictures show what rays meet, and lines only where the part has an edge."""

import numpy as np
from tests.surfaces import triangulated

from paint_deposition.part.surface import Surface
from paint_deposition.report.pictures import part
from paint_deposition.report.pictures.part import PartPicture


def _folded(spacing_m):
    return triangulated(lambda x, z: 0.2 * x**2 + 0.9 * np.abs(z - 0.03), spacing_m, jitter=0.2)


def test_pixels_show_what_rays_meet(monkeypatch):
    monkeypatch.setattr(part, 'PIXELS', 300)
    vertices, faces = _folded(0.02)
    behind = vertices + np.array([0.15, 0.4, 0.05])
    both = np.concatenate([faces, faces + len(vertices)])
    surface = Surface.from_triangles(np.concatenate([vertices, behind]), both, 0.05)
    picture = PartPicture.of(surface)
    seen_m = np.stack([picture.spread(axis) for axis in surface.vertices_m.T], axis=2)
    shown = np.isfinite(seen_m[:, :, 0])
    toward = picture.view.toward
    eyes = seen_m[shown] + 2.0 * toward
    met = surface.first_faces(eyes, -np.tile(toward, (len(eyes), 1)))
    assert np.mean(np.sort(surface.faces[met]) == np.sort(picture.corners[shown])) > 0.999
    assert 0.6 < shown.mean() < 1.0


def test_a_mesh_finer_than_the_pixels_shows_its_edges_only(monkeypatch):
    vertices, faces = _folded(0.01)
    surface = Surface.from_triangles(vertices, faces, 0.05)
    expected = len(PartPicture.of(surface).edges_m)
    assert expected < 400
    monkeypatch.setattr(part, 'PIXELS', 15)
    assert len(PartPicture.of(surface).edges_m) == expected
