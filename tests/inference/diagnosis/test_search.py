"""The search for missing effects between refitted models, on panels that the model painted."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from inference.fitting.panels import gauged
from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.effects.library.fog_gradient import FogGradient
from paint_deposition.inference.diagnosis.model_space import (
    COARSENED,
    PRIOR_EFFECT,
    PRIOR_UNKNOWN,
    SURE,
    log_odds,
)
from paint_deposition.inference.diagnosis.search import SAME, EffectSet, Search, SearchStage
from paint_deposition.inference.diagnosis.state import DiagnosisState
from paint_deposition.inference.fitting.least_squares import Fit, derivatives
from paint_deposition.inference.readings.campaign import Campaign

pytestmark = pytest.mark.slow

BASE = DepositionModel()
EDGE, DRIFT = EdgeBuild(gain=0.6, length_m=0.1), FlowDrift(drift_per_pass=0.06)
PLANTED = {'edge_build', 'flow_drift'}


class Twin(EdgeBuild):
    """An effect that readings cannot tell from edge build."""

    id = 'twin'


def searching(campaign: Campaign, library: Iterable[type[Effect]]) -> Search:
    known = {effect.id: effect for effect in library}
    return Search(DiagnosisState(campaign, BASE, known, seed=0, progress=lambda line: None))


@pytest.fixture(scope='module')
def search() -> Search:
    """On a panel on which two effects acted."""
    truth = BASE.with_effect(EDGE).with_effect(DRIFT)
    return searching(gauged(truth, seed=0, columns=5), (EdgeBuild, FlowDrift, AirDrift))


@pytest.fixture(scope='module')
def stages(search) -> list[SearchStage]:
    return search.stages()


@pytest.fixture(scope='module')
def clean() -> Search:
    """On a panel on which nothing acted."""
    return searching(gauged(BASE, seed=2), (FogGradient, FlowDrift, AirDrift))


def test_the_set_found_is_the_one_planted(search, stages):
    assert [len(stage.here.names) for stage in stages] == [0, 1, 2]
    assert stages[0].here is search.nothing
    assert stages[-1].here.names == PLANTED
    for stage, following in pairwise(stages):
        assert stage.chosen().names == following.here.names
        assert following.here.log_weight_alone > stage.here.log_weight_alone
    assert stages[-1].chosen() is stages[-1].here


def test_effects_are_fitted_beside_what_nature_leaves_over(stages):
    best = stages[-1].here
    assert best.fit.discrepancy is not None
    # A strong effect is fitted as weaker than it is, as what is usual is its prior.
    assert 0.6 * EDGE.gain < best.effects['edge_build'].gain < 1.1 * EDGE.gain
    drift = best.effects['flow_drift'].drift_per_pass
    assert 0.5 * DRIFT.drift_per_pass < drift < 1.1 * DRIFT.drift_per_pass
    # Amplitudes far from the typical ones are less unlikely than one size says.
    assert best.log_prior >= 2.0 * log_odds(PRIOR_EFFECT) - 1.0
    # One size of the discrepancy bears nearly all the weight of this set.
    everything = np.ones(len(best.run.study), dtype=bool)
    assert best.log_weight_of(everything) == pytest.approx(best.log_weight_alone, abs=1.5)
    # Something unknown beside it adds to it.
    assert best.log_weight >= best.log_weight_alone


def test_each_effect_of_the_set_is_sure_and_has_no_rival(search, stages):
    trial, groups = search.groups(stages[-1].here)
    assert trial.names == groups.keys() == PLANTED
    for name, (members, probability) in groups.items():
        assert members == (name,)
        assert probability > SURE
        others = search.without(trial, name)
        rivals = dict.fromkeys((name, *others.proposed))
        weights = [search.with_effect(others, rival).log_weight for rival in rivals]
        odds = np.sum(np.exp((np.array(weights) - others.log_weight) / COARSENED))
        assert probability == pytest.approx((1.0 - PRIOR_UNKNOWN) * odds / (1.0 + odds))


def test_effects_that_look_alike_share_one_group():
    search = searching(gauged(BASE.with_effect(EDGE), seed=1), (EdgeBuild, Twin, FlowDrift))
    trial, groups = search.groups(search.stages()[-1].here)
    ((name, (members, probability)),) = groups.items()
    assert trial.names == {name}
    assert set(members) == {'edge_build', 'twin'}
    assert probability > SURE


def test_an_effect_that_does_not_stand_is_taken_out_of_the_set(search, stages):
    one_more = search.with_effect(stages[-1].here, 'air_drift')
    assert one_more.names == {*PLANTED, 'air_drift'}
    assert one_more.log_weight_alone < stages[-1].here.log_weight_alone
    trial, groups = search.groups(one_more)
    assert trial.names == groups.keys() == PLANTED


def test_nothing_is_added_where_nothing_acts(clean):
    (stage,) = clean.stages()
    assert stage.here is clean.nothing
    assert clean.groups(stage.here) == (clean.nothing, {})
    # The readings left over by a fold do not call for more either.
    rows = np.arange(len(clean.run.study)) % 4 > 0
    assert stage.chosen(rows) is stage.here


def misled(search: Search) -> EffectSet:
    """A fit without effects that has come to rest in a wrong pattern."""
    state = search.run
    wrong = search.nothing.fit.model.planar.model_copy(update={'r_m': 0.5, 'sigma1_m': 0.05})
    model = search.nothing.fit.model.model_copy(update={'planar': wrong})
    study, parameters = state.study, search.nothing.fit.parameters
    vector, predicted_um = parameters.encode(model), study.forward.predict_um(model)
    fit = Fit(
        parameters, vector, model, predicted_um,
        (study.measured_um - predicted_um) / study.sigma_um,
        derivatives(study.forward, parameters, vector, study.sigma_um),
        True, study.nuisance, search.nothing.fit.discrepancy,
    )  # fmt: skip
    return replace(search.nothing, fit=fit)


def replace_state(
    search: Search, nothing: EffectSet, trials: dict, tried: set
) -> tuple[dict, set]:
    """Let a search begin again from other trials; those that it had."""
    had = search._trials, search._tried
    search.nothing, search._trials, search._tried = nothing, trials, tried
    return had


def test_what_only_led_to_a_better_pattern_is_no_effect(clean):
    """Beside a wrong pattern any effect helps whose refit finds the right one."""
    good, bad = clean.nothing, misled(clean)
    anew = replace_state(clean, bad, {frozenset(): bad}, set())
    stages = clean.stages()
    replace_state(clean, good, *anew)
    assert stages[-1].here.names == frozenset()
    assert stages[-1].here.log_weight == pytest.approx(good.log_weight, abs=SAME)
    assert bad.log_weight < good.log_weight - 10.0
