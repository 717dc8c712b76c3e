"""Brushes between calibrated ones: powers of the set-points, and nothing beyond the range."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paint_deposition.errors import ModelError
from paint_deposition.model.brush import SETTINGS, Brush, BrushLaw, SetPoints
from paint_deposition.model.eq1_pattern import PlanarPattern

BASE = {
    'flow_cm3_per_min': 200.0, 'shaping_air_l_per_min': 250.0, 'bell_speed_rpm': 40_000.0,
    'voltage_kv': 70.0, 'solids': 0.45,
}  # fmt: skip
FIRST = PlanarPattern(K1_cm3_per_s=1.1, K2=0.2, K3=0.1, phi_rad=0.5, r_m=0.12, sigma1_m=0.05)


def brush_at(number: int, width: dict, efficiency: dict, **at: float) -> Brush:
    """A brush of a bell that follows exact powers, from FIRST at BASE."""
    now = BASE | at
    wider = np.prod([(now[name] / BASE[name]) ** power for name, power in width.items()])
    share = np.prod([(now[name] / BASE[name]) ** power for name, power in efficiency.items()])
    share *= now['flow_cm3_per_min'] * now['solids'] / (200.0 * 0.45)
    planar = FIRST.model_copy(update={
        'K1_cm3_per_s': float(FIRST.K1_cm3_per_s * share),
        **{name: float(getattr(FIRST, name) * wider) for name in ('r_m', 'sigma1_m', 'sigma2_m')},
    })  # fmt: skip
    return Brush(number=number, planar=planar, **now)


def values(planar: PlanarPattern) -> dict[str, float]:
    return planar.model_dump()


WIDTH = {'bell_speed_rpm': 0.4, 'shaping_air_l_per_min': -0.7}
EFFICIENCY = {'bell_speed_rpm': -0.1, 'voltage_kv': 0.3}
CORNERS = (
    brush_at(1, WIDTH, EFFICIENCY),
    brush_at(2, WIDTH, EFFICIENCY, bell_speed_rpm=60_000.0),
    brush_at(3, WIDTH, EFFICIENCY, shaping_air_l_per_min=400.0),
    brush_at(4, WIDTH, EFFICIENCY, voltage_kv=90.0),
    brush_at(5, WIDTH, EFFICIENCY, flow_cm3_per_min=350.0),
)


@given(st.floats(40e3, 60e3), st.floats(250, 400), st.floats(70, 90), st.floats(200, 350))
def test_a_bell_that_follows_powers_is_followed(speed, air, voltage, flow):
    at = {
        'bell_speed_rpm': speed, 'shaping_air_l_per_min': air, 'voltage_kv': voltage,
        'flow_cm3_per_min': flow,
    }  # fmt: skip
    true = brush_at(9, WIDTH, EFFICIENCY, **at)
    found = BrushLaw(CORNERS).pattern('brushes, 9', true.set_points)
    assert values(found) == pytest.approx(values(true.planar), rel=1e-5)


def test_exponents_are_found_where_brushes_differ_and_the_prior_decides_elsewhere():
    found = BrushLaw(CORNERS).exponents()
    assert found['width']['bell_speed_rpm'][0] == pytest.approx(0.4, abs=1e-4)
    assert found['width']['shaping_air_l_per_min'][0] == pytest.approx(-0.7, abs=1e-4)
    assert found['efficiency']['voltage_kv'][0] == pytest.approx(0.3, abs=1e-4)
    assert found['width']['bell_speed_rpm'][1] < 0.01
    of_two = BrushLaw(CORNERS[:2]).exponents()
    assert of_two['width']['bell_speed_rpm'][0] == pytest.approx(0.4, abs=1e-4)
    # Both have the same voltage: DELMIA's factor, with its whole deviation.
    assert of_two['width']['voltage_kv'] == pytest.approx((-1.0, 0.5))


def test_twice_the_flow_is_twice_the_paint_where_nothing_else_is_known():
    one = Brush(number=1, planar=FIRST, flow_cm3_per_min=100.0)
    four = Brush(
        number=2, flow_cm3_per_min=400.0,
        planar=FIRST.model_copy(update={'K1_cm3_per_s': 4.0 * FIRST.K1_cm3_per_s}),
    )  # fmt: skip
    found = BrushLaw((one, four)).pattern('brushes, 3', SetPoints(flow_cm3_per_min=200.0))
    assert found.K1_cm3_per_s == pytest.approx(2.0 * FIRST.K1_cm3_per_s, rel=1e-5)
    assert found.sigma1_m == pytest.approx(FIRST.sigma1_m, rel=1e-5)


@pytest.mark.parametrize(
    ('at', 'message'),
    [
        (
            {'bell_speed_rpm': 61_000.0},
            'brushes, 9: bell_speed_rpm is 61000, outside 40000 to 60000 of the calibrated '
            'brushes 1, 2; calibrate a brush there',
        ),
        ({'voltage_kv': 60.0}, 'voltage_kv is 60, outside 70 to 70 of the calibrated'),
        ({'bell_speed_rpm': None}, 'bell_speed_rpm is missing, in which brushes 1, 2 differ'),
    ],
)
def test_what_is_out_of_the_calibrated_range_is_refused(at, message):
    law, wanted = BrushLaw(CORNERS[:2]), SetPoints(**(BASE | at))
    with pytest.raises(ModelError) as refused:
        law.pattern('brushes, 9', wanted)
    assert message in str(refused.value)
    assert '\n' not in str(refused.value)


def test_a_law_needs_two_brushes_that_tell_their_set_points():
    with pytest.raises(ModelError, match='has no planar and lies between no two brushes'):
        BrushLaw(CORNERS[:1]).pattern('brushes, 9', SetPoints(**BASE))
    silent = CORNERS[1].model_copy(update={'voltage_kv': None})
    with pytest.raises(ModelError, match='voltage_kv is given and brush 2 has none; add it'):
        BrushLaw((CORNERS[0], silent)).pattern('brushes, 9', SetPoints(**BASE))
    assert set(SETTINGS) <= set(SetPoints.model_fields)
