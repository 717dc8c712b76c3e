"""Driven against programmed speed: what integrates by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from paint_deposition.errors import RecordingError
from paint_deposition.motion.driven_speed import DrivenSpeed, driven_speed
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move, timed
from paint_deposition.motion.trajectory import Trajectory

START_NS = 1_760_000_000_000_000_000
SPEED, SLOW, BRAKING = 0.5, 0.2, 0.525  # m/s, m/s and m/s^2: it slows down over 0.2 m
BRAKING_M = (SPEED**2 - SLOW**2) / (2 * BRAKING)
TOWARD_Y = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
PASS_M, INDEX_M = 1.0, 0.3


def move(x: float, z: float, spraying: bool) -> Move:
    return Move(np.array([x, -0.25, z]), np.array(TOWARD_Y), SPEED, spraying)


def programme() -> Trajectory:
    """Three passes of a metre there and back, 300 mm apart, with the gun off in between."""
    moves = [move(0.0, 0.0, False)]
    for number in range(3):
        x = PASS_M * (number % 2 == 0)
        if number:
            moves.append(move(PASS_M - x, INDEX_M * number, False))
        moves.append(move(x, INDEX_M * number, True))
    return timed(moves, gun_known=True)


def slowed(slow_passes=(0, 2), noise_m: float = 0.0) -> Trajectory:
    """That motion at 250 Hz, slower toward the end of some passes by constant braking."""
    way_m = np.linspace(0.0, 3 * PASS_M + 2 * INDEX_M, 200_001)
    left_m = np.inf * np.ones_like(way_m)
    for number in slow_passes:
        end_m = number * (PASS_M + INDEX_M) + PASS_M
        before = (way_m <= end_m) & (way_m > end_m - BRAKING_M)
        left_m[before] = end_m - way_m[before]
    speed = np.minimum(SPEED, np.sqrt(SLOW**2 + 2 * BRAKING * left_m))
    step_m = np.diff(way_m)
    time_s = np.concatenate([[0.0], np.cumsum(2 * step_m / (speed[1:] + speed[:-1]))])
    planned = programme()
    stamps_s = np.arange(0.0, time_s[-1], 0.004)
    at_m = np.interp(stamps_s, time_s, way_m)
    planned_m = SPEED * 1e-9 * planned.stamps_ns
    positions = np.stack(
        [np.interp(at_m, planned_m, planned.positions_m[:, axis]) for axis in range(3)], axis=1
    )
    positions += np.random.default_rng(3).normal(scale=noise_m, size=positions.shape)
    switched_s = np.interp(SPEED * 1e-9 * planned.trigger_stamps_ns, way_m, time_s)
    return replace(
        planned,
        stamps_ns=START_NS + np.round(1e9 * stamps_s).astype(np.int64),
        positions_m=positions,
        quaternions_xyzw=np.tile(TOWARD_Y, (len(positions), 1)),
        trigger_stamps_ns=START_NS + np.round(1e9 * switched_s).astype(np.int64),
    )


def compared(driven: Trajectory) -> DrivenSpeed:
    return driven_speed(spray_path(driven)[0], spray_path(programme())[0])


def test_a_robot_that_keeps_its_programme():
    found = compared(programme())
    assert len(found.passes) == 3
    for figures in (*found.passes, found.whole):
        assert figures.driven_m_per_s == pytest.approx(SPEED, rel=1e-6)
        assert figures.slower == 0.0
        assert figures.film == pytest.approx(1.0, rel=1e-6)
    assert found.whole.way_m == pytest.approx(3 * PASS_M, rel=1e-3)
    assert found.on_programme == 1.0


@pytest.mark.parametrize('noise_m', [0.0, 1e-5])
def test_a_slow_end_of_a_pass_is_what_integrates_by_hand(noise_m):
    first, second, third = compared(slowed(noise_m=noise_m)).passes
    braking_s = (SPEED - SLOW) / BRAKING
    film = (braking_s + (PASS_M - BRAKING_M) / SPEED) / (PASS_M / SPEED)
    slower_m = ((0.95 * SPEED) ** 2 - SLOW**2) / (2 * BRAKING)
    for figures in (first, third):
        assert figures.programmed_m_per_s == pytest.approx(SPEED, rel=1e-3)
        assert figures.film == pytest.approx(film, rel=2e-3)
        assert figures.slower == pytest.approx(slower_m / PASS_M, abs=0.01)
        assert figures.slower_at_ends == pytest.approx(0.1 / slower_m, abs=0.06)
        # The mean over the last 10 mm, and they are driven at 0.2 to 0.225 m/s.
        assert SLOW < figures.slowest_m_per_s < 0.226
    assert second.slower == 0.0
    assert math.isnan(second.slower_at_ends)
    assert second.film == pytest.approx(1.0, abs=2e-3)


def test_a_programme_of_another_part_is_refused():
    driven = replace(programme(), positions_m=programme().positions_m + np.array([0.0, 0.1, 0.0]))
    with pytest.raises(RecordingError, match='only 0 % of the way sprayed lies within 50 mm'):
        compared(driven)
