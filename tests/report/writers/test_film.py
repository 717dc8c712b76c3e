"""Saved films: read back whole, or not written."""

import json
import math

import numpy as np
import pytest

import paint_deposition as pd
from paint_deposition.film.statistics import film_statistics
from paint_deposition.report.writers.write import write_film


@pytest.fixture
def painted():
    """A square metre with a ramp of film, and its statistics."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], dtype=float)
    surface = pd.Surface.from_triangles(corners, np.array([[0, 1, 2], [0, 2, 3]]), 0.2)
    film = 50.0 * surface.vertices_m[:, 0] / 3.0
    stats = film_statistics(film, surface.vertex_areas_m2, 20.0)
    return surface, film, stats


def test_figures_of_any_kind_are_written(painted, tmp_path):
    """Mesh and table are held against each other where `paint simulate` is tried out."""
    surface, film, stats = painted
    details = {'poses': np.int64(7), 'rate': math.inf}
    *_, figures = write_film(tmp_path / 'new', surface, film, stats, details=details)
    content = json.loads(figures.read_text())
    assert (content['mean_um'], content['poses'], content['rate']) == (stats.mean_um, 7, None)


def test_an_older_film_stays_unless_told(painted, tmp_path):
    surface, film, stats = painted
    csv = write_film(tmp_path, surface, film, stats)[1]
    with pytest.raises(pd.PaintError, match=r'film\.ply is there already'):
        write_film(tmp_path, surface, 2 * film, stats)
    assert np.genfromtxt(csv, delimiter=',', skip_header=1)[:, 3].max() == pytest.approx(50 / 3)
    write_film(tmp_path, surface, 2 * film, stats, overwrite=True)
    assert np.genfromtxt(csv, delimiter=',', skip_header=1)[:, 3].max() == pytest.approx(100 / 3)
