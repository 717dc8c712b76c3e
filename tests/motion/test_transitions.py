"""The transitions of the tables of strokes and of passes, and what the trigger's clock shows."""

import numpy as np
import pytest

from paint_deposition.motion.passes import first_pass, follow_passes
from paint_deposition.motion.strokes import first_stroke, follow_strokes
from paint_deposition.motion.trigger import first_trigger, follow_trigger

STEP_M = 0.004  # Three of them make a heading step.
DWELL_S = 0.01
EAST, NORTH, WEST = 0.0, 90.0, 180.0
ON, OFF = 1.0, 0.0
# The gun comes east and sprays a pass of 300 mm.
A_PASS = [(0.1, EAST, OFF), (0.3, EAST, ON)]


def followed(moves):
    """A gun that looks down and moves over a plane: stroke, distance from the turn, and pass.

    moves: length [m], direction [degrees], flow, and optionally True for a gap before it.
    """
    place, strokes, passes = np.zeros(3), first_stroke(), first_pass(0.0)
    for length_m, toward_deg, flow, *gap in moves:
        angle, count = np.radians(toward_deg), round(length_m / STEP_M)
        forward = np.array([np.cos(angle), np.sin(angle), 0.0])
        position = place + STEP_M * np.arange(1, count + 1)[:, np.newaxis] * forward
        place = position[-1]
        normal = np.tile([0.0, 0.0, -1.0], (count, 1))
        after_gap = np.arange(count) == (0 if gap else -1)
        velocity = np.tile(STEP_M / DWELL_S * forward, (count, 1))
        stroke, from_turn, heading, step = follow_strokes(
            strokes, position, normal, velocity, np.full(count, DWELL_S), after_gap
        )
        spray_pass = follow_passes(
            passes, position, normal, heading, step, np.full(count, flow), after_gap
        )
    return stroke[-1], from_turn[-1], spray_pass[-1]


@pytest.mark.parametrize(
    ('moves', 'stroke', 'from_turn_m'),
    [
        ([(0.2, EAST, OFF), (0.2, EAST + 50.0, OFF)], 0, 0.4),
        # The turn lies at the end of the first leg, half a sub-step before the first sub-step.
        ([(0.2, EAST, OFF), (0.1, NORTH, OFF)], 1, 0.1),
        ([(2 * STEP_M, EAST, OFF), (STEP_M, EAST, OFF, True)], 1, 0.0),
        ([(0.2, EAST, OFF), (STEP_M, EAST, OFF, True)], 1, 0.0),
    ],
    ids=['keeps to its mean', 'leaves it', 'gap before a heading is known', 'gap'],
)
def test_strokes_begin_at_turns_and_gaps(moves, stroke, from_turn_m):
    found = followed(moves)
    assert found[0] == stroke
    assert found[1] == pytest.approx(from_turn_m + 0.5 * STEP_M, abs=STEP_M)


@pytest.mark.parametrize(
    ('moves', 'number'),
    [
        ([(0.1, EAST, OFF)], -1),
        ([(STEP_M, EAST, ON)], 0),
        (A_PASS, 0),
        ([*A_PASS, (0.1, EAST, OFF), (0.1, EAST, ON)], 0),
        ([*A_PASS, (0.1, EAST + 20.0, OFF), (0.1, EAST + 20.0, ON)], 0),
        ([*A_PASS, (0.2, EAST + 45.0, OFF), (STEP_M, EAST, ON)], 1),
        ([*A_PASS, (0.1, NORTH, OFF)], 0),
        ([*A_PASS, (0.1, NORTH, OFF), (0.1, EAST, ON)], 1),
        ([*A_PASS, (0.1, NORTH, OFF), (0.1, WEST, ON)], 1),
        ([*A_PASS, (0.3, NORTH, ON)], 0),
        ([*A_PASS, (2 * STEP_M, EAST, ON, True)], 0),
        ([*A_PASS, (2 * STEP_M, EAST, ON, True), (0.1, EAST, ON)], 1),
        # The gun opens just before the corner of the approach, or well before it.
        ([(0.2, EAST, OFF), (2 * STEP_M, EAST, ON), (0.2, NORTH, ON)], 0),
        ([(0.2, EAST, OFF), (2 * STEP_M, EAST, ON), (0.2, NORTH, ON), (0.2, EAST, ON)], 0),
        ([(0.2, EAST, OFF), (0.1, EAST, ON), (0.2, NORTH, ON), (0.2, EAST, ON)], 1),
    ],
    ids=[
        'not open yet', 'no heading yet', 'one pass', 'opens again on its line',
        'opens again a little aside', 'opens on another track', 'turned away',
        'next, the same way', 'next, the other way', 'a link is none', 'gap', 'behind a gap',
        'opens just before a corner', 'and links from there', 'opens well before a corner',
    ],
)  # fmt: skip
def test_passes_are_the_lines_that_are_sprayed(moves, number):
    assert followed(moves)[2] == number


def test_the_trigger_is_timed_from_its_changes_and_forgotten_at_a_gap():
    flow = np.array([0.0, 0.5, 0.5, 0.0, 0.0, 0.8, 0.8])
    open_flow, _, since_on, since_off = follow_trigger(
        first_trigger(0.0), np.ones(7), flow, np.zeros(7, np.int64), np.arange(7) == 6
    )
    assert open_flow.tolist() == [1.0, 0.5, 0.5, 0.5, 0.5, 0.8, 0.8]
    assert since_on.tolist() == [np.inf, 0.5, 1.5, 2.5, 3.5, 0.5, 0.5]
    assert since_off.tolist() == [np.inf, np.inf, np.inf, 0.5, 1.5, 2.5, np.inf]


def test_a_gun_that_was_open_before_the_first_sub_step_has_not_opened():
    _, _, since_on, _ = follow_trigger(
        first_trigger(1.0), np.ones(2), np.ones(2), np.zeros(2, np.int64), np.zeros(2, bool)
    )
    assert since_on.tolist() == [np.inf, np.inf]
