"""Classes of effects that the readings cannot tell apart."""

import numpy as np
import pytest

from diagnosis.linear import bounds, linear_fit
from paint_deposition.diagnosis.classes import CONFOUNDED_COSINE, confounded
from paint_deposition.diagnosis.evidence import NullModel
from paint_deposition.diagnosis.linearisation import Linearisation
from paint_deposition.diagnosis.model_space import ModelSpace
from paint_deposition.diagnosis.sensitivities import Sensitivity
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.faraday_shielding import FaradayShielding
from paint_deposition.effects.library.overspray_fog import OversprayFog
from paint_deposition.effects.library.tcp_tilt import TcpTilt

READINGS = 40
DIRECTIONS = np.random.default_rng(1).normal(size=(READINGS, 3))
CHANGE, OTHER, THIRD = 20.0 * np.linalg.qr(DIRECTIONS)[0].T


def sensitivity(effect, *columns, sides) -> Sensitivity:
    return Sensitivity(effect, type(effect).amplitudes(), np.column_stack(columns), *bounds(sides))


def members(*sensitivities) -> tuple[str, ...]:
    """The class of the first, which acted on the readings."""
    fit = linear_fit(np.random.default_rng(2), READINGS, np.zeros(READINGS))
    null = NullModel(np.eye(READINGS), sensitivities[0].columns[:, 0])
    fields = [0.01 * np.random.default_rng(3).normal(size=(READINGS, 2))]
    space = ModelSpace.of(null, list(sensitivities), fields, [], np.inf, seed=0)
    linear = Linearisation(fit, null, space, list(sensitivities), (), {})
    return confounded(linear, [s.id for s in sensitivities])


def test_effects_with_parallel_sensitivities_are_one_class():
    assert members(
        sensitivity(EdgeBuild(), CHANGE, sides=[1]),
        sensitivity(OversprayFog(), 0.5 * CHANGE, sides=[1]),
        sensitivity(FaradayShielding(), OTHER, sides=[1]),
    ) == ('edge_build', 'overspray_fog')


def test_an_effect_that_would_have_to_be_huge_is_not_confounded():
    for strength, expected in ((0.5, True), (0.1, False)):
        weak = sensitivity(OversprayFog(), strength * CHANGE, sides=[1])
        assert (
            'overspray_fog' in members(sensitivity(EdgeBuild(), CHANGE, sides=[1]), weak)
        ) == expected


def test_signed_effects_of_opposite_sensitivity_are_not_confounded():
    first = sensitivity(EdgeBuild(), CHANGE, sides=[1])
    assert members(first, sensitivity(FaradayShielding(), -CHANGE, sides=[1])) == ('edge_build',)
    assert members(first, sensitivity(FaradayShielding(), -CHANGE, sides=[-1])) == (
        'edge_build',
        'faraday_shielding',
    )


def test_an_effect_of_either_sign_is_confounded_with_both_signs():
    for way in (1.0, -1.0):
        rival = sensitivity(AirDrift(), way * CHANGE, OTHER, sides=[0, 0])
        assert 'air_drift' in members(sensitivity(EdgeBuild(), CHANGE, sides=[1]), rival)


def test_a_combination_of_two_amplitudes_may_be_confounded_with_one():
    rival = sensitivity(TcpTilt(), CHANGE + OTHER, CHANGE - OTHER, sides=[0, 0])
    assert 'tcp_tilt' in members(sensitivity(EdgeBuild(), CHANGE, sides=[1]), rival)


@pytest.mark.parametrize(('above', 'expected'), [(0.02, True), (-0.02, False)])
def test_the_limit_is_a_cosine(above, expected):
    cosine = CONFOUNDED_COSINE + above
    tilted = cosine * CHANGE + np.sqrt(1.0 - cosine**2) * THIRD
    found = members(
        sensitivity(EdgeBuild(), CHANGE, sides=[1]), sensitivity(OversprayFog(), tilted, sides=[1])
    )
    assert ('overspray_fog' in found) == expected
