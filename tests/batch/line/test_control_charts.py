"""Limits against published run lengths, and charts of known series."""

import numpy as np
import pytest

from paint_deposition.batch.line.control_charts import (
    charts,
    ewma_limit,
    robust_deviation,
    shewhart_limit,
)


def test_limits_have_the_published_run_lengths():
    # Montgomery (2012): 3 sigma 370; Lucas and Saccucci (1990): EWMA with weight 0.2 has
    # L = 2.962 for 500.
    assert shewhart_limit(370.4) == pytest.approx(3.0, abs=1e-3)
    assert ewma_limit(500.0) == pytest.approx(2.962, abs=0.01)


def test_each_chart_finds_a_step_and_keeps_quiet_before():
    values = np.zeros(60)
    values[40:] = 2.0
    found = charts(values, 1000.0)
    assert found.alarms['shewhart'].size == 0
    assert 40 < found.alarms['ewma'][0] < 50
    values[50] = 5.0
    assert charts(values, 1000.0).alarms['shewhart'].tolist() == [50]


def test_a_step_does_not_widen_the_deviation():
    values = np.random.default_rng(2).normal(size=2000)
    values[1000:] += 50.0
    assert robust_deviation(values) == pytest.approx(1.0, abs=0.08)
