"""Points for the gauge: the design beside exact figures, and what it is worth on a part."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

from booth import MODEL, panel, path_of, serpentine
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.errors import ReadingsError
from paint_deposition.inference.design.reading_choice import (
    CandidateDesign,
    choose,
    design_at,
    power,
)
from paint_deposition.inference.design.unmeasured_part import UnmeasuredPart
from paint_deposition.inference.diagnosis.model_space import SIZES
from paint_deposition.inference.readings.gauge_places import grid_places


def on_panel(*names: str) -> UnmeasuredPart:
    """The panel under three level passes that overlap."""
    path = path_of(serpentine((0.12, 0.0, -0.12), opens_at_m=0.4, period_s=0.1))
    return UnmeasuredPart(panel(), path, MODEL, {name: EFFECTS[name] for name in names})


def test_noncentrality_is_what_the_model_cannot_imitate():
    """Against the covariance of noise and model parameters, built in full."""
    random, rows = np.random.default_rng(4), np.arange(0, 40, 3)
    design = CandidateDesign(
        3.0 * random.normal(size=(40, 3)), random.normal(size=(40, 5)), np.array([*'aabcd'])
    )
    free, columns = design.free[rows], design.columns[rows]
    covariance = np.eye(len(rows)) + free @ free.T
    exact = np.diag(columns.T @ np.linalg.solve(covariance, columns))
    np.testing.assert_allclose(design.beyond_model(rows)[2], exact, rtol=1e-9)


def test_power_is_that_of_the_likelihood_ratio():
    """Both tails of a normal score are one tail of the noncentral chi-square."""
    strength = np.array([0.0, 2.0, 8.0])
    limit = chi2.isf(0.05 / 6, 1)
    squares = np.maximum(np.multiply.outer(strength, SIZES**2), 1e-12)
    exact = ncx2.sf(limit, 1, squares).mean(axis=1)
    np.testing.assert_allclose(power(strength, 6), exact, rtol=1e-6)


def test_places_taken_one_by_one_are_about_the_best_of_all_sets():
    """Few places, so that all sets can be tried."""
    random = np.random.default_rng(8)
    free, columns = random.normal(size=(10, 1)), 2.0 * random.normal(size=(10, 3))
    design = CandidateDesign(free, columns, np.array(['a', 'b', 'c']))

    def worth(rows: np.ndarray) -> float:
        return float(power(design.beyond_model(rows)[2], 3).mean())

    apart = np.arange(10)[:, np.newaxis] * np.eye(3)[0]
    best = max(worth(np.array(rows)) for rows in combinations(range(10), 3))
    assert worth(design.best(apart, 3, 0.5)) >= 0.95 * best


def test_points_keep_off_edges_and_apart():
    chosen = choose(on_panel('air_drift', 'flow_drift', 'gauge_zero', 'edge_build'), 24)
    positions = chosen.positions_m
    assert np.abs(positions[:, [0, 2]]).max() <= 0.5 - chosen.foot_m
    distance = np.linalg.norm(positions[:, np.newaxis] - positions, axis=2)
    assert distance[~np.eye(len(chosen), dtype=bool)].min() >= chosen.apart_m
    assert chosen.expected_um.min() > 0.1 * chosen.film_um.max()


def test_an_effect_is_measured_where_it_shows():
    """A drift of the air moves the film where it is steep, across the passes."""
    part = on_panel('air_drift')
    chosen = choose(part, 12)
    places = grid_places(part.surface, chosen.film_um > 0.2 * chosen.film_um.max(), 12)
    found, even = (
        design_at(part, rows).beyond_model(np.arange(12))[2].min()
        for rows in (chosen.vertices, places)
    )
    assert found > 1.5 * even
    assert chosen.power['air_drift'] > chosen.grid_power['air_drift']
    assert all(effects in ((), ('air_drift',)) for effects in chosen.speaks_for)


def test_what_the_model_has_already_is_not_looked_for():
    part = on_panel('air_drift', 'flow_drift')
    part = replace(part, model=MODEL.with_effect(EFFECTS['air_drift'](shift_down_m=0.01)))
    assert list(part.candidates) == ['flow_drift']
    # Its amplitudes are free, as the pattern is.
    painted = np.flatnonzero(np.abs(part.surface.vertices_m).max(axis=1) < 0.03)
    assert design_at(part, painted).free.shape[1] > len(MODEL.planar.model_dump())


def test_a_part_without_paint_is_refused():
    part = on_panel('flow_drift')
    aside = part.path.with_(position_m=np.add(part.path.position_m, [0.0, 0.0, 5.0]))
    with pytest.raises(ReadingsError, match='no paint lands'):
        choose(replace(part, path=aside), 12)


@pytest.mark.parametrize(
    ('count', 'repeats', 'words'),
    [(4, 0, '12 to 400'), (20, 21, 'ask for 0 to 20'), (300, 0, 'room for 0')],
)
def test_impossible_wishes_are_refused(count, repeats, words):
    with pytest.raises(ReadingsError, match=words):
        choose(on_panel('flow_drift'), count, repeats, foot_m=0.6 if count == 300 else 0.015)
