"""What to spray and measure next: rivals that look alike must look different afterwards."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import paint_deposition as pd
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.design import next_experiment
from paint_deposition.inference.design.contenders import Forecast, contenders_of, one_by_one
from paint_deposition.inference.design.sprays import MENU, together
from paint_deposition.inference.diagnosis.gaussian import NullModel
from paint_deposition.inference.diagnosis.verdict import Diagnosis, EffectClass, Step, Unknown
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.study import Study

BY_KEY = {change.key: change for change in MENU}


@pytest.fixture(scope='module')
def study(repository):
    """One panel of a sample study."""
    folder = repository / 'ros2_ws/src/paint_deposition/samples/panel_study'
    return Study.of(pd.Campaign(pd.read_campaign(folder / 'campaign.yaml').experiments[:1]))


@pytest.fixture(scope='module')
def fit(study):
    return study.fit(FreeParameters.of(pd.DepositionModel()), starts=3)


@pytest.mark.slow
def test_a_rolled_gun_tells_air_from_a_tool_and_places_lie_apart(study, fit):
    """The air drifts in the booth, or the tool is off its point in its own frame."""
    (panel,) = study.campaign.experiments
    acting = fit.model.with_effect(EFFECTS['air_drift'](shift_down_m=0.03))
    film_um = Forward(study.campaign, acting.effects).predict_um(acting)
    noise_um = study.gauge_um * np.random.default_rng(2).normal(size=len(film_um))
    places_m = panel.measured_points.positions_m
    readings = pd.Readings.of(places_m, film_um + noise_um, sigma_um=study.gauge_um)
    drifting = Study.of(pd.Campaign((panel.with_readings(readings),)), acting.effects)
    found = drifting.fit(FreeParameters.of(fit.model))
    group = EffectClass(('air_drift', 'tcp_offset'), 0.9, 'air_drift')
    rivals = contenders_of(diagnosed(drifting, found, group), EFFECTS)
    places, sprays = next_experiment.propose(drifting, rivals)
    by_changes = {spray.changes: spray for spray in sprays}
    rolled = by_changes['roll_180',]
    assert rolled.separates == ('air_drift', 'tcp_offset', 'footprint')
    assert rolled.separation > 2.0 * rolled.now
    # Half a turn of the part in the booth does to the air what half a turn of the gun does to it.
    assert by_changes['upside_down',].separation > 0.8 * rolled.separation
    assert rolled.chance > 0.7
    assert ('reverse_order',) not in by_changes
    spot = by_changes['standing', 'roll_180']
    assert spot.separation > 2.0 * spot.now
    told = spot.to_dict()['stand']
    assert told['dwell_s'] > 0.5
    assert f'{told["dwell_s"]:.1f} s' in spot.what
    assert told['peak_um'] <= drifting.measured_um.max()
    at = np.array([told['x_m'], told['y_m'], told['z_m']])
    (row,) = np.flatnonzero((places_m == at).all(axis=1))
    assert told['film_um'] == pytest.approx(drifting.measured_um[row])
    positions = np.array([place.position_m for place in places])
    at = panel.surface.at(positions)
    assert at.positions_m == pytest.approx(positions, abs=1e-9)
    assert (at.edge_distance_m > next_experiment.EDGE_MARGIN_M).all()
    apart = np.linalg.norm(positions[:, np.newaxis] - positions, axis=2)
    assert (apart + np.eye(len(places)) > next_experiment.SPACING_M).all()
    assert places[0].why.startswith(('separates air_drift', 'separates tcp_offset'))
    told = places[0].to_dict()
    assert [told[axis] for axis in ('x_m', 'y_m', 'z_m')] == positions[0].tolist()
    assert (told['experiment'], told['why']) == (places[0].experiment, places[0].why)
    film_um = np.array([place.film_um for place in places])
    assert 0.2 * drifting.measured_um.mean() < film_um.min() < film_um.max() < 100.0


def test_without_voltage_what_needs_it_is_gone(study):
    experiment = BY_KEY['voltage_off'].made(study.campaign.experiments[0])
    ridge, drift = EFFECTS['convex_attraction'].typical(), EFFECTS['air_drift'](shift_down_m=0.03)
    left = pd.DepositionModel(effects=(ridge, drift)).without(experiment.switched_off)
    assert left.effect('convex_attraction').is_neutral
    assert left.effect('air_drift') == drift


@pytest.mark.parametrize('change', MENU, ids=lambda change: change.key)
def test_every_spray_is_the_same_paint_another_way(study, change):
    experiment = study.campaign.experiments[0]
    changed = change.made(experiment).path
    share = {'half_flow': 0.5, 'double_flow': 2.0, 'half_speed': 2.0, 'double_speed': 0.5}
    if change.key == 'turned':
        before, after = (np.median(p.speed_m_per_s) for p in (experiment.path, changed))
        assert after == pytest.approx(before, rel=0.02)
    elif change.key != 'longer_open':
        expected = share.get(change.key, 1.0) * experiment.path.spraying_time_s
        assert changed.spraying_time_s == pytest.approx(expected)
    rotation = changed.rotation
    assert np.linalg.det(rotation) == pytest.approx(np.ones(len(rotation)))
    assert np.isfinite(changed.position_m).all()


@pytest.mark.parametrize('key', ['reverse_order', 'other_way', 'upside_down'])
def test_done_twice_changes_nothing(study, key):
    experiment = study.campaign.experiments[0]
    change = BY_KEY[key]
    twice = together(change, change).made(experiment)
    assert np.array_equal(twice.surface.down, experiment.surface.down)
    before, after = experiment.path, twice.path
    rows = before.flow > 0.0
    for column in ('rotation', 'velocity_m_per_s', 'since_on_s', 'from_turn_m', 'spray_pass'):
        assert np.array_equal(getattr(after, column)[rows], getattr(before, column)[rows]), column
    assert after.time_s[rows] == pytest.approx(before.time_s[rows], abs=1e-9)


def diagnosed(study, fit, *classes: EffectClass, accepted=(), unknown=None) -> Diagnosis:
    step = Step('', fit, 1.0, 1.0, 1.0)
    return Diagnosis(study, 'undecided', '', 0.01, accepted, classes, (step,), unknown)


def test_all_of_the_leading_group_compete_and_the_shapeless_cause_where_it_does(study, fit):
    alone = EffectClass(('air_drift',), 0.6, 'air_drift')
    group = replace(alone, members=('air_drift', 'tcp_offset', 'tcp_tilt'))
    other = EffectClass(('fog_gradient',), 0.3, 'fog_gradient')
    unknown = Unknown('tool_x_m', 0.01, {}, '', '', (), '', 0.0, 0.0)
    for diagnosis, expected in (
        (diagnosed(study, fit, group, other), ('air_drift', 'tcp_offset', 'tcp_tilt')),
        (diagnosed(study, fit, alone, other), ('air_drift', 'fog_gradient')),
        (diagnosed(study, fit, alone, unknown=unknown), ('air_drift', 'unknown')),
    ):
        # The pattern may always be another one.
        names = tuple(contender.name for contender in contenders_of(diagnosis, EFFECTS))
        assert names == (*expected, 'footprint')
    settled = diagnosed(study, fit, alone, other, accepted=('air_drift',))
    for diagnosis in (diagnosed(study, fit), settled):
        assert contenders_of(diagnosis, EFFECTS) == ()
        assert next_experiment.with_proposals(diagnosis, EFFECTS).proposals == ((), ())
    assert contenders_of(diagnosed(study, fit, group), {}) == ()


READINGS, DRAWS = 6, 40_000


def forecast(spread: float = 1.0) -> Forecast:
    """Two effects and the footprint: other means, and covariances as unlike as this."""
    rng = np.random.default_rng(3)
    means = rng.normal(size=(3, READINGS))
    roots = spread * rng.normal(size=(3, READINGS, 2))
    covariances = np.eye(READINGS) + roots @ roots.transpose(0, 2, 1)
    contenders = [SimpleNamespace(is_effect=is_effect) for is_effect in (True, True, False)]
    return Forecast(contenders, np.array([0.0, 0.4, 1.0]), means, np.linalg.cholesky(covariances))


def test_the_log_odds_are_those_of_drawn_readings_and_nothing_tells_between_the_same():
    told = forecast()
    each = zip(told.means, told.factors, strict=True)
    laws = [multivariate_normal(mean, factor @ factor.T) for mean, factor in each]
    for true, other in ((0, 1), (1, 0), (0, 2)):
        readings = laws[true].rvs(DRAWS, np.random.default_rng(4))
        drawn = told.odds[true, other] + laws[true].logpdf(readings) - laws[other].logpdf(readings)
        mean, variance = told.gains[:, true, other]
        error = drawn.std() / np.sqrt(DRAWS)
        assert told.odds[true, other] + mean == pytest.approx(drawn.mean(), abs=4.0 * error)
        assert variance == pytest.approx(drawn.var(), rel=0.05)
    means, factors = np.tile(told.means[0], (3, 1)), np.tile(told.factors[0], (3, 1, 1))
    same = replace(told, log_weight=np.zeros(3), means=means, factors=factors)
    assert same.separations == pytest.approx((0.0, 0.0), abs=1e-6)
    assert same.chance == 0.0
    # Equal errors leave the distance of the means.
    told = forecast(spread=0.0)
    two = Forecast(told.contenders[:2], np.zeros(2), told.means[:2], told.factors[:2])
    away = float(np.linalg.norm(told.means[1] - told.means[0]))
    assert two.separations == pytest.approx((0.0, away))


@pytest.mark.parametrize(('spread', 'alike', 'tolerance'), [(1.0, True, 1e-6), (0.5, False, 0.15)])
def test_single_readings_add_up_to_all_of_them(spread, alike, tolerance):
    """With errors that differ the mean of what is read so far goes on: about as much."""
    told = forecast(spread)
    if alike:
        told = replace(told, factors=np.tile(told.factors[0], (3, 1, 1)))
    usable = np.ones(READINGS, dtype=bool)
    for reading, _, (_, found) in one_by_one(told, usable):
        usable[reading], reached = False, found
    assert reached == pytest.approx(told.separations[1], rel=tolerance)


def test_some_readings_are_predicted_from_others():
    rng = np.random.default_rng(5)
    columns, raw = rng.normal(size=(9, 4)), rng.normal(size=9)
    null = NullModel.of(columns, raw)
    mean, factor = null.predicted(6)
    first, anew = null.first(6), NullModel.of(columns[:6], raw[:6])
    assert first.lower == pytest.approx(anew.lower)
    assert first.deviation == pytest.approx(anew.deviation)
    covariance = np.eye(9) + columns @ columns.T
    slope = covariance[6:, :6] @ np.linalg.inv(covariance[:6, :6])
    assert mean == pytest.approx(slope @ raw[:6])
    assert factor @ factor.T == pytest.approx(covariance[6:, 6:] - slope @ covariance[:6, 6:])
