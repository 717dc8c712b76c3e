"""What to spray and measure next: rivals that look alike must look different afterwards."""

from dataclasses import replace

import numpy as np
import pytest

from paint_deposition.diagnosis.next_experiment import (
    EDGE_MARGIN_M,
    MENU,
    SPACING_M,
    Rivals,
    propose,
    propose_for,
)
from paint_deposition.diagnosis.verdict import Diagnosis, EffectClass, Interval, Step
from paint_deposition.effects.base import PathContext
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.effects.library.fog_gradient import FogGradient
from paint_deposition.effects.library.pose_lag import PoseLag
from paint_deposition.effects.library.tcp_offset import TcpOffset
from paint_deposition.effects.library.tcp_tilt import TcpTilt
from paint_deposition.effects.library.trigger_lag import TriggerLag
from paint_deposition.fitting.parameters import FreeParameters
from paint_deposition.fitting.study import Study
from paint_deposition.model.projection import Projection
from paint_deposition.readings.campaign import Campaign

ROLLED = 'the same passes with the gun rolled 180 deg about its axis'
REVERSED = 'the same passes in reverse order and direction'


@pytest.fixture(scope='module')
def study(sample):
    """The panel alone."""
    return Study.of(Campaign(sample.experiments[:1]))


@pytest.fixture(scope='module')
def fit(study):
    return study.fit(FreeParameters.of(DepositionModel()), starts=3)


@pytest.mark.parametrize(('rival', 'growth'), [(TcpOffset(), 5.0), (TcpTilt(), 3.0)])
def test_a_rolled_gun_tells_drifting_air_from_a_wrong_tool(study, fit, rival, growth):
    """The air drifts in the booth, the tool is off in its own frame."""
    _, sprays = propose(study, Rivals(fit, AirDrift(shift_down_m=0.03), rival))
    assert sprays[0].what == ROLLED
    assert sprays[0].separates == ('air_drift', rival.id)
    assert sprays[0].separation > growth * sprays[0].now
    assert sprays[0].separation > 2.0 * sprays[1].separation


def test_the_reverse_order_tells_drifting_flow_from_fog(study, fit):
    _, sprays = propose(study, Rivals(fit, FlowDrift(drift_per_pass=0.04), FogGradient()))
    assert sprays[0].what == REVERSED
    assert sprays[0].separation > 1.5 * sprays[1].separation


def test_no_spray_makes_rivals_more_alike(study, fit):
    _, sprays = propose(study, Rivals(fit, AirDrift(shift_down_m=0.03), TcpOffset()))
    assert len(sprays) == len(MENU)
    assert sprays == sorted(sprays, key=lambda spray: -spray.separation)
    assert all(spray.separation >= spray.now - 1e-6 for spray in sprays)


def test_an_effect_differs_from_another_by_no_more_than_it_does(study, fit):
    drift = AirDrift(shift_down_m=0.03)
    _, sprays = propose(study, Rivals(fit, drift, TcpOffset()))
    change = study.forward.predict_um(fit.model.with_effect(drift)) - fit.predicted_um
    assert 0.0 < sprays[0].now < np.linalg.norm(change / study.sigma_um)


def test_places_lie_on_the_surface_apart_and_off_the_edge(study, fit):
    places, _ = propose(study, Rivals(fit, AirDrift(shift_down_m=0.03), TcpOffset()))
    assert places
    positions = np.array([place.position_m for place in places])
    surface = study.campaign.experiments[0].surface
    at = surface.at(positions)
    assert at.positions_m == pytest.approx(positions, abs=1e-9)
    assert (at.edge_distance_m > EDGE_MARGIN_M).all()
    apart = np.linalg.norm(positions[:, np.newaxis] - positions, axis=2)
    assert (apart + np.eye(len(places)) > SPACING_M).all()
    assert all('separates air_drift from tcp_offset' in place.why for place in places)


@pytest.mark.parametrize('name', MENU)
def test_every_spray_is_the_same_paint_another_way(study, name):
    experiment = study.campaign.experiments[0]
    changed = MENU[name](experiment.path, experiment)
    share = 0.5 if 'half the flow' in name else 1.0
    assert changed.spraying_time_s == pytest.approx(share * experiment.path.spraying_time_s)
    rotation = changed.rotation
    assert np.linalg.det(rotation) == pytest.approx(np.ones(len(rotation)))
    assert np.abs(changed.position_m - experiment.path.position_m).max() <= 0.06 + 1e-9


def test_reversing_or_rolling_twice_changes_nothing(study):
    experiment = study.campaign.experiments[0]
    for name in (ROLLED, REVERSED):
        twice = MENU[name](MENU[name](experiment.path, experiment), experiment)
        spraying = experiment.path.flow > 0.0
        for column in ('rotation', 'velocity_m_per_s', 'since_on_s', 'from_turn_m', 'spray_pass'):
            before, after = getattr(experiment.path, column), getattr(twice, column)
            assert np.array_equal(after[spraying], before[spraying]), (name, column)


def diagnosed(study, fit, *classes: EffectClass, accepted=()) -> Diagnosis:
    step = Step('', fit, 1.0, 1.0)
    return Diagnosis(study, 'undecided', '', 0.01, accepted, classes, (step,))


@pytest.mark.slow
def test_the_rivals_are_the_leading_explanations(study, fit):
    shift = {'shift_down_m': Interval(0.03, 0.02, 0.04)}
    alone = EffectClass(('air_drift',), 0.6, 'air_drift', shift)
    both = replace(alone, members=('air_drift', 'tcp_offset', 'tcp_tilt'))
    other = EffectClass(('fog_gradient',), 0.3, 'fog_gradient')
    for classes, expected in (
        ((both, other), ('air_drift', 'tcp_offset')),
        ((alone, other), ('air_drift', 'fog_gradient')),
    ):
        places, sprays = propose_for(diagnosed(study, fit, *classes), EFFECTS)
        assert places
        assert sprays[0].separates == expected
    settled = diagnosed(study, fit, alone, other, accepted=('air_drift',))
    for diagnosis in (diagnosed(study, fit), diagnosed(study, fit, alone), settled):
        assert propose_for(diagnosis, EFFECTS) == ([], [])
    assert propose_for(diagnosed(study, fit, both), {}) == ([], [])


@pytest.mark.parametrize('lag', [TriggerLag(rise_s=0.05, fall_s=0.05), PoseLag(lag_s=0.02)])
def test_at_half_the_flow_the_tails_of_a_lag_are_half_too(study, lag):
    experiment = study.campaign.experiments[0]
    changed = MENU['the same passes at half the flow'](experiment.path, experiment)
    surface = experiment.surface
    context = PathContext(Projection(), surface.down, surface.outward, surface.centre_m)
    usual = lag.on_path(experiment.path, context)
    np.testing.assert_array_equal(lag.on_path(changed, context).flow, 0.5 * usual.flow)
