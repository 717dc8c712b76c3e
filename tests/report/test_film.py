"""The picture of a painted part: seen from the gun's side, gravity down."""

import numpy as np
import pytest
from matplotlib.image import imread

from booth import door, painted, serpentine
from paint_deposition.film.colour_scales import BARE_RGB
from paint_deposition.film.statistics import film_statistics
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.report.pictures.chart import new_figure
from paint_deposition.report.pictures.film import draw_film, write_door_picture
from paint_deposition.report.pictures.view import View

X, Y, Z = np.eye(3)


@pytest.mark.parametrize(
    ('outward', 'down', 'right', 'labels'),
    [
        (-Y, -Z, X, ('x [m]', 'z [m]')),
        (Y, -Z, -X, ('x [m]', 'z [m]')),
        (X, -Z, Y, ('y [m]', 'z [m]')),
        (Z, -Y, X, ('x [m]', 'y [m]')),
        (Z, -Z, X, ('x [m]', 'y [m]')),
        # A part overhead has the same right side in words and in the picture: see across_axis.
        (-Z, -Z, X, ('x [m]', 'y [m]')),
        # A hood that falls toward -x has its front below.
        (Z * 0.98 - X * 0.2, -Z, -Y, ('y [m]', 'x [m]')),
        (-Y * 0.97 + Z * 0.24, -Z, X, ('x [m]', 'z [m]')),
    ],
)
def test_the_view_is_the_guns(outward, down, right, labels):
    view = View.of_front(np.array(outward, dtype=float), np.array(down, dtype=float))
    assert np.allclose(view.right, right)
    assert view.labels == labels
    axes = np.stack([view.right, view.up, view.toward])
    assert np.allclose(axes @ axes.T, np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert view.up @ down <= 1e-9


def test_a_slanting_part_is_seen_along_its_normal():
    outward = np.array([0.6, -0.64, 0.48])
    view = View.of_front(outward, -Z)
    assert np.allclose(view.toward, outward)
    assert view.labels == ('right [m]', 'up [m]')
    assert view.up[2] > 0.5


def draw(tmp_path, film_um, path, **options):
    surface = door()
    statistics = film_statistics(film_um, surface.vertex_areas_m2, 10.0, **options)
    file = write_door_picture(
        tmp_path / 'film.png', surface, film_um, path, statistics, 'Door', ''
    )
    assert [f.name for f in tmp_path.iterdir()] == ['film.png']
    return (255 * imread(file)[:, :, :3]).round().astype(int)


def test_the_film_is_coloured_and_bare_metal_is_grey(tmp_path):
    log = serpentine((0.5,))
    film = painted(door(), log).film_um
    picture = draw(tmp_path, film, spray_path(log)[0], target_um=20.0, target_tolerance_um=3.0)
    height, width, _ = picture.shape
    assert min(height, width) > 600
    colourful = np.ptp(picture, axis=2) > 60
    assert 0.02 < colourful.mean() < 0.6
    grey = (np.ptp(picture, axis=2) < 4) & (np.abs(picture[:, :, 0] - BARE_RGB[0]) < 60)
    assert grey.mean() > 0.1


def test_a_bare_part_is_drawn_too(tmp_path):
    picture = draw(tmp_path, np.zeros(len(door().vertices_m)), SprayPath.empty())
    assert (np.ptp(picture, axis=2) < 4).mean() > 0.8


def test_labels_on_contours_are_level():
    surface = door()
    figure = new_figure(9.0, 6.0)
    axes = figure.subplots()
    draw_film(axes, surface, 30.0 - 20.0 * surface.vertices_m[:, 0], SprayPath.empty(), 1.0)
    figure.canvas.draw()
    labels = [text for text in axes.texts if text.get_text().isdigit()]
    assert len(labels) > 1
    assert all(label.get_rotation() == 0.0 for label in labels)
