"""What would have been detected: amplitudes with a stated power, checked by simulation."""

import numpy as np
import pytest
from scipy.stats import binom

from inference.diagnosis.linear import bounds, linear_fit, null_of
from paint_deposition.effects.base import Effect
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.faraday_shielding import FaradayShielding
from paint_deposition.inference.diagnosis import model_space, testability
from paint_deposition.inference.diagnosis.evidence import NullModel
from paint_deposition.inference.diagnosis.explanations import FOOTPRINT, UNKNOWN, Explanation
from paint_deposition.inference.diagnosis.model_space import ModelSpace
from paint_deposition.inference.diagnosis.sensitivities import Sensitivity
from paint_deposition.inference.diagnosis.testability import LEVEL, POWER

READINGS = 60
RUNS = 200
# Probability that a correct power fails the test with other seeds.
CHANCE = 0.005


def law(effect: Effect, column: np.ndarray, side: int) -> Explanation:
    low, high = bounds([side])
    names = type(effect).amplitudes()[:1]
    of_law = Sensitivity(effect, names, column[:, np.newaxis], low, high)
    return Explanation(effect.id, of_law.columns, of_law.sides, 1.0, of_law)


@pytest.fixture
def null() -> NullModel:
    """Readings of noise alone, with the seven parameters of the pattern fitted."""
    return null_of(linear_fit(np.random.default_rng(8), READINGS))


@pytest.fixture
def found() -> list[Explanation]:
    """Three effects and two shapeless causes, all of which may answer to what one effect does."""
    random = np.random.default_rng(5)
    alike = random.normal(size=READINGS)
    return [
        law(AirDrift(), 0.8 * random.normal(size=READINGS), 0),
        law(EdgeBuild(), 0.7 * alike, 1),
        law(FaradayShielding(), 0.9 * alike + 0.8 * random.normal(size=READINGS), 1),
        *(
            Explanation(cause, 0.3 * random.normal(size=(READINGS, count)), np.zeros(count), 1.0)
            for cause, count in ((UNKNOWN, 6), (FOOTPRINT, 4))
        ),
    ]


@pytest.mark.slow
@pytest.mark.parametrize('freedom', [np.inf, 12.0])
def test_a_detectable_amplitude_is_detected_nine_times_in_ten(freedom, null, found, monkeypatch):
    """Through the test that the diagnosis makes, on readings that the effect has moved."""
    monkeypatch.setattr(model_space, 'DRAWS', 500)
    space = ModelSpace(null, found, freedom)
    _, detectable = testability.testability(space, seed=3)
    random = np.random.default_rng(6)
    for explanation in found[1:3]:
        effect, (name,) = explanation.cause, explanation.sensitivity.names
        typical = type(explanation.sensitivity.effect).parameters()[name]['typical']
        amount = detectable[effect][name] / typical
        seen = 0
        for _ in range(RUNS):
            # Readings whose noise is off by as much as its estimate may be.
            scale = 1.0 if np.isinf(freedom) else (random.chisquare(freedom) / freedom) ** -0.5
            raw = null.lower @ (scale * random.normal(size=len(null.raw)))
            moved = NullModel.of(null.columns, raw + amount * explanation.law[:, 0])
            trial = ModelSpace(moved, found, freedom)
            trial._simulated = space._simulated
            seen += trial.p_value(3) < LEVEL
        low, high = binom.interval(1.0 - 2.0 * CHANCE, RUNS, POWER)
        assert low <= seen <= high, effect


def test_what_hides_in_the_pattern_is_not_testable(null):
    """A direction that the pattern takes up whole shows nothing, however strong."""
    hidden = null.columns[:, 0] / np.linalg.norm(null.columns[:, 0])
    space = ModelSpace(null, [law(EdgeBuild(), hidden, 1)], np.inf)
    assert testability.testability(space, seed=0) == (('edge_build',), {})
