"""Closed forms of learned curves: known curves are named, with their parameters."""

import numpy as np
import pytest

from paint_deposition.effects.catalogue import LEARNED
from paint_deposition.effects.closed_forms import fitting_forms, forms_of

KNOTS = 14
STANDOFF = np.linspace(0.5, 2.0, KNOTS)
COSINE = np.linspace(0.1, 1.0, KNOTS)
TIME_S = np.linspace(0.0, 40.0, KNOTS)


@pytest.mark.parametrize(
    ('form', 'x', 'unit', 'curve', 'expected'),
    [
        ('linear', TIME_S, 's', lambda t: 1.1 * (1 + 0.02 * (t - 20)),
         {'level': 1.1, 'slope_per_s': 0.02}),
        ('quadratic', TIME_S, 's', lambda t: 1 + 0.01 * (t - 20) - 0.0006 * (t - 20) ** 2,
         {'level': 1.0, 'slope_per_s': 0.01, 'bend_per_s2': -0.0006}),
        ('power', STANDOFF, '1', lambda r: 0.9 * r**-0.5, {'level': 0.9, 'exponent': -0.5}),
        ('power', COSINE, '1', lambda c: 1.2 * c**0.4, {'level': 1.2, 'exponent': 0.4}),
        ('inverse', STANDOFF, '1', lambda r: 0.4 + 0.6 / r, {'level': 1.0, 'share': 0.6}),
        ('exponential', STANDOFF, '1', lambda r: np.exp(0.7 * (r - 1)),
         {'level': 1.0, 'rate': 0.7}),
        ('saturating', TIME_S, 's', lambda t: 0.8 * (1 + 0.5 * (1 - np.exp(-t / 6))),
         {'level': 0.8, 'change': 0.5, 'scale_s': 6.0}),
        ('logistic', TIME_S, 's', lambda t: 0.9 * (1 + 0.4 / (1 + np.exp((15 - t) / 2.5))),
         {'level': 0.9, 'change': 0.4, 'middle_s': 15.0, 'width_s': 2.5}),
    ],
    ids=lambda value: value if isinstance(value, str) else '',
)  # fmt: skip
def test_a_curve_made_from_a_form_is_named_with_its_parameters(form, x, unit, curve, expected):
    sd = np.full(KNOTS, 0.004)
    held = []
    for seed in range(4):
        noise = np.random.default_rng(seed).normal(0.0, sd)
        best, *others = fitting_forms(x, curve(x) + noise, sd, unit=unit)
        held.append(best.name == form)
        found = next(one for one in (best, *others) if one.name == form)
        assert set(found.parameters) == set(expected)
        for name, value in expected.items():
            at = found.parameters[name]
            assert at.low < at.value < at.high
            assert at.value == pytest.approx(value, abs=1.3 * (at.high - at.low))
        assert found(x) == pytest.approx(curve(x), abs=0.015)
        probabilities = [one.probability for one in (best, *others)]
        assert probabilities == sorted(probabilities, reverse=True)
        assert sum(probabilities) < 1.0 + 1e-9
    assert sum(held) >= 3


def test_an_addition_is_in_micrometres_and_a_value_below_zero_written_with_a_plus():
    x, sd = np.linspace(0.0, 0.2, KNOTS), np.full(KNOTS, 0.05)
    best = fitting_forms(x, 6.0 * np.exp(-x / 0.05), sd, unit='m', addition=True)[0]
    assert best.name in ('exponential', 'saturating')
    assert best.formula.startswith('addition [um] = ')
    assert 'level_um' in best.parameters
    assert fitting_forms(x, np.zeros(KNOTS), sd, unit='m', addition=True) == ()
    x = np.linspace(-4.0, 2.0, KNOTS)
    forms = fitting_forms(x, 0.9 + 0.1 * x, np.full(KNOTS, 0.004), unit='1/m')
    assert any('(x + 1)' in form.formula for form in forms)
    assert not any('- -' in form.code + form.formula for form in forms)


def test_a_wiggly_or_flat_curve_has_no_form_and_a_wide_band_leaves_several():
    wave, noise = np.sin(TIME_S / 2.5), np.random.default_rng(1).normal(size=KNOTS)
    for change in (0.1 * wave, 0.3 * wave, 0.003 * noise):
        assert fitting_forms(TIME_S, 1.0 + change, np.full(KNOTS, 0.02), unit='s') == ()
    forms = fitting_forms(STANDOFF, STANDOFF**-0.5, np.full(KNOTS, 0.04))
    assert len(forms) > 3
    assert forms[0].probability < 0.9
    for form in forms:
        assert np.abs(form(STANDOFF) - STANDOFF**-0.5).max() < 2 * 0.04


def test_a_learned_law_over_incidence_is_a_power_of_the_cosine():
    law = LEARNED['incidence_deg'](low=0.0, high=70.0, learned=(0.0,) * KNOTS)
    values = tuple((-law.knots) ** 0.6 - 1.0)
    best = forms_of(law.model_copy(update={'learned': values, 'sd': (0.005,) * KNOTS}))[0]
    assert best.formula == 'factor = level * cos_incidence^exponent'
    assert best.parameters['exponent'].value == pytest.approx(0.6, abs=0.02)
    assert forms_of(law.model_copy(update={'learned': values})) == ()  # how well known?
