"""Every transition of the tables of strokes and of passes, and what the trigger's clock shows."""

import numpy as np
import pytest

from paint_deposition.motion.passes import (
    AWAITED,
    ENDED,
    RUNS,
    first_pass,
    follow_passes,
)
from paint_deposition.motion.strokes import first_stroke, follow_strokes
from paint_deposition.motion.trigger import first_trigger, follow_trigger

STEP_M = 0.004  # Three of them make a heading step.
DWELL_S = 0.01
EAST, NORTH, WEST = 0.0, 90.0, 180.0


class Gun:
    """A gun that looks down and moves over a plane, followed by the machines."""

    def __init__(self):
        self.place = np.zeros(3)
        self.stroke = first_stroke()
        self.passes = first_pass(0.0)

    def go(self, length_m, toward_deg, flow=0.0, gap=False):
        """Move on; returns the last sub-step's stroke, distance from the turn, and pass."""
        angle = np.radians(toward_deg)
        forward = np.array([np.cos(angle), np.sin(angle), 0.0])
        count = round(length_m / STEP_M)
        position = self.place + STEP_M * np.arange(1, count + 1)[:, np.newaxis] * forward
        self.place = position[-1]
        velocity = np.tile(STEP_M / DWELL_S * forward, (count, 1))
        normal = np.tile([0.0, 0.0, -1.0], (count, 1))
        after_gap = np.arange(count) == (0 if gap else -1)
        stroke, from_turn, heading, step = follow_strokes(
            self.stroke, position, normal, velocity, np.full(count, DWELL_S), after_gap
        )
        spray_pass = follow_passes(
            self.passes, position, normal, heading, step, np.full(count, flow), after_gap
        )
        return stroke[-1], from_turn[-1], spray_pass[-1]

    @property
    def stroke_is_new(self):
        return self.stroke['length_m'][0] == 0.0

    @property
    def state(self):
        return self.passes['state'][0]


def test_a_stroke_is_new_until_its_first_heading_step():
    gun = Gun()
    assert gun.go(2 * STEP_M, EAST)[0] == 0
    assert gun.stroke_is_new
    gun.go(0.04, EAST)
    assert not gun.stroke_is_new
    np.testing.assert_allclose(gun.stroke['mean'][0], [1.0, 0.0, 0.0])


def test_a_stroke_runs_on_through_steps_that_keep_to_its_mean():
    gun = Gun()
    gun.go(0.2, EAST)
    assert gun.go(0.2, EAST + 50.0)[0] == 0
    assert gun.stroke['mean'][0, 1] > 0.0


def test_a_step_that_leaves_the_mean_begins_a_stroke_where_the_path_turned():
    gun = Gun()
    gun.go(0.2, EAST)
    stroke, from_turn_m, _ = gun.go(0.1, NORTH)
    assert stroke == 1
    # The turn lies at the end of the first leg, half a sub-step before the first sub-step.
    assert from_turn_m == pytest.approx(0.1 + 0.5 * STEP_M, abs=0.5 * STEP_M)
    assert gun.stroke['mean'][0, 1] > 0.99


@pytest.mark.parametrize('length_m', [2 * STEP_M, 0.2], ids=['new', 'runs'])
def test_a_gap_begins_a_stroke_of_unknown_heading(length_m):
    gun = Gun()
    gun.go(length_m, EAST)
    stroke, from_turn_m, _ = gun.go(STEP_M, EAST, gap=True)
    assert stroke == 1
    assert gun.stroke_is_new
    assert from_turn_m == pytest.approx(0.5 * STEP_M)


def test_a_pass_is_awaited_until_the_gun_opens_on_a_known_heading():
    gun = Gun()
    assert gun.go(0.1, EAST)[2] == -1
    assert gun.state == AWAITED
    assert gun.go(STEP_M, EAST, flow=1.0, gap=True)[2] == 0
    assert gun.state == AWAITED
    assert gun.go(0.1, EAST, flow=1.0)[2] == 0
    assert gun.state == RUNS


def spraying_pass():
    gun = Gun()
    gun.go(0.1, EAST)
    gun.go(0.3, EAST, flow=1.0)
    assert gun.state == RUNS
    return gun


def test_only_while_the_gun_is_open_does_the_mean_of_a_pass_take_in_headings():
    gun = spraying_pass()
    before = gun.passes['mean'].copy()
    gun.go(0.1, EAST + 20.0)
    assert gun.state == RUNS
    np.testing.assert_array_equal(gun.passes['mean'], before)
    assert gun.go(0.1, EAST + 20.0, flow=1.0)[2] == 0
    assert gun.passes['mean'][0, 1] > before[0, 1]


@pytest.mark.parametrize('end', [{'toward_deg': NORTH}, {'toward_deg': EAST, 'gap': True}])
def test_a_turn_and_a_gap_end_a_pass(end):
    gun = spraying_pass()
    assert gun.go(0.1, **end)[2] == 0
    assert gun.state == ENDED


def test_a_pass_goes_on_where_the_gun_opens_again_on_its_line():
    gun = spraying_pass()
    gun.go(0.1, EAST)
    assert gun.go(0.1, EAST, flow=1.0)[2] == 0


def test_a_gun_that_opens_on_another_track_ends_the_pass_and_begins_the_next():
    gun = spraying_pass()
    gun.go(0.2, EAST + 45.0)
    assert gun.state == RUNS
    assert gun.go(STEP_M, EAST, flow=1.0)[2] == 1
    assert gun.state == RUNS


@pytest.mark.parametrize('way_back_deg', [EAST, WEST])
def test_the_next_pass_runs_on_the_line_of_the_last_either_way(way_back_deg):
    gun = spraying_pass()
    gun.go(0.1, NORTH)
    assert gun.go(0.1, way_back_deg, flow=1.0)[2] == 1
    assert gun.state == RUNS


def test_spraying_off_the_line_of_the_last_pass_is_a_link():
    gun = spraying_pass()
    assert gun.go(0.3, NORTH, flow=1.0)[2] == 0
    assert gun.state == ENDED


def test_after_a_gap_the_number_stays_until_a_heading_is_known():
    gun = spraying_pass()
    assert gun.go(2 * STEP_M, EAST, flow=1.0, gap=True)[2] == 0
    assert gun.state == ENDED
    assert gun.go(0.1, EAST, flow=1.0)[2] == 1


@pytest.mark.parametrize(('length_m', 'state'), [(2 * STEP_M, RUNS), (0.1, ENDED)])
def test_a_first_pass_on_the_heading_of_the_approach_is_awaited_once_more(length_m, state):
    """The gun opens just before the corner, or well before it."""
    gun = Gun()
    gun.go(0.2, EAST)
    gun.go(length_m, EAST, flow=1.0)
    assert gun.go(0.2, NORTH, flow=1.0)[2] == 0
    assert gun.state == state


def test_the_trigger_is_timed_from_its_changes_and_forgotten_at_a_gap():
    state = first_trigger(0.0)
    flow = np.array([0.0, 0.5, 0.5, 0.0, 0.0, 0.8, 0.8])
    after_gap = np.arange(7) == 6
    open_flow, _, since_on, since_off = follow_trigger(
        state, np.ones(7), flow, np.zeros(7, np.int64), after_gap
    )
    assert open_flow.tolist() == [1.0, 0.5, 0.5, 0.5, 0.5, 0.8, 0.8]
    assert since_on.tolist() == [np.inf, 0.5, 1.5, 2.5, 3.5, 0.5, 0.5]
    assert since_off.tolist() == [np.inf, np.inf, np.inf, 0.5, 1.5, 2.5, np.inf]


def test_a_gun_that_was_open_before_the_first_sub_step_has_not_opened():
    _, _, since_on, _ = follow_trigger(
        first_trigger(1.0), np.ones(2), np.ones(2), np.zeros(2, np.int64), np.zeros(2, bool)
    )
    assert since_on.tolist() == [np.inf, np.inf]
