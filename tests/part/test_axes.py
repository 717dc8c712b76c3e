"""The part's own axes, seen from the gun."""

import numpy as np
import pytest

from paint_deposition.part.orientation import across_axis, downhill_axis

X, Y, Z = np.eye(3)


@pytest.mark.parametrize(
    ('outward', 'across', 'downhill'),
    [
        (-Y, X, -Z),  # stands before a gun that looks along y
        (X, Y, -Z),
        (np.sqrt(0.5) * (Z - Y), X, -np.sqrt(0.5) * (Y + Z)),  # leans back
        (Z, X, -Y),  # lies flat
        (-Z, X, Y),  # hangs overhead
    ],
)
def test_across_is_to_the_right_of_the_gun_and_level(outward, across, downhill):
    np.testing.assert_allclose(across_axis(outward, -Z), across, atol=1e-12)
    np.testing.assert_allclose(downhill_axis(outward, -Z), downhill, atol=1e-12)


def test_where_x_is_vertical_a_flat_part_takes_y():
    np.testing.assert_allclose(across_axis(X, -X), Y, atol=1e-12)
