"""Pictures show what rays meet, and lines only where the part has an edge."""

import numpy as np
from matplotlib.figure import Figure
from tests.surfaces import triangulated

from paint_deposition.part.surface import Surface
from paint_deposition.report.pictures.part import PartPicture, label_points


def _folded(spacing_m):
    return triangulated(lambda x, z: 0.2 * x**2 + 0.9 * np.abs(z - 0.03), spacing_m, jitter=0.2)


def test_what_is_seen_is_drawn_over_what_it_hides():
    vertices, faces = _folded(0.02)
    behind = vertices + np.array([0.15, 0.4, 0.05])
    both = np.concatenate([faces, faces + len(vertices)])
    surface = Surface.from_triangles(np.concatenate([vertices, behind]), both, 0.05)
    picture = PartPicture.of(surface)
    assert 0.5 < picture.seen.mean() < 0.9
    middle = surface.vertices_m[picture.faces].mean(axis=1)
    eyes = middle[picture.seen] + 2.0 * picture.view.toward
    met = surface.first_faces(eyes, -np.tile(picture.view.toward, (len(eyes), 1)))
    drawn = {tuple(face): row for row, face in enumerate(picture.faces.tolist())}
    rows = np.array([drawn[tuple(face)] for face in surface.faces[met].tolist()])
    assert (rows == np.flatnonzero(picture.seen)).all()
    far = (middle @ picture.view.toward)[~picture.seen]
    assert far.max() < (middle @ picture.view.toward)[picture.seen].max()


def test_edges_are_those_of_the_outline_and_the_fold_alone():
    vertices, faces = _folded(0.01)
    picture = PartPicture.of(Surface.from_triangles(vertices, faces, 0.05))
    assert 0 < len(picture.edges_m) < 400


def test_a_point_is_labelled_beside_what_is_written_there():
    axes = Figure().subplots()
    axes.text(9.0, 9.0, '20')
    label_points(axes, np.zeros((1, 2)), ['1'], 1.0)
    (label,) = axes.texts[1:]
    assert np.hypot(*(np.subtract(label.get_position(), 9.0))) > 9.0
