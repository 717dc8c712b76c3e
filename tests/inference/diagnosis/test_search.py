"""The search for missing effects between refitted models, on panels that the model painted."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.special import logsumexp, softmax

import paint_deposition as pd
from inference.diagnosis.readings_on_door import at_model
from inference.fitting.panels import gauged
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.diagnosis import model_space
from paint_deposition.inference.diagnosis.explanations import UNKNOWN
from paint_deposition.inference.diagnosis.search import ALIKE, SAME, Search, SearchStage
from paint_deposition.inference.diagnosis.state import DiagnosisState

pytestmark = pytest.mark.slow

BASE = pd.DepositionModel()
EDGE = EFFECTS['edge_build'](gain=0.6, length_m=0.1)
DRIFT = EFFECTS['flow_drift'](drift_per_pass=0.06)
PLANTED = ('edge_build', 'flow_drift')


class Twin(EFFECTS['edge_build']):
    """An effect that readings cannot tell from edge build."""

    id = 'twin'


def searching(campaign: pd.Campaign, *library: str) -> Search:
    known = {name: (EFFECTS | {Twin.id: Twin})[name] for name in library}
    return Search(DiagnosisState.begin(campaign, BASE, known, seed=0))


@pytest.fixture(scope='module')
def search() -> Search:
    """On a panel on which two effects acted."""
    truth = pd.DepositionModel(effects=(EDGE, DRIFT))
    return searching(gauged(truth, seed=0, columns=5), *PLANTED, 'air_drift')


@pytest.fixture(scope='module')
def stages(search) -> list[SearchStage]:
    return search.stages()


def test_the_set_found_is_the_one_planted_and_leaves_less_for_something_unknown(search, stages):
    # Around the leading effects a second one is looked for at once.
    assert [len(stage.here.names) for stage in stages] == [0, 2]
    assert {len(one.names) for one in stages[0].tried} == {1, 2}
    assert stages[0].here is search.nothing
    assert stages[-1].here.names == {*PLANTED}
    for stage, following in pairwise(stages):
        assert stage.chosen().names == following.here.names
        assert following.here.log_weight > stage.here.log_weight
    assert stages[-1].chosen() is stages[-1].here
    gains = []
    for here in (stage.here for stage in stages):
        assert here.log_weight == pytest.approx(here.log_evidence + here.log_prior)
        gains.append(here.of_unknown.alone[UNKNOWN])
    assert gains[-1] < min(0.0, gains[0])
    assert stages[0].here.p_values[0] < 0.05 < min(stages[-1].here.p_values)


def test_effects_are_fitted_beside_what_nature_leaves_over(stages):
    best = stages[-1].here
    assert best.fit.discrepancy is not None
    # What is usual is not their prior: both are stronger.
    assert best.fit.parameters.amplitude_sizes == dict.fromkeys(PLANTED, model_space.SIZES[-1])
    assert best.effects['edge_build'].gain == pytest.approx(EDGE.gain, rel=0.2)
    drift = best.effects['flow_drift'].drift_per_pass
    assert drift == pytest.approx(DRIFT.drift_per_pass, rel=0.2)
    # The size is one of several that were possible before.
    assert best.log_prior == pytest.approx(2.0 * model_space.log_odds(model_space.PRIOR_EFFECT))
    weights = [one.log_weight for one in best.weighed if not one.sizes.is_beyond_nature]
    assert -2.0 * np.log(len(model_space.SIZES)) < best.log_evidence - logsumexp(weights) < 0.0
    # One size of the discrepancy bears nearly all the weight of this set.
    everything = np.ones(len(best.state.study), dtype=bool)
    assert best.log_weight_of(everything) == pytest.approx(best.log_weight, abs=1.5)


def test_each_effect_of_the_set_is_sure_and_one_that_does_not_stand_is_taken_out(search, stages):
    best = stages[-1].here
    one_more = search.with_effect(best, 'air_drift')
    assert one_more.names == {*PLANTED, 'air_drift'}
    assert one_more.log_weight < best.log_weight
    for found in (one_more, best):
        trial, groups = search.groups(found)
        assert trial.names == groups.keys() == {*PLANTED}
    for name, (members, probability) in groups.items():
        assert members == (name,)
        assert probability > model_space.SURE
        # Against the set without it, as it is or with something unknown beside it.
        others = search.without(trial, name)
        rivals = dict.fromkeys((name, *others.proposed))
        gains = [search.with_effect(others, rival).log_evidence for rival in rivals]
        effect = model_space.log_odds(model_space.PRIOR_EFFECT)
        odds = np.array(gains) - others.log_evidence + effect
        # What is unknown may also look just like them.
        alike = logsumexp(odds) + np.log(ALIKE)
        shares = softmax([*odds, 0.0, others.of_unknown.alone[UNKNOWN], alike])
        assert probability == pytest.approx(shares[:-3].sum())


def test_effects_that_look_alike_share_one_group():
    search = searching(gauged(BASE.with_effect(EDGE), seed=1), *PLANTED, 'twin')
    trial, groups = search.groups(search.stages()[-1].here)
    ((name, (members, probability)),) = groups.items()
    assert trial.names == {name}
    assert set(members) == {'edge_build', 'twin'}
    assert probability > model_space.SURE


def test_nothing_is_added_where_nothing_acts():
    clean = searching(gauged(BASE, seed=2), 'fog_gradient', 'flow_drift', 'air_drift')
    (stage,) = clean.stages()
    assert stage.here is clean.nothing
    assert clean.groups(stage.here) == (clean.nothing, {})
    # The readings left over by a fold do not call for more either.
    rows = np.arange(len(clean.state.study)) % 4 > 0
    assert stage.chosen(rows) is stage.here
    # Beside a wrong pattern any effect helps whose refit finds the right one.
    good, state = clean.nothing, clean.state
    planar = good.fit.model.planar.model_copy(update={'r_m': 0.01, 'sigma1_m': 0.03})
    fit = at_model(state.study, good.fit.model.model_copy(update={'planar': planar}))
    misled = Search(replace(state, fit=fit))
    assert misled.nothing.log_evidence < good.log_evidence - 10.0
    last = misled.stages()[-1].here
    assert last.names == frozenset()
    assert last.log_evidence == pytest.approx(good.log_evidence, abs=2.0 * SAME)
