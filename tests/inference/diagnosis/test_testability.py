"""What would have been detected: amplitudes with a stated power, checked by simulation."""

import numpy as np
import pytest
from scipy.stats import binom

from inference.diagnosis.linear import explanation_of as law
from inference.diagnosis.linear import linear_fit, null_of, unknown
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.faraday_shielding import FaradayShielding
from paint_deposition.inference.diagnosis import model_space, testability
from paint_deposition.inference.diagnosis.explanations import Explanation
from paint_deposition.inference.diagnosis.gaussian import NullModel, simulated
from paint_deposition.inference.diagnosis.model_space import EffectEvidence
from paint_deposition.inference.diagnosis.testability import LEVEL, POWER

READINGS = 60
RUNS = 200
# Probability that a correct power fails the test with other seeds.
CHANCE = 0.005


@pytest.fixture
def null() -> NullModel:
    """Readings of noise alone, with the seven parameters of the pattern fitted."""
    return null_of(linear_fit(np.random.default_rng(8), READINGS))


@pytest.fixture
def found() -> list[Explanation]:
    """Three effects and two laws of any form, all of which may answer to what one effect does."""
    random = np.random.default_rng(5)
    alike = random.normal(size=READINGS)
    return [
        law(AirDrift(), 0.8 * random.normal(size=READINGS), sides=(0,)),
        law(EdgeBuild(), 0.7 * alike, sides=(1,)),
        law(FaradayShielding(), 0.9 * alike + 0.8 * random.normal(size=READINGS), sides=(1,)),
        *(unknown(0.3 * random.normal(size=(READINGS, count)), 0.5) for count in (6, 4)),
    ]


@pytest.mark.slow
@pytest.mark.parametrize('freedom', [np.inf, 12.0])
def test_a_detectable_amplitude_is_detected_nine_times_in_ten(freedom, null, found, monkeypatch):
    """Through the test that the diagnosis makes, on readings that the effect has moved."""
    monkeypatch.setattr(model_space, 'DRAWS', 500)
    space = EffectEvidence(null, found, freedom)
    _, detectable = testability.testability(space, seed=3)
    limit = np.quantile(space.evidence(space.null_draws(3)), 1.0 - LEVEL)
    noise = simulated(READINGS, freedom, RUNS, seed=6)
    for explanation in found[1:3]:
        effect, (name,) = explanation.cause, explanation.law.names
        typical = type(explanation.law.effect).parameters()[name]['typical']
        change = detectable[effect][name] / typical * null.whiten(explanation.columns)
        seen = np.count_nonzero(space.evidence(noise + change) > limit)
        low, high = binom.interval(1.0 - 2.0 * CHANCE, RUNS, POWER)
        assert low <= seen <= high, effect


@pytest.mark.parametrize('discrepancy', [0.0, 4.0])
def test_what_nature_leaves_over_makes_less_detectable(null, found, discrepancy):
    """It is part of the null hypothesis, along a direction in which an effect shows."""
    along = found[1].columns
    beside = null.with_discrepancy(discrepancy * along @ along.T)
    detectable = [
        testability.testability(EffectEvidence(one, found, np.inf), seed=3)[1]
        for one in (null, beside)
    ]
    before, after = (one.get('edge_build', {}).get('gain', np.inf) for one in detectable)
    assert np.isfinite(before)
    assert after > 1.3 * before if discrepancy else after == before


def test_what_hides_in_the_pattern_is_not_testable(null):
    """A direction that the pattern takes up whole shows nothing, however strong."""
    hidden = null.columns[:, 0] / np.linalg.norm(null.columns[:, 0])
    space = EffectEvidence(null, [law(EdgeBuild(), hidden, sides=(1,))], np.inf)
    assert testability.testability(space, seed=0) == (('edge_build',), {})
