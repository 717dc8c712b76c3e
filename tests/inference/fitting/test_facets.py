"""Facets of a coarse mesh in the noise of the inference."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from booth import MODEL, painted, path_of, serpentine
from inference.fitting.panels import reading
from paint_deposition.inference.fitting.cleaning import clean_and_fit
from paint_deposition.inference.fitting.random_effects import amounts
from paint_deposition.inference.readings.campaign import Experiment
from surfaces import refined

RADIUS_M, HALF_M, COARSE_M, FINE_M = 0.15, 0.1, 0.05, 0.004
PATH = path_of(serpentine((0.06, -0.04), opens_at_m=0.3, period_s=0.05))


def fold(edge_m: float) -> pd.Surface:
    """Flat below, part of a pipe above."""

    def depth(x, z):
        return RADIUS_M - np.sqrt(RADIUS_M**2 - np.maximum(z, 0.0) ** 2)

    return refined(depth, edge_m, 0.008, half_width_m=HALF_M, jitter=0.2)


def measured(edge_m: float, sigma_um: float = 0.1, count: int = 120, seed: int = 3) -> Experiment:
    """Readings on the fine part, set beside one with edges of this length."""
    fine = fold(FINE_M)
    film_um = painted(fine, PATH).raw_um
    rng = np.random.default_rng(seed)
    at = rng.choice(np.flatnonzero(film_um > 1.0), count, replace=False)
    noisy_um = film_um[at] + sigma_um * rng.normal(size=count)
    readings = pd.Readings.of(
        fine.vertices_m[at], noisy_um, normals=fine.normals[at],
        sigma_um=np.full(count, sigma_um),
    )  # fmt: skip
    return Experiment.of('fold', fold(edge_m), PATH, readings)


def study(edge_m: float):
    return clean_and_fit(pd.Campaign((measured(edge_m),)), MODEL)[0]


def test_facets_of_a_coarse_mesh_are_noise_which_points_keep_and_a_fine_one_has_none():
    coarse = study(COARSE_M)
    assert any('The mesh of fold is coarser' in note for note in coarse.notes)
    assert coarse.nuisance.shape == (len(coarse), 0)
    without = replace(coarse, facet_um=None)
    assert coarse.sigma_um == pytest.approx(np.hypot(without.sigma_um, coarse.facet_um))
    kept = np.arange(len(coarse)) % 3 > 0
    some = coarse.of_points(kept)
    np.testing.assert_array_equal(some.facet_um, coarse.facet_um[kept])
    np.testing.assert_array_equal(some.sigma_um, coarse.sigma_um[kept])
    fine = study(FINE_M)
    assert fine.facet_um is None
    assert not any('coarser' in note for note in fine.notes)
    # The model is the true one: what is left of the readings is noise and facets.
    left_um = coarse.measured_um - coarse.forward.predict_um(MODEL)
    amount = left_um @ coarse.facet_um / (coarse.facet_um @ coarse.facet_um)
    assert 0.5 < amount < 1.5
    assert np.var(left_um - amount * coarse.facet_um) < 0.7 * np.var(left_um)


def test_levels_of_parts_are_told_beside_their_facets():
    """Two parts 3 % off either way, on a mesh whose facets cost more than the gauge's noise."""
    parts = []
    for seed, (name, level) in enumerate((('thick', 1.03), ('thin', 0.97))):
        part = replace(measured(COARSE_M, seed=seed), name=name)
        parts.append(reading(part, level * part.readings.thickness_um))
    found, fit = clean_and_fit(pd.Campaign(tuple(parts)), MODEL)
    assert np.abs(found.facet_um).max() > 3.0 * found.gauge_um.max()
    by_name = {(a.kind, a.of): a for a in amounts(fit, found.random_effects)}
    for name, level in (('thick', 3.0), ('thin', -3.0)):
        amount = by_name['part level', name]
        assert amount.value == pytest.approx(level, abs=3.0 * amount.sd)
        assert amount.sd < 0.7
        assert amount.is_notable
