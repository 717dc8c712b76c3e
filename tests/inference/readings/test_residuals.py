"""Residuals in figures."""

import numpy as np
import pytest

from paint_deposition.inference.readings.residuals import Residuals


def _residuals(predicted, measured, sigma=1.0):
    predicted, measured = np.array(predicted, float), np.array(measured, float)
    return Residuals(measured, predicted, np.full(len(predicted), sigma))


def test_figures_by_hand():
    found = _residuals([0.0, 10.0, 20.0], [4.0, 12.0, 17.0], sigma=2.0)
    assert found.bias_um == pytest.approx(1.0)
    assert found.rmse_um == pytest.approx(np.sqrt((16 + 4 + 9) / 3))
    assert found.rmse_painted_um == pytest.approx(np.sqrt((4 + 9) / 2))
    assert found.chi_square_per_reading == pytest.approx(29 / 3 / 4)
    assert found.worst == 0
    assert found.painted.tolist() == [False, True, True]
