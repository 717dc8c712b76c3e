"""Colours of film and residual."""

import numpy as np
import pytest

from paint_deposition.report import colour_scales as colours
from paint_deposition.report.colour_scales import FILM_PALETTE, film_scale


def test_under_over_and_bare_stand_out_and_the_residual_is_even_about_zero():
    scale = film_scale(np.empty(0), 20.0, 50.0)
    values = np.array([19.9, 20.0, 50.0, 50.1, 35.0, np.nan])
    shown = np.array([True, True, True, True, False, True])
    rgba = scale.rgba(values, shown)
    assert tuple(rgba[0, :3]) == colours.UNDER_RGB
    assert np.array_equal(rgba[1], FILM_PALETTE[0])
    assert np.array_equal(rgba[2], FILM_PALETTE[255])
    assert tuple(rgba[3, :3]) == colours.OVER_RGB
    assert tuple(rgba[4, :3]) == tuple(rgba[5, :3]) == colours.BARE_RGB
    assert np.all(rgba[:, 3] == 255)
    scale = colours.residual_scale(7.0)
    assert (scale.low, scale.high) == (-8.0, 8.0)
    grey = scale.rgba(np.array([0.0]), np.array([True]))[0, :3]
    assert np.ptp(grey.astype(int)) < 5


def test_automatic_ends_are_round_figures():
    ends = {0: 1, 0.97: 1, 1: 1, 33: 40, 100: 100, 101: 150, 6.1: 8}
    for value, rounded in ends.items():
        assert colours.round_up(value) == pytest.approx(rounded)
        assert film_scale(np.array([0.0, value])).high == pytest.approx(rounded)


@pytest.mark.parametrize(
    ('film', 'ends'),
    [((16.7, 50.9), (15, 55)), ((17.7, 21.9), (17, 22)), ((5, 100), (0, 100)),
     ((20, 20), (20, 20.05))],
)  # fmt: skip
def test_a_film_that_is_thick_everywhere_has_the_colours_for_itself(film, ends):
    scale = film_scale(np.array(film, dtype=float))
    assert (scale.low, scale.high) == pytest.approx(ends)
