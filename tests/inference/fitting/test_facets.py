"""Facets of a coarse mesh in the noise of the inference."""

import numpy as np
import pytest

from booth import MODEL, painted, path_of, serpentine
from paint_deposition.inference.fitting.sifting import sifted
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.part.surface import Surface
from surfaces import triangulated

RADIUS_M, HALF_M, COARSE_M, FINE_M = 0.15, 0.1, 0.05, 0.004
PATH = path_of(serpentine((0.06, -0.04), opens_at_m=0.3, period_s=0.05))


def fold(edge_m: float) -> Surface:
    """Flat below, part of a pipe above."""

    def depth(x, z):
        return RADIUS_M - np.sqrt(RADIUS_M**2 - np.maximum(z, 0.0) ** 2)

    return Surface.from_triangles(*triangulated(depth, edge_m, HALF_M, jitter=0.2), 0.008)


def study(edge_m: float, sigma_um: float = 0.1, count: int = 120) -> Study:
    """Readings on the fine part, diagnosed on one with edges of this length."""
    fine = fold(FINE_M)
    film_um = painted(fine, PATH).raw_um
    rng = np.random.default_rng(3)
    at = rng.choice(np.flatnonzero(film_um > 1.0), count, replace=False)
    noisy_um = film_um[at] + sigma_um * rng.normal(size=count)
    readings = Readings.of(
        fine.vertices_m[at], noisy_um, normals=fine.normals[at],
        sigma_um=np.full(count, sigma_um),
    )  # fmt: skip
    experiment = Experiment.of('fold', fold(edge_m), PATH, readings)
    return sifted(Campaign((experiment,)), MODEL)[0]


@pytest.fixture(scope='module')
def coarse() -> Study:
    return study(COARSE_M)


def test_facets_are_told_of_and_are_a_direction_of_the_noise(coarse):
    assert any('The mesh of fold is coarser' in note for note in coarse.notes)
    assert coarse.nuisance.shape == (len(coarse), 1)


def test_the_direction_explains_what_the_facets_cost(coarse):
    """The model is the true one: what is left of the readings is noise and facets."""
    left_um = coarse.measured_um - coarse.forward.predict_um(MODEL)
    amount = left_um @ coarse.facet_um / (coarse.facet_um @ coarse.facet_um)
    assert 0.5 < amount < 1.5
    assert np.var(left_um - amount * coarse.facet_um) < 0.7 * np.var(left_um)


def test_points_keep_their_facets_when_others_are_left_out(coarse):
    kept = np.arange(len(coarse)) % 3 > 0
    some = coarse.of_points(kept)
    np.testing.assert_array_equal(some.facet_um, coarse.facet_um[kept])
    np.testing.assert_array_equal(some.nuisance, coarse.nuisance[kept])


def test_a_fine_mesh_has_none():
    fine = study(FINE_M)
    assert fine.nuisance.shape[1] == 0
    assert not any('coarser' in note for note in fine.notes)
