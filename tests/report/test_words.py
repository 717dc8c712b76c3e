"""What the report calls a user's own effect: it reads as well as one of the library."""

from booth import SAMPLES
from paint_deposition.effects.base import Effect, parameter
from paint_deposition.effects.catalogue import LEARNED, load_effect_file
from paint_deposition.effects.learned.law import PartGrid
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.report import words


class HoleBuild(Effect):
    id = 'hole_build'
    family = 'boundary'
    gain: float = parameter(
        0.0, low=-2, high=2, typical=0.1, unit='1', description='share of paint more at holes'
    )


def test_the_unit_in_a_parameters_name_is_not_said_twice():
    wake = load_effect_file(SAMPLES / 'my_effect.py')
    unit = wake.parameters()['loss_per_m_per_s']['unit']
    assert words.parameter_words('loss_per_m_per_s', unit) == 'loss'
    assert words.in_unit(unit, 2e-9) == ('per m/s', '2 × 10⁻⁹')
    unit = FlowDrift.parameters()['drift_per_pass']['unit']
    assert (words.parameter_words('drift_per_pass', unit), words.in_unit(unit, 0.02)[0]) == (
        'drift', 'per pass',
    )  # fmt: skip
    assert words.parameter_words('shift_down_m', 'm') == 'shift down'
    assert words.parameter_words('gain', '1') == 'gain'
    assert words.parameter_words('s', 's') == 's'


def test_an_effect_without_a_docstring_is_told_by_its_signature_or_its_parameter():
    assert words.effect_meaning(HoleBuild) == 'Share of paint more at holes.'
    signed = type('Signed', (HoleBuild,), {'signature': 'more paint around holes'})
    assert words.effect_meaning(signed) == 'More paint around holes.'
    assert words.effect_meaning(FlowDrift) == FlowDrift.__doc__.splitlines()[0]


def test_numbers_have_no_computers_exponent():
    assert [words.number(v) for v in (0.0, 1234.0, -0.00012345, 2.5e-9, 4e8)] == [
        '0', '1234', '−0.000123', '2.5 × 10⁻⁹', '4 × 10⁸',
    ]  # fmt: skip


def test_learned_laws_are_told_by_what_they_depend_on():
    name = 'learned law over the time since the motion began'
    assert words.effect_name('learned:time_s') == name
    assert words.effect_name('edge_build and learned:time_s') == f'edge build and {name}'
    assert words.is_learned('learned:time_s')
    assert not words.is_learned('edge_build')


def test_a_learned_law_is_told_by_its_curve_and_its_range():
    law = LEARNED['time_s'](low=2.0, high=60.0, learned=(0.1, -0.25))
    assert words.learned_words(law) == [('factor', '0.75 to 1.1', ''), ('over', '2 to 60', 's')]
    passes = LEARNED['spray_pass'](low=0.0, high=5.0)
    assert words.learned_words(passes)[1] == ('over', '1 to 6', '')
    fog = LEARNED['height_fraction'](kind='addition', learned=(2.0, -0.5))
    assert words.learned_words(fog)[0] == ('addition', '−0.5 to 2', 'µm')
    grid = PartGrid(
        part_m=(1.2, 0.1, 0.5), low_m=(-0.5, -0.2), high_m=(0.5, 0.2), columns=2, rows=2
    )
    map_ = LEARNED['place'](maps=(grid,), learned=(0.1, 0.0, 0.0, -0.2))
    assert words.learned_words(map_) == [
        ('factor', '0.8 to 1.1', ''), ('over', '1000 × 400', 'mm of a part'),
    ]  # fmt: skip
    # Mean and first harmonic add up on the heavier side.
    ring = LEARNED['footprint'](reach_m=0.3, learned=(0.0,) * 5 + (0.1, 0.2, 0.0, 0.0, 0.0))
    assert words.learned_words(ring)[0] == ('factor', '0.9 to 1.3', '')
