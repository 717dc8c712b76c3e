"""What arrives near each knot of a learned law."""

import numpy as np
import pytest

from paint_deposition.effects.learned.law import hat_sums, hat_weights

KNOTS = 7


@pytest.mark.parametrize('rays', [1, 40])
def test_equals_the_sum_over_all_knots(rays: int) -> None:
    random = np.random.default_rng(1)
    share = random.exponential(size=(40, 5))
    position = random.uniform(-3.0, KNOTS + 2.0, size=(rays, 5))
    position[0] = [-2.0, -1.0, 0.0, KNOTS - 1.0, KNOTS]
    everywhere = np.broadcast_to(hat_weights(position, KNOTS), (40, 5, KNOTS))
    expected = np.einsum('mp,mpk->pk', share, everywhere)
    np.testing.assert_allclose(hat_sums(share, position, KNOTS), expected, atol=1e-12)
