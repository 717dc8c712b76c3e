"""Effects whose marks these readings cannot tell apart."""

import numpy as np
import pytest

from diagnosis.linear import bounds, linear_fit
from paint_deposition.diagnosis.classes import ALIKE, alike
from paint_deposition.diagnosis.evidence import BaseSpace
from paint_deposition.diagnosis.hypotheses import weigh
from paint_deposition.diagnosis.judgement import Judgement
from paint_deposition.diagnosis.sensitivities import Signature
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.faraday_shielding import FaradayShielding
from paint_deposition.effects.library.overspray_fog import OversprayFog
from paint_deposition.effects.library.tcp_tilt import TcpTilt

READINGS = 40
MARK, OTHER, THIRD = np.linalg.qr(np.random.default_rng(1).normal(size=(READINGS, 3)))[0].T * 20.0


def mark(effect, *columns, sides) -> Signature:
    return Signature(effect, type(effect).amplitudes(), np.column_stack(columns), *bounds(sides))


def members(*signatures) -> tuple[str, ...]:
    """The class of the first, which acted on the readings."""
    fit = linear_fit(np.random.default_rng(2), READINGS, np.zeros(READINGS))
    base = BaseSpace(np.eye(READINGS), signatures[0].columns[:, 0])
    fields = [0.01 * np.random.default_rng(3).normal(size=(READINGS, 2))]
    weighing = weigh(base, list(signatures), fields, [], np.inf, seed=0)
    judged = Judgement(fit, base, weighing, list(signatures), (), {})
    return alike(judged, [s.id for s in signatures])


def test_parallel_marks_are_one_class():
    assert members(
        mark(EdgeBuild(), MARK, sides=[1]),
        mark(OversprayFog(), 0.5 * MARK, sides=[1]),
        mark(FaradayShielding(), OTHER, sides=[1]),
    ) == ('edge_build', 'overspray_fog')


def test_an_effect_that_would_have_to_be_huge_is_no_rival():
    for strength, expected in ((0.5, True), (0.1, False)):
        weak = mark(OversprayFog(), strength * MARK, sides=[1])
        assert ('overspray_fog' in members(mark(EdgeBuild(), MARK, sides=[1]), weak)) == expected


def test_opposite_marks_of_signed_effects_are_no_rivals():
    first = mark(EdgeBuild(), MARK, sides=[1])
    assert members(first, mark(FaradayShielding(), -MARK, sides=[1])) == ('edge_build',)
    assert members(first, mark(FaradayShielding(), -MARK, sides=[-1])) == (
        'edge_build',
        'faraday_shielding',
    )


def test_an_effect_of_either_sign_rivals_both_ways():
    for way in (1.0, -1.0):
        rival = mark(AirDrift(), way * MARK, OTHER, sides=[0, 0])
        assert 'air_drift' in members(mark(EdgeBuild(), MARK, sides=[1]), rival)


def test_two_directions_together_may_rival_one():
    rival = mark(TcpTilt(), MARK + OTHER, MARK - OTHER, sides=[0, 0])
    assert 'tcp_tilt' in members(mark(EdgeBuild(), MARK, sides=[1]), rival)


@pytest.mark.parametrize(('cosine', 'expected'), [(ALIKE + 0.02, True), (ALIKE - 0.02, False)])
def test_the_limit_is_a_cosine(cosine, expected):
    tilted = cosine * MARK + np.sqrt(1.0 - cosine**2) * THIRD
    found = members(mark(EdgeBuild(), MARK, sides=[1]), mark(OversprayFog(), tilted, sides=[1]))
    assert ('overspray_fog' in found) == expected
