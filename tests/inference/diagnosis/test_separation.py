"""Separation of explanations: known cases in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from paint_deposition.inference.diagnosis.separation import Predicted, imitate

COUNT = 40


def explanation(column, amount=4.0, along=None, low=0.0, high=20.0) -> Predicted:
    """One amplitude, no error of the law unless given."""
    along = np.empty((len(column), 0)) if along is None else along
    return Predicted(
        column[:, np.newaxis], along, np.array([amount]), np.array([low]), np.array([high])
    )


@pytest.fixture
def columns():
    """Two directions of length 1 at right angles."""
    square, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(COUNT, 2)))
    return square.T


NOTHING = np.empty((COUNT, 0))


def test_at_an_angle_the_sine_of_it_is_left(columns):
    first, across = columns
    for angle in (0.0, 0.3, 1.2):
        second = explanation(np.cos(angle) * first + np.sin(angle) * across)
        left = imitate(NOTHING, explanation(first), second).separation
        assert left == pytest.approx(4.0 * np.sin(angle), abs=5e-3)


def test_an_amplitude_of_the_wrong_sign_imitates_nothing(columns):
    first, _ = columns
    left = imitate(NOTHING, explanation(first), explanation(-first)).separation
    assert left == pytest.approx(4.0, rel=1e-4)


def test_a_free_direction_of_unit_variance_shrinks_it(columns):
    first, across = columns
    left = imitate(first[:, np.newaxis], explanation(first), explanation(across)).separation
    assert left == pytest.approx(4.0 / np.sqrt(2.0), rel=1e-4)


def test_an_error_of_the_law_is_less_than_the_law(columns):
    """A law that may be 30 % off cannot be off by all of itself, however strong the effect is."""
    first, across = columns
    constant = np.ones((COUNT, 1))
    near = imitate(
        NOTHING, explanation(first, 100.0, constant, high=1e3), explanation(across)
    ).separation
    assert near > 0.35 * 100.0


def test_further_readings_gain_what_is_computed_with_them(columns):
    random = np.random.default_rng(2)
    first, second = (explanation(random.normal(size=COUNT + 1), 1.0, low=-20.0) for _ in '12')
    free = random.normal(size=(COUNT + 1, 3))
    here = np.arange(COUNT + 1) < COUNT
    before = imitate(free[here], first.select(here), second.select(here))
    (gain,) = before.gains(free[~here], first.select(~here), second.select(~here))
    after = imitate(free, first, second).separation
    assert np.hypot(before.separation, np.sqrt(gain)) == pytest.approx(after, rel=1e-3)
    joined = first.select(here).with_more(first.select(~here))
    assert np.array_equal(joined.law, replace(first).law)
