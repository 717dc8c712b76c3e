"""Whole diagnoses of small panels that the model itself painted: pairs, size and power.

Sixty and more points on one panel and a library of three effects make a diagnosis cheap enough
for dozens of them.
"""

import numpy as np
import pytest
from scipy.stats import binom

from inference.fitting.panels import ORDERS, gauged
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.effects.library.fog_gradient import FogGradient
from paint_deposition.inference.diagnosis.model_space import SURE
from paint_deposition.inference.diagnosis.procedure import ALPHA, diagnose
from paint_deposition.inference.diagnosis.verdict import Diagnosis

pytestmark = pytest.mark.slow

BASE = DepositionModel()
LIBRARY = {effect.id: effect for effect in (FogGradient, FlowDrift, AirDrift)}
CAMPAIGNS = 8
# Probability that a correct rate fails one of these bounds with other seeds.
CHANCE = 0.01


@pytest.fixture(scope='module')
def two_missing() -> Diagnosis:
    """The diagnosis of two panels, painted in opposite orders, on which two effects acted."""
    truth = BASE.with_effect(FogGradient(fog_um=6.0)).with_effect(FlowDrift(drift_per_pass=0.1))
    return diagnose(gauged(truth, seed=0, orders=ORDERS), BASE, LIBRARY)


def test_a_second_effect_is_found_beside_the_first(two_missing):
    assert two_missing.verdict == 'effect_missing'
    assert set(two_missing.accepted) == {'fog_gradient', 'flow_drift'}
    assert [c.best for c in two_missing.classes[:2]] == list(two_missing.accepted)
    assert all(c.probability > SURE for c in two_missing.classes[:2])
    assert {effect.id for effect in two_missing.model.effects} == set(two_missing.accepted)
    for name in two_missing.accepted:
        assert name in two_missing.reason


def test_each_accepted_effect_has_a_step_that_improves_the_prediction(two_missing):
    steps = two_missing.history
    assert [step.added for step in steps] == ['', *two_missing.accepted]
    for before, after, found in zip(steps, steps[1:], two_missing.classes, strict=False):
        assert after.rmse_um < before.rmse_um
        assert found.holdout_rmse_um == {
            'before': before.holdout_rmse_um,
            'after': after.holdout_rmse_um,
        }
    assert steps[-1].rmse_um < 1.2 * two_missing.noise_floor_um
    # Amounts of both are found together.
    fog = two_missing.model.effect('fog_gradient').fog_um
    drift = two_missing.model.effect('flow_drift').drift_per_pass
    assert fog == pytest.approx(6.0, abs=1.2)
    assert drift == pytest.approx(0.1, abs=0.03)


def test_size_of_the_procedure():
    """False alarms come at the stated level at the most, as nature may leave something over."""
    found = [diagnose(gauged(BASE, seed), BASE, LIBRARY) for seed in range(CAMPAIGNS)]
    p_values = np.array([diagnosis.p_value for diagnosis in found])
    for level in (0.05, 0.2, 0.5):
        assert np.count_nonzero(p_values <= level) <= binom.isf(CHANCE, CAMPAIGNS, level)
    alarms = sum(diagnosis.verdict != 'none_missing' for diagnosis in found)
    assert alarms == np.count_nonzero(p_values < ALPHA)
    assert alarms <= binom.isf(CHANCE, CAMPAIGNS, ALPHA)
    # An alarm by chance is no accepted effect but in rare cases.
    assert sum(bool(diagnosis.accepted) for diagnosis in found) <= binom.isf(
        CHANCE, CAMPAIGNS, 0.02
    )


def test_power_of_the_procedure():
    """An effect of typical size is mostly detected, a large one is named, none is misnamed."""
    detected, named = {}, {}
    for drift in (0.02, 0.06):
        truth = BASE.with_effect(FlowDrift(drift_per_pass=drift))
        found = [diagnose(gauged(truth, seed), BASE, LIBRARY) for seed in range(3)]
        by_law = [[name for name in f.accepted if not name.startswith('learned:')] for f in found]
        assert all(set(names) <= {'flow_drift'} for names in by_law)
        detected[drift] = sum(f.verdict != 'none_missing' for f in found)
        named[drift] = sum('flow_drift' in names for names in by_law)
    assert detected[0.02] >= 2
    assert detected[0.06] == 3
    assert named[0.06] >= 2
