"""What `paint line` says and draws of parts in alarm: which, in what, and what to do."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from batch.line.synthetic import FIRST_S, HOUR_S
from paint_deposition.batch.line.alarms import alarms_of
from paint_deposition.batch.line.changes import Series, changes_of
from paint_deposition.batch.line.picture import line_figure
from paint_deposition.report.style import ALARM

COUNT, BAD = 30, 20
NAMES = [f'door_{row + 1:02d}' for row in range(COUNT)]
# Ten parts a day, an hour apart.
TIMES_S = FIRST_S + np.array([86400.0 * (row // 10) + HOUR_S * (row % 10) for row in range(COUNT)])


def series(name, *outliers, unit='%', members=None):
    values = np.random.default_rng(5).normal(size=COUNT)
    for row, size in outliers:
        values[row] += size
    return Series(name, unit, members or (name,), values, np.ones(COUNT), 10, 6000.0)


def test_a_single_bad_part_is_in_alarm_and_not_those_after_it():
    every = [
        series('misfit', (BAD, 9.0)), series('air_drift.shift_down_m', (BAD, 20.0), unit='m'),
        series('level'),
    ]  # fmt: skip
    (alarm,) = alarms_of(every, NAMES)
    assert alarm.parts == ('door_21',)
    assert alarm.series == ('air_drift.shift_down_m', 'misfit')
    assert alarm.sentence.startswith('door_21: air drift, shift down and misfit of the film; ')
    assert alarm.sentence.endswith('measure it again; if it stays so, diagnose these readings')
    assert alarms_of(every[2:], NAMES) == []


def test_parts_in_alarm_one_after_the_other_are_one_alarm():
    (alarm,) = alarms_of([series('level', *((row, -9.0) for row in range(24, COUNT)))], NAMES)
    assert alarm.parts == tuple(NAMES[24:])
    assert alarm.sentence.startswith('6 parts, door_25 to door_30: film level; compare the gauge')


def test_the_picture_shows_news_only_parts_side_by_side_and_alarms_in_red():
    quiet = series('sag.run_m', unit='m')
    every = [series('level', (BAD, 9.0)), series('misfit'), quiet]
    figure = line_figure('a line', every, [], TIMES_S, set())
    left, *_ = figure.axes
    assert len(figure.axes) == 4
    assert all('_' not in axes.get_ylabel() for axes in figure.axes)
    red = [line for line in left.lines if to_hex(line.get_color()) == ALARM]
    assert [line.get_xdata().tolist() for line in red] == [[BAD]]
    # A night takes no more room than an hour.
    assert left.dataLim.x1 == COUNT - 1


@pytest.mark.parametrize('kind', ['step', 'drift'])
def test_a_change_is_dated_with_its_interval_and_in_the_words_of_the_trade(kind):
    grown = np.maximum(np.arange(COUNT) - 11, 0)
    bent = 6.0 * (grown > 0) if kind == 'step' else 0.8 * grown
    moved = series('air_drift.shift_down_m', *enumerate(bent), unit='m')
    (change,) = changes_of([moved], TIMES_S)
    assert change.kind == kind
    assert change.earliest_s <= TIMES_S[12] <= change.latest_s
    assert change.sentence.startswith('air drift, shift down rose by ')
    words = {'step': 'with the part of', 'drift': 'in all, beginning '}[kind]
    assert words in change.sentence
    assert line_figure('', [moved], [change], TIMES_S, set()).axes[0].patches
