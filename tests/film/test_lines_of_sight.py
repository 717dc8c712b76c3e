"""Shadows on the film, against every point traced from every origin."""

import numpy as np
import pytest
from trimesh.creation import box
from trimesh.util import concatenate

import paint_deposition as pd
from booth import LOOKING_ALONG_Y
from paint_deposition.effects.library.occlusion import Occlusion
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.layout import SIGHT_STEP_M, emission_points_m
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from scenes import straight_pass

OPEN = pd.DepositionModel(planar=PlanarPattern(K1_cm3_per_s=1.3, r_m=0.05, sigma1_m=0.03))
SHADED = OPEN.with_effect(Occlusion(strength=0.8))


@pytest.fixture(scope='module')
def tray():
    """A box open to the gun, with a bar across it."""
    walls = [
        box((0.8, 0.01, 0.5)),
        *(box((0.8, 0.12, 0.01), transform=moved(0.0, -0.06, z)) for z in (-0.25, 0.25)),
        *(box((0.01, 0.12, 0.5), transform=moved(x, -0.06, 0.0)) for x in (-0.4, 0.4)),
        box((0.03, 0.03, 0.5), transform=moved(0.05, -0.1, 0.0)),
    ]
    whole = concatenate(walls)
    return pd.Surface.from_triangles(whole.vertices, np.asarray(whole.faces), 0.03)


@pytest.fixture(scope='module')
def path():
    log = straight_pass(
        np.linspace(0, 1.5, 76), (-0.5, -0.3, 0.1), (0.5, -0.25, -0.1), LOOKING_ALONG_Y
    )
    return spray_path(log, max_step_m=OPEN.max_step_m)[0]


def moved(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def traced_everywhere(surface, path):
    """The film sub-step by sub-step, all points traced, and how much the shadows take."""
    origins = emission_points_m(SHADED, path)
    film, open_film, eye = 0.0, 0.0, np.full(3, np.inf)
    step = FilmIntegrator(surface.points(), OPEN, 'double')
    for row, origin in enumerate(origins):
        if np.linalg.norm(origin - eye) > SIGHT_STEP_M:
            eye = origin
            seen = surface.occluder.sees(eye, surface.vertices_m)
        step.reset()
        step.add(path.select(slice(row, row + 1)))
        film, open_film = film + step.film_um * (1.0 - 0.8 * ~seen), open_film + step.film_um
    return film, 1.0 - film.sum() / open_film.sum()


@pytest.fixture(scope='module')
def expected(tray, path):
    film, lost = traced_everywhere(tray, path)
    assert 0.05 < lost < 0.5
    return film


@pytest.mark.parametrize('at_once', [10_000, 7])
def test_the_film_is_that_of_all_points_traced(tray, path, expected, at_once):
    film = FilmIntegrator(tray.points(), SHADED, 'double', tray.occluder)
    for start in range(0, len(path), at_once):
        film.add(path.select(slice(start, start + at_once)))
    # Beyond the pattern's reach, where the flux is a millionth of the peak, nothing is traced.
    assert np.abs(film.film_um - expected).max() < 1e-6 * expected.max()


def test_a_prepared_path_serves_a_wider_pattern(tray, path):
    wide = SHADED.model_copy(update={'planar': PlanarPattern(r_m=0.2, sigma1_m=0.09)})
    prepared = FilmIntegrator(tray.points(), SHADED, 'double', tray.occluder)
    steps = prepared.steps(path)
    prepared.use(wide)
    prepared.paint(steps)
    film = FilmIntegrator(tray.points(), wide, 'double', tray.occluder)
    film.add(path)
    assert np.abs(prepared.film_um - film.film_um).max() < 1e-5 * film.film_um.max()
