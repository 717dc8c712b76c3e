"""What benchmarks compute, print and score, on results made by hand."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from benchmarks import scores
from benchmarks.diagnosis import main as score_the_diagnosis
from benchmarks.page import page_of
from click.testing import CliRunner

ROOT = Path(__file__).resolve().parents[2]


def test_every_place_has_a_benchmark_that_fills_it(tmp_path):
    pages = ''.join(page.read_text(encoding='utf-8') for page in (ROOT / 'docs').glob('*.md'))
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    names = re.findall('<!-- measured: (.+?) -->', pages)
    assert names
    for name in names:
        assert (ROOT / f'benchmarks/{name}.py').is_file(), name
        assert f'benchmarks.page {name} ' in makefile, name
    with pytest.raises(SystemExit, match='0 pages'):
        page_of('a', tmp_path)


def test_the_diagnosis_is_scored_from_what_was_kept(tmp_path):
    results = tmp_path / 'results.jsonl'
    results.write_text(json.dumps(RIGHT | {'p_value': 0.01}) + '\n')
    done = CliRunner().invoke(score_the_diagnosis, ['--report-only', '--results', str(results)])
    assert done.exit_code == 0, done.exception
    assert 'wrong effects accepted, per campaign' in done.output


def result(case, **fields):
    return {
        'case': case, 'world': 'droplets', 'unseen': [2.0, 1.1], 'kind': 'effect',
        'hidden': ['edge_build'], 'verdict': 'effect_missing', 'accepted': [], 'classes': [],
        'strength': 10.0, 'strengths': [10.0], 'readings': 100, 'unknown': None, 'amounts': [],
        'seconds': 3.0, 'facts': {'shape': 'round', 'noise_from': 'stated'},
    } | fields  # fmt: skip


def group(probability, *members):
    return [list(members), probability, members[0]]


RIGHT = result('a', accepted=['edge_build'], classes=[group(0.9, 'edge_build', 'corner_slowdown')])
LISTED = result('b', verdict='undecided', classes=[group(0.5, 'edge_build'), group(0.3, 'sag')])
WRONG = result(
    'c',
    accepted=['sag', 'learned:time_s'],
    classes=[group(0.97, 'sag'), group(1.0, 'learned:time_s'), group(0.1, 'edge_build')],
)
BLAMED = result(
    'd', kind='unknown', hidden=['unknown:x'], accepted=['sag'], classes=[group(0.85, 'sag')]
)


def found(rows, label):
    (row,) = (row for row in rows if row.label.strip() == label)
    return [value for _, value in row.values]


def test_naming_counts_strong_effects_and_a_pair_where_both_are_strong():
    rows = scores.naming([RIGHT, LISTED, WRONG, BLAMED, result('e', strength=3.0)])
    assert found(rows, 'effect in the group named, over 8 sd') == [True, False, False]
    assert found(rows, 'named or listed') == [True, True, True]
    assert found(rows, 'named at 2 to 4 sd') == [False]
    pair = {'kind': 'pair', 'hidden': ['sag', 'edge_build'], 'strengths': [9.0, 20.0]}
    classes = [group(1.0, 'sag'), group(1.0, 'edge_build')]
    both = result('p', accepted=['sag', 'edge_build'], classes=classes, **pair)
    rows = scores.naming([both, WRONG | pair, both | {'strengths': [7.0, 20.0]}])
    assert scores.named_all(both)
    assert found(rows, 'both of two effects, each over 8 sd') == [True, False]
    assert found(rows, 'at least one') == [True, True]


def test_mistakes_are_counted_per_campaign_and_learned_laws_are_none():
    assert scores.groups(RIGHT) == [{'edge_build', 'corner_slowdown'}]
    rows = scores.mistakes([RIGHT, LISTED, WRONG, BLAMED])
    assert found(rows, 'wrong effects accepted, per campaign') == [0, 0, 1, 1]
    assert found(rows, 'unknown cause blamed on an effect') == [True]


def test_what_is_stated_is_compared_with_what_is_observed():
    every = [RIGHT, LISTED, WRONG, BLAMED]
    (high,) = (line for line in scores.reliability(every) if line.startswith('  0.80 to 0.95'))
    # 0.9 right, 0.85 wrong: 0.875 stated, half observed.
    assert all(words in high for words in ('mean 0.88', '50.0 %', 'apart by 38 points'))
    # Bins: 0.1 right; 0.3 wrong; 0.5 right; 0.9 right and 0.85 wrong; 0.97 wrong.
    error, count = scores.expected_calibration_error(every)
    assert count == 6
    assert error == pytest.approx((0.9 + 0.3 + 0.5 + 2 * 0.375 + 0.97) / 6)


def test_an_interval_covers_as_often_as_it_says():
    """Campaigns of 5 draws with shares of their own; standard error 3 points."""
    random = np.random.default_rng(5)
    hits = 0
    for _ in range(50):
        shares = np.repeat(random.beta(2.0, 2.0, 40), 5)
        values = [(str(k // 5), float(v)) for k, v in enumerate(random.random(200) < shares)]
        low, high = scores.interval(values)
        hits += low <= 0.5 <= high
    assert hits / 50 >= 0.86
    # Zero of three campaigns, however often redrawn: up to 1 - 0.025^(1/3).
    values = [(str(k % 3), 0.0) for k in range(60)]
    assert scores.interval(values) == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 3)))
    assert 'none' in str(scores.Row('nothing', []))
