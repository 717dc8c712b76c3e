"""The test whether anything is missing, and the posterior of the hypotheses."""

import numpy as np
import pytest
from scipy.stats import binom, kstest

from diagnosis.linear import bounds, linear_fit
from paint_deposition.diagnosis import model_space
from paint_deposition.diagnosis.evidence import NullModel, simulated
from paint_deposition.diagnosis.model_space import PRIOR, ModelSpace
from paint_deposition.diagnosis.sensitivities import Sensitivity
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.faraday_shielding import FaradayShielding
from paint_deposition.effects.library.overspray_fog import OversprayFog

READINGS = 30
NULL_RUNS = 600
# Probability that a correct p-value fails one of these bounds with other seeds.
CHANCE = 0.01


@pytest.fixture
def sensitivities():
    """Five effects, one signed and in three shapes, one of two directions."""
    random = np.random.default_rng(5)

    def sensitivity(effect, strength, sides):
        columns = strength * random.normal(size=(READINGS, len(sides)))
        return Sensitivity(effect, type(effect).amplitudes(), columns, *bounds(sides))

    return [
        sensitivity(AirDrift(), 0.8, (0.0, 0.0)),
        *(
            sensitivity(CornerSlowdown(length_m=length), 0.9, (1.0,))
            for length in (0.05, 0.1, 0.3)
        ),
        sensitivity(EdgeBuild(), 0.7, (1.0,)),
        sensitivity(FaradayShielding(), 1.2, (1.0,)),
        sensitivity(OversprayFog(), 0.6, (1.0,)),
    ]


@pytest.fixture
def shapeless():
    random = np.random.default_rng(6)
    fields = [0.3 * random.normal(size=(READINGS, 6)) for _ in range(2)]
    return fields, [random.normal(size=(READINGS, 4))]


@pytest.mark.slow
def test_the_p_value_is_uniform_where_nothing_is_missing(sensitivities, shapeless, monkeypatch):
    """With the noise known, and estimated with 15 degrees of freedom."""
    monkeypatch.setattr(model_space, 'DRAWS', 99)
    lower = NullModel.of(linear_fit(np.random.default_rng(7), READINGS)).lower
    found = [
        ModelSpace.of(
            NullModel(lower, deviation), sensitivities, *shapeless, freedom, seed=seed
        ).p_value
        for freedom in (np.inf, 15.0)
        for seed, deviation in enumerate(simulated(READINGS, freedom, NULL_RUNS, seed=11).T)
    ]
    assert kstest(found, 'uniform').pvalue > CHANCE
    for level in (0.01, 0.05, 0.2):
        alarms = np.count_nonzero(np.array(found) <= level)
        assert binom.ppf(CHANCE, len(found), level) <= alarms
        assert alarms <= binom.isf(CHANCE, len(found), level)
    # A test whose true size is 8 % would fail here.
    assert binom.sf(binom.isf(CHANCE, len(found), 0.05), len(found), 0.08) > 0.95


def test_a_planted_effect_is_found_with_its_shape(sensitivities, shapeless):
    null = NullModel.of(linear_fit(np.random.default_rng(8), READINGS))
    planted = sensitivities[2]
    null = NullModel(null.lower, null.deviation + null.whiten(planted.columns)[:, 0] * 1.5)
    space = ModelSpace.of(null, sensitivities, *shapeless, np.inf, seed=0)
    assert space.p_value < 0.01
    assert space.posterior().sum() == pytest.approx(1.0)
    best = space.hypotheses[int(np.argmax(space.posterior()))]
    assert best.effects == ('corner_slowdown',)
    assert best.shape == planted.shape


def test_the_wrong_sign_is_not_taken_for_an_effect(sensitivities, shapeless):
    null = NullModel.of(linear_fit(np.random.default_rng(8), READINGS))
    shift = null.whiten(sensitivities[5].columns)[:, 0] * 1.5
    weights = {}
    for sign in (1.0, -1.0):
        there = NullModel(null.lower, null.deviation + sign * shift)
        space = ModelSpace.of(there, sensitivities, *shapeless, np.inf, seed=0)
        weights[sign] = sum(
            weight
            for h, weight in zip(space.hypotheses, space.posterior(), strict=True)
            if h.effects == ('faraday_shielding',)
        )
    assert weights[1.0] > 0.8
    assert weights[-1.0] < 0.01


def test_the_priors_are_shared_out_whole(sensitivities, shapeless):
    null = NullModel.of(linear_fit(np.random.default_rng(8), READINGS))
    space = ModelSpace.of(null, sensitivities, *shapeless, np.inf, seed=0)
    assert sum(h.prior for h in space.hypotheses) == pytest.approx(sum(PRIOR.values()))
    assert sum(PRIOR.values()) == pytest.approx(1.0)
    one = {}
    for h in space.hypotheses:
        if len(h.effects) == 1 and not h.other:
            one[h.effects[0]] = one.get(h.effects[0], 0.0) + h.prior
    assert len(set(np.round(list(one.values()), 12))) == 1  # whatever the number of shapes


def test_without_a_library_only_the_shapeless_is_weighed(shapeless):
    null = NullModel.of(linear_fit(np.random.default_rng(8), READINGS))
    space = ModelSpace.of(null, [], *shapeless, np.inf, seed=0)
    assert {h.other for h in space.hypotheses} == {'', 'unknown', 'footprint'}
    assert not any(h.effects for h in space.hypotheses)
    assert 0.0 < space.p_value <= 1.0
