"""What to spray and measure next: rivals that look alike must look different afterwards."""

from dataclasses import replace

import numpy as np
import pytest

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.inference.diagnosis.discrepancy import PRIOR
from paint_deposition.inference.diagnosis.explanations import FACTOR
from paint_deposition.inference.diagnosis.next_experiment import (
    EDGE_MARGIN_M,
    SPACING_M,
    propose,
    with_proposals,
)
from paint_deposition.inference.diagnosis.rivals import Rivals, rivals_of
from paint_deposition.inference.diagnosis.smooth_laws import RADII, footprint_along
from paint_deposition.inference.diagnosis.sprays import MENU, together
from paint_deposition.inference.diagnosis.verdict import Diagnosis, EffectClass, Step, Unknown
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign

BY_KEY = {change.key: change for change in MENU}


@pytest.fixture(scope='module')
def study(sample):
    """The panel alone."""
    return Study.of(Campaign(sample.experiments[:1]))


@pytest.fixture(scope='module')
def fit(study):
    return study.fit(FreeParameters.of(DepositionModel()), starts=3)


def rivals(study, fit, *names):
    return Rivals.of(study, fit, {name: EFFECTS.get(name, name) for name in names})


@pytest.fixture(scope='module')
def drift_or_tool(study, fit):
    """Drifting air, or a tool that is off its point."""
    return propose(rivals(study, fit, 'air_drift', 'tcp_offset'))


def best_of(sprays, key):
    """The spray with this change alone."""
    return next(spray for spray in sprays if spray.changes == (key,))


@pytest.mark.slow
def test_a_rolled_gun_tells_drifting_air_from_a_wrong_tool(drift_or_tool):
    """The air drifts in the booth, the tool is off in its own frame."""
    _, sprays = drift_or_tool
    rolled = best_of(sprays, 'roll_180')
    assert rolled.separates == ('air_drift', 'tcp_offset')
    assert rolled.separation > 2.0 * rolled.now
    # Half a turn of the part in the booth does to the air what half a turn of the gun does to it.
    assert best_of(sprays, 'upside_down').separation > 0.8 * rolled.separation
    # The order of the passes tells nothing of it: it is not among the best.
    assert all(spray.changes != ('reverse_order',) for spray in sprays)


@pytest.mark.slow
def test_a_rolled_gun_on_one_spot_tells_the_air_from_the_tool(study, drift_or_tool):
    (panel,) = study.campaign.experiments
    spot = next(s for s in drift_or_tool[1] if s.changes == ('standing', 'roll_180'))
    assert spot.separation > 2.0 * spot.now
    told = spot.to_dict()['stand']
    assert told['dwell_s'] > 0.5
    assert f'{told["dwell_s"]:.1f} s' in spot.what
    assert told['peak_um'] <= study.measured_um.max()
    at = np.array([told['x_m'], told['y_m'], told['z_m']])
    (row,) = np.flatnonzero((panel.measured_points.positions_m == at).all(axis=1))
    assert told['film_um'] == pytest.approx(panel.means.mean_um[row])


@pytest.mark.slow
def test_another_footprint_competes_as_the_law_that_would_be_learned(study, fit):
    found = rivals(study, fit, 'tcp_offset', 'footprint')
    predicted = found.here[1]
    # Its amplitudes are not free: what they need of their prior is separation, too.
    assert predicted.precision == pytest.approx(1.0 / 9.0)
    basis = footprint_along(study.rays(fit.model), fit.model.patterns)
    random = basis.random(FACTOR, PRIOR.footprint_lengths[0] * RADII)
    law = random.learned(1e-3 * predicted.amounts)
    film_um = [
        Forward(study.campaign, (law,)).predict_um(
            fit.model.model_copy(update={'effects': effects})
        )
        for effects in ((), (law,))
    ]
    change = 1e3 * (film_um[1] - film_um[0]) / study.sigma_um
    assert np.linalg.norm(predicted.change) > 1.0
    assert np.linalg.norm(predicted.change - change) < 0.05 * np.linalg.norm(change)


@pytest.mark.slow
def test_places_lie_on_the_surface_apart_and_off_the_edge(study, fit, drift_or_tool):
    places, sprays = drift_or_tool
    positions = np.array([place.position_m for place in places])
    surface = study.campaign.experiments[0].surface
    at = surface.at(positions)
    assert at.positions_m == pytest.approx(positions, abs=1e-9)
    assert (at.edge_distance_m > EDGE_MARGIN_M).all()
    apart = np.linalg.norm(positions[:, np.newaxis] - positions, axis=2)
    assert (apart + np.eye(len(places)) > SPACING_M).all()
    # The same measure as that of the sprays, from the readings at hand on.
    assert f': {sprays[0].now:.1f} to ' in places[0].why
    film_um = np.array([place.film_um for place in places])
    assert 0.2 * study.measured_um.mean() < film_um.min() < film_um.max() < 100.0


def test_without_voltage_what_needs_it_is_gone(study):
    experiment = BY_KEY['voltage_off'].made(study.campaign.experiments[0])
    model = DepositionModel(effects=(EFFECTS['edge_build'].typical(), AirDrift(shift_down_m=0.03)))
    left = model.without(experiment.switched_off)
    assert left.effect('edge_build').is_neutral
    assert left.effect('air_drift') == AirDrift(shift_down_m=0.03)


@pytest.mark.parametrize('change', MENU, ids=lambda change: change.key)
def test_every_spray_is_the_same_paint_another_way(study, change):
    experiment = study.campaign.experiments[0]
    changed = change.made(experiment).path
    share = {'half_flow': 0.5, 'double_flow': 2.0, 'half_speed': 2.0, 'double_speed': 0.5}
    if change.key == 'turned':
        assert np.median(changed.speed_m_per_s) == pytest.approx(
            np.median(experiment.path.speed_m_per_s), rel=0.02
        )
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
    step = Step('', fit, 1.0, 1.0)
    return Diagnosis(study, 'undecided', '', 0.01, accepted, classes, (step,), unknown)


def test_all_of_the_leading_group_compete_and_the_shapeless_cause_where_it_does(study, fit):
    alone = EffectClass(('air_drift',), 0.6, 'air_drift')
    group = replace(alone, members=('air_drift', 'tcp_offset', 'tcp_tilt'))
    other = EffectClass(('fog_gradient',), 0.3, 'fog_gradient')
    unknown = Unknown('tool_x_m', 0.01, {}, '', (), '', 0.0, 0.0)
    for diagnosis, expected in (
        (diagnosed(study, fit, group, other), ('air_drift', 'tcp_offset', 'tcp_tilt')),
        (diagnosed(study, fit, alone, other), ('air_drift', 'fog_gradient')),
        (diagnosed(study, fit, alone, unknown=unknown), ('air_drift', 'unknown')),
    ):
        # The pattern may always be another one.
        assert rivals_of(diagnosis, EFFECTS).names == (*expected, 'footprint')
    settled = diagnosed(study, fit, alone, other, accepted=('air_drift',))
    for diagnosis in (diagnosed(study, fit), settled):
        assert rivals_of(diagnosis, EFFECTS) is None
        assert with_proposals(diagnosis, EFFECTS).proposals == ((), ())
    assert rivals_of(diagnosed(study, fit, group), {}) is None


def test_all_errors_of_the_figures_are_of_one_residual(study, fit):
    step = Step.of(study, '', fit)
    found = replace(diagnosed(study, fit), history=(step,)).to_dict()
    errors = {'rmse_before_um': step.rmse_um, 'rmse_after_um': step.rmse_um}
    assert found['experiments'] == [{'name': study.campaign.experiments[0].name} | errors]
    assert found['rmse_um']['before'] == step.rmse_um
    assert found['rmse_um']['left_out'] in ('experiments', 'points')
