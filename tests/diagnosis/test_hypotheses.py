"""The test whether anything is missing, and the weights of what may be."""

import numpy as np
import pytest
from scipy.stats import kstest

from diagnosis.linear import bounds, linear_fit
from paint_deposition.diagnosis import hypotheses
from paint_deposition.diagnosis.evidence import BaseSpace, simulated
from paint_deposition.diagnosis.hypotheses import PRIOR, weigh
from paint_deposition.diagnosis.sensitivities import Signature
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.faraday_shielding import FaradayShielding
from paint_deposition.effects.library.overspray_fog import OversprayFog

READINGS = 30
NULL_RUNS = 300


@pytest.fixture
def marks():
    """Five effects, one signed and in three shapes, one of two directions."""
    random = np.random.default_rng(5)

    def mark(effect, strength, sides):
        columns = strength * random.normal(size=(READINGS, len(sides)))
        return Signature(effect, type(effect).amplitudes(), columns, *bounds(sides))

    return [
        mark(AirDrift(), 0.8, (0.0, 0.0)),
        *(mark(CornerSlowdown(length_m=length), 0.9, (1.0,)) for length in (0.05, 0.1, 0.3)),
        mark(EdgeBuild(), 0.7, (1.0,)),
        mark(FaradayShielding(), 1.2, (1.0,)),
        mark(OversprayFog(), 0.6, (1.0,)),
    ]


@pytest.fixture
def shapeless():
    random = np.random.default_rng(6)
    fields = [0.3 * random.normal(size=(READINGS, 6)) for _ in range(2)]
    return fields, [random.normal(size=(READINGS, 4))]


@pytest.mark.parametrize('freedom', [np.inf, 15.0])
def test_the_p_value_is_uniform_where_nothing_is_missing(marks, shapeless, freedom, monkeypatch):
    monkeypatch.setattr(hypotheses, 'DRAWS', 400)
    random = np.random.default_rng(7)
    noise = simulated(READINGS, freedom, NULL_RUNS, seed=11)
    found = []
    for run in range(NULL_RUNS):
        base = BaseSpace.of(linear_fit(random, READINGS))
        base = BaseSpace(base.lower, noise[:, run])
        found.append(weigh(base, marks, *shapeless, freedom, seed=run).p_value)
    assert kstest(found, 'uniform').pvalue > 0.01
    # Binomial: 15 of 300 are expected at 5 %, with a standard deviation of 3.8.
    assert np.sum(np.array(found) < 0.05) <= 15 + 3 * 3.8


def test_a_planted_effect_is_found_with_its_shape(marks, shapeless):
    base = BaseSpace.of(linear_fit(np.random.default_rng(8), READINGS))
    planted = marks[2]
    base = BaseSpace(base.lower, base.deviation + base.project(planted.columns)[:, 0] * 1.5)
    weighing = weigh(base, marks, *shapeless, np.inf, seed=0)
    assert weighing.p_value < 0.01
    assert weighing.posterior.sum() == pytest.approx(1.0)
    best = weighing.hypotheses[int(np.argmax(weighing.posterior))]
    assert best.effects == ('corner_slowdown',)
    assert best.shape == planted.shape


def test_the_wrong_sign_is_not_taken_for_an_effect(marks, shapeless):
    base = BaseSpace.of(linear_fit(np.random.default_rng(8), READINGS))
    shift = base.project(marks[5].columns)[:, 0] * 1.5
    weights = {}
    for sign in (1.0, -1.0):
        there = BaseSpace(base.lower, base.deviation + sign * shift)
        weighing = weigh(there, marks, *shapeless, np.inf, seed=0)
        weights[sign] = sum(
            weight
            for h, weight in zip(weighing.hypotheses, weighing.posterior, strict=True)
            if h.effects == ('faraday_shielding',)
        )
    assert weights[1.0] > 0.8
    assert weights[-1.0] < 0.01


def test_the_priors_are_shared_out_whole(marks, shapeless):
    base = BaseSpace.of(linear_fit(np.random.default_rng(8), READINGS))
    weighing = weigh(base, marks, *shapeless, np.inf, seed=0)
    assert sum(h.prior for h in weighing.hypotheses) == pytest.approx(sum(PRIOR.values()))
    assert sum(PRIOR.values()) == pytest.approx(1.0)
    one = {}
    for h in weighing.hypotheses:
        if len(h.effects) == 1 and not h.other:
            one[h.effects[0]] = one.get(h.effects[0], 0.0) + h.prior
    assert len(set(np.round(list(one.values()), 12))) == 1  # whatever the number of shapes


def test_without_a_library_only_the_shapeless_is_weighed(shapeless):
    base = BaseSpace.of(linear_fit(np.random.default_rng(8), READINGS))
    weighing = weigh(base, [], *shapeless, np.inf, seed=0)
    assert {h.other for h in weighing.hypotheses} == {'', 'unknown', 'footprint'}
    assert not any(h.effects for h in weighing.hypotheses)
    assert 0.0 < weighing.p_value <= 1.0
