"""Scores of results made by hand, whose answers are known."""

import numpy as np
import pytest
from benchmarks.amounts import true_amounts
from benchmarks.scores import (
    Row,
    interval,
    mistakes,
    naming,
    reliability,
)


def result(case, **fields):
    return {
        'case': case,
        'redraw': 0,
        'unseen': [2.0, 1.1],
        'kind': 'effect',
        'hidden': ['edge_build'],
        'verdict': 'effect_missing',
        'accepted': [],
        'classes': [],
        'strength': 10.0,
        'strengths': [10.0],
        'readings': 100,
        'bic': [],
        'unknown': None,
    } | fields


RIGHT = result('a', accepted=['edge_build'], classes=[[['edge_build', 'corner_slowdown'], 0.9]])
LISTED = result('b', verdict='undecided', classes=[[['edge_build'], 0.5], [['sag'], 0.3]])
WRONG = result(
    'c',
    accepted=['sag', 'learned:time_s'],
    classes=[[['sag'], 0.97], [['learned:time_s'], 1.0], [['edge_build'], 0.1]],
    bic=['edge_build', 'sag'],
)
BLAMED = result(
    'd', kind='unknown', hidden=['unknown:x'], accepted=['sag'], classes=[[['sag'], 0.85]]
)


def found(rows, label):
    (row,) = (row for row in rows if row.label.strip() == label)
    return [value for _, value in row.values]


def test_naming_counts_accepted_groups_of_strong_effects():
    rows = naming([RIGHT, LISTED, WRONG, BLAMED, result('e', strength=3.0)])
    assert found(rows, 'effect in the group named, over 8 sd') == [True, False, False]
    assert found(rows, 'named or listed') == [True, True, True]
    assert found(rows, 'named at 2 to 4 sd') == [False]
    assert found(rows, 'stepwise BIC, first chosen') == [False, False, True]


def test_a_pair_counts_where_both_are_strong():
    pair = {'kind': 'pair', 'hidden': ['sag', 'edge_build'], 'strengths': [9.0, 20.0]}
    both = result(
        'p',
        accepted=['sag', 'edge_build'],
        classes=[[['sag'], 1.0], [['edge_build'], 1.0]],
        **pair,
    )
    one = {**WRONG, **pair}
    weak = both | {'strengths': [7.0, 20.0]}
    rows = naming([both, one, weak])
    assert found(rows, 'both of two effects, each over 8 sd') == [True, False]
    assert found(rows, 'at least one') == [True, True]
    assert found(rows, 'stepwise BIC, both') == [False, True]


def test_mistakes_are_counted_per_campaign():
    rows = mistakes([RIGHT, LISTED, WRONG, BLAMED])
    assert found(rows, 'wrong effects accepted, per campaign') == [0, 0, 1, 1]
    assert found(rows, 'unknown cause blamed on an effect') == [True]


def test_reliability_compares_stated_with_observed():
    lines = reliability([RIGHT, LISTED, WRONG, BLAMED])
    (high,) = (line for line in lines if line.startswith('  0.80 to 0.95'))
    # 0.9 right, 0.85 wrong: 0.875 stated, half observed.
    assert 'mean 0.88' in high
    assert '50.0 %' in high
    assert 'apart by 38 points' in high
    (top,) = (line for line in lines if line.startswith('  0.95 to 1.00'))
    assert '1 in 1' in top


def test_an_interval_covers_as_often_as_it_says():
    """Campaigns of 5 draws with shares of their own; standard error 1.5 points."""
    random = np.random.default_rng(5)
    hits = 0
    for _ in range(200):
        shares = np.repeat(random.beta(2.0, 2.0, 40), 5)
        values = [(str(k // 5), float(v)) for k, v in enumerate(random.random(200) < shares)]
        low, high = interval(values)
        hits += low <= 0.5 <= high
    assert 0.89 <= hits / 200 <= 0.99


def test_never_is_not_known_from_few_campaigns():
    """Zero of three campaigns, however often redrawn: up to 1 - 0.025^(1/3)."""
    values = [(str(k % 3), 0.0) for k in range(60)]
    assert interval(values) == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 3)))
    assert 'none' in str(Row('nothing', []))


def test_amounts_are_compared_where_they_mean_the_same():
    hidden = {'id': 'gun_wake', 'form': 'even', 'amplitude': 0.02}
    assert true_amounts(hidden, [4]) == {'lag_s': 0.02}
    step = {'id': 'flow_drift', 'form': 'step', 'amplitude': 0.02}
    assert true_amounts(step, [4]) == {}
    amount = true_amounts(step | {'form': ''}, [4])['drift_per_pass']
    assert amount == pytest.approx(0.02, rel=0.02)
