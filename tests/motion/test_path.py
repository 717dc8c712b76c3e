"""What is changed on a whole path at once."""

import numpy as np
import pytest

from booth import path_of, serpentine


@pytest.mark.parametrize('factor', [0.5, np.float64(1.2)])
def test_flow_is_scaled_with_that_of_the_opening_behind_which_it_tails_off(factor):
    path = path_of(serpentine((0.1, -0.1), flow=0.8))
    scaled = path.with_flow_scaled(factor)
    np.testing.assert_array_equal(scaled.flow, factor * path.flow)
    np.testing.assert_array_equal(scaled.open_flow, factor * path.open_flow)
    assert scaled.spraying_time_s == pytest.approx(factor * path.spraying_time_s)


def test_flow_may_be_scaled_anew_on_every_sub_step():
    path = path_of(serpentine((0.1, -0.1)))
    first = path.spray_pass == 0
    alone = path.with_flow_scaled(first)
    assert np.all(alone.flow[~first] == 0.0)
    assert np.all(alone.open_flow[~first] == 0.0)
    np.testing.assert_array_equal(alone.flow[first], path.flow[first])
