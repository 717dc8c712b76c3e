"""How far a pattern moved from the calibration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from inference.diagnosis.linear import KNOWN, PARAMETERS, linear_fit
from paint_deposition.inference.fitting.posterior import PatternShift
from paint_deposition.model.coordinates import PATTERN

FIT = linear_fit(np.random.default_rng(0), 20, parameters=KNOWN)
PRIOR = KNOWN.prior


def moved_by(away: np.ndarray) -> PatternShift:
    """By this vector from the centre of what was known."""
    shift = PatternShift.of(replace(FIT, vector=PRIOR.centre + away))
    assert shift is not None
    return shift


def test_nothing_known_is_no_distance():
    assert PatternShift.of(linear_fit(np.random.default_rng(0), 20, parameters=PARAMETERS)) is None


def test_the_calibrated_pattern_has_not_moved():
    still = moved_by(np.zeros(len(PATTERN)))
    assert still.distance == pytest.approx(0.0)
    assert not still.is_alarming


def test_jobs_that_differ_as_assumed_are_as_far_as_told():
    draws = np.random.default_rng(1).normal(size=(500, len(PATTERN)))
    shifts = [moved_by(PRIOR.factor @ draw) for draw in draws]
    squares = np.array([shift.distance for shift in shifts]) ** 2
    assert kstest(squares, chi2(len(PATTERN)).cdf).pvalue > 0.01
    first = np.array([shift.by_coordinate['log_K1'] for shift in shifts])
    assert kstest(first, 'norm').pvalue > 0.01
    assert np.mean(np.sqrt(squares) < shifts[0].usual) == pytest.approx(0.95, abs=0.03)
    assert sum(shift.is_alarming for shift in shifts) <= 5


def test_a_bell_of_another_kind_is_warned_of_by_what_differs_most():
    away = np.zeros(len(PATTERN))
    away[4] = 8.0 * PRIOR.width[4]
    other = moved_by(away)
    assert other.is_alarming
    assert 'most in r_m (+8.0)' in other.warning
    assert other.to_dict()['by_coordinate']['r_m'] == pytest.approx(8.0)
