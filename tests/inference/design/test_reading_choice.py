"""Points for the gauge, and a gun that stands still before one of them."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

import paint_deposition as pd
from booth import MODEL, panel, path_of, serpentine
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.errors import ReadingsError
from paint_deposition.inference.design import reading_choice
from paint_deposition.inference.design.proposals import Spray, StationarySpray, spots, suits
from paint_deposition.inference.design.reading_choice import CandidateDesign, choose, design_at
from paint_deposition.inference.design.sprays import MENU
from paint_deposition.inference.design.unmeasured_part import UnmeasuredPart
from paint_deposition.inference.diagnosis.model_space import SIZES
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.readings.places import grid_places


def on_panel(*names: str) -> UnmeasuredPart:
    """The panel under three level passes that overlap."""
    path = path_of(serpentine((0.12, 0.0, -0.12), opens_at_m=0.4, period_s=0.1))
    return UnmeasuredPart(panel(), path, MODEL, {name: EFFECTS[name] for name in names})


def test_noncentrality_is_what_no_model_can_imitate_and_power_that_of_the_ratio():
    """Against the covariance of noise and model parameters, built in full."""
    random, rows = np.random.default_rng(4), np.arange(0, 40, 3)
    free, columns = 3.0 * random.normal(size=(40, 3)), random.normal(size=(40, 5))
    design = CandidateDesign(free, columns, np.array([*'aabcd']))
    free, columns = design.free[rows], design.columns[rows]
    covariance = np.eye(len(rows)) + free @ free.T
    exact = np.diag(columns.T @ np.linalg.solve(covariance, columns))
    np.testing.assert_allclose(design.beyond_model(rows)[2], exact, rtol=1e-9)
    # Both tails of a normal score are one tail of the noncentral chi-square.
    strength = np.array([0.0, 2.0, 8.0])
    limit = chi2.isf(0.05 / 6, 1)
    squares = np.maximum(np.multiply.outer(strength, SIZES**2), 1e-12)
    exact = ncx2.sf(limit, 1, squares).mean(axis=1)
    np.testing.assert_allclose(reading_choice.power(strength, 6), exact, rtol=1e-6)


def test_places_taken_one_by_one_are_about_the_best_of_all_sets():
    """Few places, so that all sets can be tried."""
    random = np.random.default_rng(8)
    free, columns = random.normal(size=(10, 1)), 2.0 * random.normal(size=(10, 3))
    design = CandidateDesign(free, columns, np.array(['a', 'b', 'c']))

    def worth(rows: np.ndarray) -> float:
        return float(reading_choice.power(design.beyond_model(rows)[2], 3).mean())

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
    designs = (design_at(part, rows) for rows in (chosen.vertices, places))
    found, even = (design.beyond_model(np.arange(12))[2].min() for design in designs)
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


def test_a_part_without_paint_and_impossible_wishes_are_refused():
    part = on_panel('flow_drift')
    aside = part.path.with_(position_m=np.add(part.path.position_m, [0.0, 0.0, 5.0]))
    with pytest.raises(ReadingsError, match='no paint lands'):
        choose(replace(part, path=aside), 12)
    for wish, foot_m, words in (((4, 0), 0.015, '12 to 400'), ((20, 21), 0.015, 'ask for 0 to 20'),
                                ((300, 0), 0.6, 'room for 0')):  # fmt: skip
        with pytest.raises(ReadingsError, match=words):
            choose(part, *wish, foot_m=foot_m)


BELL = pd.DepositionModel()
MOST_UM = 25.0


@pytest.fixture(scope='module')
def sample_panel(sample):
    return sample.experiments[0]


@pytest.fixture(scope='module')
def one(sample_panel) -> StationarySpray:
    return StationarySpray.before(sample_panel, spots(sample_panel, 1)[0], BELL, MOST_UM)


def film_um(sample_panel, one, model=BELL):
    return Forward(pd.Campaign((one.sprayed(sample_panel),)), model.effects).predict_um(model)


def test_the_gun_stands_square_before_a_spot_as_far_and_as_long_as_suits(sample_panel, one):
    path = one.sprayed(sample_panel).path
    assert path.rotation[:, :, 2] == pytest.approx(np.tile(-one.normal, (len(path), 1)), abs=1e-9)
    away = path.position_m - one.position_m
    assert np.linalg.norm(away, axis=1) == pytest.approx(one.standoff_m, abs=1e-9)
    assert path.spraying_time_s == pytest.approx(one.dwell_s, abs=1e-9)
    assert path.speed_m_per_s.max() == 0.0
    # The tool is turned about its axis as it was on the passes.
    assert one.across @ sample_panel.path.rotation[0, :, 0] > 0.99
    # The film stays within the one given and comes near it.
    film = film_um(sample_panel, one)
    assert 0.7 * MOST_UM < film.max() <= one.peak_um <= MOST_UM
    half = film_um(sample_panel, replace(one, dwell_s=0.5 * one.dwell_s))
    assert half == pytest.approx(0.5 * film, rel=1e-9)
    spot = spots(sample_panel, 1)[0]
    (nearer,) = (change.made(sample_panel) for change in MENU if change.key == 'closer')
    closer = StationarySpray.before(nearer, spot, BELL, MOST_UM)
    assert closer.dwell_s < one.dwell_s
    assert 0.7 * MOST_UM < film_um(sample_panel, closer).max() <= MOST_UM
    # Half a second is needed: the trigger is not quick enough for less film.
    assert StationarySpray.before(sample_panel, spot, BELL, 0.1) is None


@pytest.mark.parametrize('name', ['corner_slowdown', 'gun_wake', 'pose_lag'])
def test_effects_of_motion_do_not_show(sample_panel, one, name):
    effect = EFFECTS[name].typical()
    model = BELL.model_copy(update={'effects': (effect,)})
    passes = Forward(pd.Campaign((sample_panel,)), (effect,))
    assert np.abs(passes.predict_um(model) - passes.predict_um(BELL)).max() > 1e-4
    assert film_um(sample_panel, one, model) == pytest.approx(film_um(sample_panel, one), abs=1e-9)


def test_effects_of_a_whole_job_do_not_suit_a_spot_and_a_film_that_may_sag_is_told():
    assert suits(BELL, {'lateral shift', 'curvature'})
    assert not suits(BELL, {'lateral shift', 'order'})
    fog = BELL.model_copy(update={'effects': (EFFECTS['overspray_fog'].typical(),)})
    assert not suits(fog, {'lateral shift'})
    thick = Spray('the same passes at twice the flow', ('a', 'b'), 4.0, 1.0, peak_um=60.0,
                  peak_now_um=30.0)  # fmt: skip
    assert thick.film_words == 'the film will reach 60 µm, now 30: see that it does not sag'
    assert replace(thick, peak_um=33.0).film_words == ''
