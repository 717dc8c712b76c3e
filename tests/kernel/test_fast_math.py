"""Compiled exponential and logarithm against the C library's."""

import numpy as np
import pytest
from numba import njit

from paint_deposition.kernel.fast_math import exp, exp2, log, power

pytestmark = pytest.mark.slow


def over_all(function):
    """The function compiled, over an array; the second argument of a power is one number."""
    compiled = njit(lambda x, *others: function(x, *others))

    @njit
    def each(x, *others):
        out = np.empty_like(x)
        for i in range(len(x)):
            out[i] = compiled(x[i], *others)
        return out

    return each


exp2_all, exp_all, log_all, power_all = map(over_all, (exp2, exp, log, power))
# Precision, and an error of a few units in the last place.
REALS = [(np.float32, 2.5e-7), (np.float64, 5e-16)]
FLOORS = {np.float32: -120.0, np.float64: -1000.0}


@pytest.mark.parametrize(('real', 'error'), REALS)
def test_each_is_right_to_a_few_units_in_the_last_place(real, error):
    x = np.linspace(FLOORS[real], 120.0, 100_003).astype(real)
    assert np.max(np.abs(exp2_all(x) / np.exp2(x.astype(np.longdouble)) - 1.0)) < error
    x = np.linspace(-80.0, 80.0, 100_003).astype(real)
    relative = np.abs(exp_all(x) / np.exp(x.astype(np.longdouble)) - 1.0)
    # The rounding of the exponent itself counts as much as the exponent is large.
    assert np.max(relative / (1.0 + np.abs(x))) < error
    x = np.logspace(-20, 20, 100_003).astype(real)
    expected = np.log(x.astype(np.longdouble))
    assert np.max(np.abs(log_all(x) - expected) / np.maximum(np.abs(expected), 0.1)) < 3 * error
    assert log_all(np.ones(1, real))[0] == 0.0
    x = np.logspace(-2, 2, 10_001).astype(real)
    for exponent in (-2.0, 0.3, 1.0):
        expected = x.astype(np.longdouble) ** real(exponent)
        assert np.max(np.abs(power_all(x, real(exponent)) / expected - 1.0)) < 40 * error


@pytest.mark.parametrize('real', FLOORS)
def test_exact_where_effects_rely_on_it(real):
    """An absent effect is a power 0 or an exponent 0; it must change no bit."""
    x = np.array([0.2, 1.0, 3.7], real)
    assert power_all(x, real(0.0)).tolist() == [1.0, 1.0, 1.0]
    assert exp_all(np.zeros(1, real))[0] == 1.0
    whole = np.arange(-100, 101).astype(real)
    assert np.array_equal(exp2_all(whole), 2.0 ** whole.astype(float))


@pytest.mark.parametrize(('real', 'ceiling'), [(np.float32, 126.0), (np.float64, 1023.0)])
def test_below_the_floor_and_above_the_ceiling_an_exponential_stays_there(real, ceiling):
    floor = FLOORS[real]
    far = np.array([floor, 2 * floor, -1e6, -1e30], real)
    assert exp2_all(far).tolist() == [2.0**floor] * 4
    far = np.array([0.695 * ceiling, 1e3, 1e6, 1e30], real)
    assert exp_all(far).tolist() == [2.0**ceiling] * 4
    assert power_all(np.full(1, 1e30, real), real(20.0)).tolist() == [2.0**ceiling]
