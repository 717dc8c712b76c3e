"""What the report calls a user's own effect: it reads as well as one of the library."""

from booth import SAMPLES
from paint_deposition.effects.base import Effect, parameter
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.effects.user_effects import load_effect_file
from paint_deposition.report.words import effect_meaning, in_unit, number, parameter_words


class HoleBuild(Effect):
    id = 'hole_build'
    family = 'boundary'
    gain: float = parameter(
        0.0, low=-2, high=2, typical=0.1, unit='1', description='share of paint more at holes'
    )


def test_the_unit_in_a_parameters_name_is_not_said_twice():
    wake = load_effect_file(SAMPLES / 'my_effect.py')
    unit = wake.parameters()['loss_per_m_per_s']['unit']
    assert parameter_words('loss_per_m_per_s', unit) == 'loss'
    assert in_unit(unit, 2e-9) == ('per m/s', '2 × 10⁻⁹')
    unit = FlowDrift.parameters()['drift_per_pass']['unit']
    assert (parameter_words('drift_per_pass', unit), in_unit(unit, 0.02)[0]) == (
        'drift', 'per pass',
    )  # fmt: skip
    assert parameter_words('shift_down_m', 'm') == 'shift down'
    assert parameter_words('gain', '1') == 'gain'
    assert parameter_words('s', 's') == 's'


def test_an_effect_without_a_docstring_is_told_by_its_signature_or_its_parameter():
    assert effect_meaning(HoleBuild) == 'Share of paint more at holes.'
    signed = type('Signed', (HoleBuild,), {'signature': 'more paint around holes'})
    assert effect_meaning(signed) == 'More paint around holes.'
    assert effect_meaning(FlowDrift) == FlowDrift.__doc__.splitlines()[0]


def test_numbers_have_no_computers_exponent():
    assert [number(v) for v in (0.0, 1234.0, -0.00012345, 2.5e-9, 4e8)] == [
        '0', '1234', '−0.000123', '2.5 × 10⁻⁹', '4 × 10⁸',
    ]  # fmt: skip
