"""Figures of a film are written whatever numbers they are."""

import json
import math

import numpy as np

from booth import panel
from paint_deposition.film.statistics import film_statistics
from paint_deposition.report.writers.film import write_film


def test_figures_of_any_kind_are_written(tmp_path):
    """Mesh and table are held against each other where `paint simulate` is tried out."""
    surface = panel()
    film = 20.0 + 20.0 * surface.vertices_m[:, 0]
    stats = film_statistics(film, surface.vertex_areas_m2, 20.0)
    details = {'poses': np.int64(7), 'rate': math.inf}
    *_, figures = write_film(tmp_path / 'new', surface, film, stats, details=details)
    content = json.loads(figures.read_text())
    assert (content['mean_um'], content['poses'], content['rate']) == (stats.mean_um, 7, None)
