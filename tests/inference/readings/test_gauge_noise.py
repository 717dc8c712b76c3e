"""Gross outliers among repeats: found and named, while honest readings are left alone."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.gauge_noise import (
    gauge_noise,
    gross_outliers,
    left_out_lines,
)
from paint_deposition.inference.readings.readings import Readings

# Numbers of readings at each point.
LAYOUTS = {
    '3 pairs': [2] * 3,
    '6 pairs': [2] * 6,
    '20 pairs': [2] * 20,
    '6 triples': [3] * 6,
    'one point': [8],
    'mixed': [1] * 30 + [2] * 10 + [3] * 5 + [5] * 2,
}
CAMPAIGNS = 400


def usual_noise_um(film_um: np.ndarray) -> np.ndarray:
    return np.hypot(0.7, 0.01 * film_um)


def campaigns(
    layout: str, noise: Callable[[int], np.ndarray]
) -> Iterator[tuple[Readings, np.ndarray]]:
    """Readings of 20 to 60 um and the film below them; `noise(count)` is in usual noises."""
    repeats = LAYOUTS[layout]
    owner = np.repeat(np.arange(len(repeats)), repeats)
    film = np.linspace(20.0, 60.0, len(repeats))[owner]
    for _ in range(CAMPAIGNS):
        thickness = film + usual_noise_um(film) * noise(len(owner))
        yield Readings.of(np.zeros((len(owner), 3)), thickness, point=owner.astype(str)), film


def at_points(points: str, thickness_um: list[float], sigma_um: float = np.nan) -> Readings:
    """Readings at points of one letter each."""
    count = len(thickness_um)
    return Readings.of(
        np.zeros((count, 3)),
        thickness_um,
        point=np.array(list(points)),
        sigma_um=np.full(count, sigma_um),
    )


def honest_pairs(count: int = 10, sigma_um: float = 0.7) -> tuple[str, list[float]]:
    """Pairs at points A, B, ... of 26 um, whose scatter has this standard deviation."""
    offset = sigma_um * np.abs(np.random.default_rng(5).normal(size=count)) / np.sqrt(2.0)
    thickness = np.column_stack([26.0 - offset, 26.0 + offset]).ravel()
    return ''.join(2 * chr(ord('A') + k) for k in range(count)), thickness.tolist()


# --- honest readings stay


@pytest.mark.slow
@pytest.mark.parametrize('layout', LAYOUTS)
def test_normal_readings_are_not_dropped(layout):
    random = np.random.default_rng(2)
    dropped = [
        gross_outliers(readings).mean()
        for readings, _ in campaigns(layout, lambda count: random.normal(size=count))
    ]
    assert np.mean(dropped) < 1e-3


@pytest.mark.parametrize('layout', ['20 pairs', 'mixed'])
def test_the_noise_of_normal_readings_is_unbiased(layout):
    """400 campaigns with 20 degrees of freedom or more know a standard deviation to 0.8 %."""
    random = np.random.default_rng(3)
    squares = [
        np.mean((gauge_noise(readings).sigma_um / usual_noise_um(film)) ** 2)
        for readings, film in campaigns(layout, lambda count: random.normal(size=count))
    ]
    assert np.sqrt(np.mean(squares)) == pytest.approx(1.0, abs=0.03)


def test_a_display_in_whole_micrometres_makes_no_outliers():
    """Nine pairs in ten without any scatter are no reason to doubt the tenth."""
    labels, _ = honest_pairs()
    assert not gross_outliers(at_points(labels, [26.0] * 19 + [27.0])).any()


# --- slips are found


def test_one_slip_does_not_raise_the_noise():
    labels, thickness = honest_pairs()
    readings = at_points(labels + 'xxx', [*thickness, 15.5, 26.6, 26.1])
    noise = gauge_noise(readings)
    assert np.flatnonzero(noise.gross).tolist() == [20]
    honest = gauge_noise(readings.select(~noise.gross))
    assert noise.sigma_um[:20] == pytest.approx(honest.sigma_um[:20])
    assert noise.degrees_of_freedom == honest.degrees_of_freedom == 11


@pytest.mark.parametrize(
    ('thickness', 'gross'),
    [
        ([15.5, 26.4], [True, True]),
        ([26.6, 15.5, 26.1], [False, True, False]),
        ([26.6, 15.5, 26.1, 40.0, 26.4], [False, True, False, True, False]),
        ([10.0, 18.0, 26.0], [True, True, True]),
        ([15.5, 15.6, 26.1, 26.4], [True] * 4),
        ([25.6, 26.6, 27.0], [False] * 3),
    ],
)
def test_the_minority_at_a_point_is_wrong(thickness, gross):
    labels, others = honest_pairs()
    # The point is on another part, which has a point of the name 'A' as well.
    found = gross_outliers(
        Readings.joined(
            {'rest': at_points(labels, others), 'here': at_points('A' * len(gross), thickness)}
        )
    )
    assert found[20:].tolist() == gross
    assert not found[:20].any()


def test_without_enough_repeats_only_what_no_gauge_reads_is_gross():
    assert gross_outliers(at_points('aab', [26.0, 45.0, 20.0])).tolist() == [True, True, False]
    assert not gross_outliers(at_points('aab', [26.0, 32.0, 20.0])).any()
    assert not gross_outliers(at_points('', [])).any()


# --- and are named


def test_what_is_left_out_is_named():
    taken = at_points('abab' + 'b', [15.5, 20.0, 26.25, 4.0, 20.5])
    lines = left_out_lines(taken, np.array([False, True, False, False, True]))
    assert lines == [
        "point 'a': 15.5, 26.25 µm contradict each other; left out of the fit, measure there "
        'again',
        "point 'b': 4 µm beside 20, 20.5; left out of the fit, measure it again",
    ]


def test_a_study_goes_without_slips_and_says_so(sample):
    door = sample.experiments[1]
    # At a point with one reading only, nothing would contradict a slip.
    point = int(np.flatnonzero(door.means.repeats == 3)[0])
    slip, *others = np.flatnonzero(door.means.owner == point)
    thickness = door.readings.thickness_um.copy()
    thickness[slip] -= 11.0
    slipped = Experiment.of(
        'door', door.surface, door.path, replace(door.readings, thickness_um=thickness)
    )
    study, clean = Study.of(Campaign((slipped,))), Study.of(Campaign((door,)))
    beside = ', '.join(f'{value:.4g}' for value in thickness[others])
    assert study.notes == (
        f"door: point '{door.readings.point[slip]}': {thickness[slip]:.4g} µm beside {beside}; "
        'left out of the fit, measure it again',
    )
    assert clean.notes == ()
    kept = study.campaign.experiments[0]
    assert np.flatnonzero(~kept.used).tolist() == [slip]
    assert kept.taken is slipped.readings
    without = Study.of(Campaign((door.without(~kept.used),)))
    assert study.measured_um == pytest.approx(without.measured_um)
    assert study.sigma_um == pytest.approx(without.sigma_um)
    assert study.noise.degrees_of_freedom == clean.noise.degrees_of_freedom - 1
