"""The part as the gun sees it: its axes, and which side of it is looked at."""

import numpy as np
import pytest

from paint_deposition.part.orientation import across_axis, downhill_axis
from paint_deposition.part.surface import facing, toward_the_gun

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


EYES = np.array([[0.0, -0.25, 0.0], [0.1, -0.25, 0.1], [-0.1, -0.25, 0.0], [3.0, -0.25, 0.0]])
AHEAD = np.tile([0.0, 1.0, 0.0], (4, 1))


def test_a_part_sprayed_from_behind_is_turned_and_says_so(make_surface, ball):
    surface = make_surface(ball(0.5), 0.05)
    assert toward_the_gun(surface, EYES, AHEAD) is surface
    turned = toward_the_gun(surface, EYES * [1, -3, 1], -AHEAD)
    np.testing.assert_array_equal(turned.normals, -surface.normals)
    np.testing.assert_allclose(turned.points().curvature_per_m, -surface.points().curvature_per_m)
    assert facing(turned, EYES * [1, -3, 1], -AHEAD)[:2] == (3, 0)
    assert turned.notes == (
        '3 of 3 poses look at the back of the mesh: its triangles were turned round',
    )
