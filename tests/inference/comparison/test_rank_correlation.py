"""Spearman's rank correlation."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from paint_deposition.inference.comparison.rank_correlation import rank_correlation


@pytest.mark.parametrize('ties', [False, True])
def test_equals_the_one_of_scipy(ties: bool) -> None:
    random = np.random.default_rng(3)
    first = random.normal(size=60)
    second = first + 2.0 * random.normal(size=60)
    if ties:
        first, second = np.round(first), np.round(second)
    expected = spearmanr(first, second)
    np.testing.assert_allclose(rank_correlation(first, second), tuple(expected), rtol=1e-12)


def test_order_alone_counts() -> None:
    values = np.array([0.3, 4.0, 2.0, 9.0])
    assert rank_correlation(values, np.exp(values)) == pytest.approx((1.0, 0.0), abs=1e-12)
    assert rank_correlation(values, -values)[0] == pytest.approx(-1.0)
