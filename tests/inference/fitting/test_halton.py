"""Points that fill a cube evenly."""

import numpy as np
import pytest
from scipy.stats import qmc

from paint_deposition.inference.fitting.halton import halton


@pytest.mark.parametrize(('dimensions', 'seed'), [(1, 0), (3, 7), (40, 1)])
def test_points_are_those_of_scipy(dimensions: int, seed: int) -> None:
    expected = qmc.Halton(dimensions, seed=seed).random(72)
    np.testing.assert_array_equal(halton(72, dimensions, seed), expected)


def test_every_slice_of_an_axis_has_its_share() -> None:
    points = halton(2 * 3 * 8 * 9, 2, 5)
    halves = np.bincount((8 * points[:, 0]).astype(int), minlength=8)
    thirds = np.bincount((9 * points[:, 1]).astype(int), minlength=9)
    assert set(halves) == {2 * 3 * 9}
    assert set(thirds) == {2 * 3 * 8}
