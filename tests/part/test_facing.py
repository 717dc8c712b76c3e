"""Which side of the part the gun looks at."""

import numpy as np

from paint_deposition.part.surface import facing, toward_the_gun

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
