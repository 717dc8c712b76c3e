"""Every hidden effect changes the film the way its physics says."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from .bench import Bench
from .doors import Part
from .draw import draw_jobs
from .gauge import scatter
from .jobs import Job, Plan, drive
from .parcels import Pattern
from .programme import Painted, motion_of
from .truths import DOWN, library

pytestmark = pytest.mark.slow

FLAT = Part('door', 1.0, 1.0)
ROUND = Pattern(1.5, K2=0.2, K3=0.0, phi_rad=0.0, r_m=0.09, sigma1_m=0.04, sigma2_m=0.06)
COLUMN = np.zeros(61), np.linspace(0.02, 0.98, 61)
ROW = np.linspace(-0.48, 0.48, 97), np.full(97, 0.5)


def change(truth_id, points, amplitude, part=FLAT, drawn=None, **plan):
    """(clean, with the effect) readings of a job with one horizontal pass in mid-height."""
    usual = {'passes': 1, 'standoff_m': 0.25, 'follow': 0.0, 'teach_error_m': 0.0,
             'overrun_m': 0.3, 'gun_margin_m': 0.25}  # fmt: skip
    plan = Plan(**(usual | plan))
    known = library()[truth_id]
    truth = known(amplitude, {**known.details(np.random.default_rng(0)), **(drawn or {})})
    motion = drive(part, plan, np.random.default_rng(0))
    bench = Bench(1, Job('door', truth.on_part(part), plan, motion), ROUND, 600_000)
    return bench.readings([], *points)[1], bench.readings([truth], *points)[1]


def relative(clean, film):
    """Change where there is paint to change, 0 elsewhere."""
    painted = clean > 1.0
    return np.where(painted, film / np.where(painted, clean, 1.0) - 1.0, 0.0)


def centre(film, along):
    return np.sum(film * along) / np.sum(film)


def width(film, along):
    return np.sqrt(np.sum(film * (along - centre(film, along)) ** 2) / np.sum(film))


@pytest.mark.parametrize(
    ('truth_id', 'drawn', 'shift_m'),
    [
        ('air_drift', {'direction': DOWN}, -0.020),
        ('tcp_offset', {'direction_rad': np.pi / 2}, 0.020),
        ('tcp_tilt', {'axis_rad': 0.0}, -0.25 * 0.020),
        ('part_misalignment', {'direction': DOWN, 'turn_rad': np.zeros(3)}, 0.020),
    ],
)
def test_lateral_effects_shift_the_pass(truth_id, drawn, shift_m):
    """Tool y points up here; a tilt turns the axis about the bell, 0.25 m from the panel."""
    clean, film = change(truth_id, COLUMN, 0.020, drawn=drawn)
    moved = centre(film, COLUMN[1]) - centre(clean, COLUMN[1])
    assert moved == pytest.approx(shift_m, abs=0.0006)
    assert film.sum() == pytest.approx(clean.sum(), rel=0.01)


@pytest.mark.parametrize(('truth_id', 'sign'), [('pose_lag', 1), ('gun_wake', -1)])
def test_time_effects_shift_a_stroke_along_its_travel(truth_id, sign):
    clean, film = change(truth_id, ROW, 0.05, gun_margin_m=-0.35, speed_m_per_s=0.2)
    assert centre(film, ROW[0]) - centre(clean, ROW[0]) == pytest.approx(sign * 0.01, abs=0.001)


def test_trigger_lag_starts_late_and_ends_late():
    clean, film = change('trigger_lag', ROW, 0.15, drawn={'fall_ratio': 0.6}, gun_margin_m=-0.3)
    start, end = (film - clean)[:48].sum(), (film - clean)[49:].sum()
    assert start < 0 < end
    assert start + end == pytest.approx(-0.2 * 0.15 * 0.4 * clean[48] / 0.01, rel=0.1)


def test_corner_slowdown_adds_paint_near_the_reversals_only():
    clean, film = change(
        'corner_slowdown', ROW, 0.5, passes=2, index_m=0.02, overrun_m=0.1, drawn={'reach_m': 0.25}
    )
    assert film[-1] > 1.05 * clean[-1]
    assert film[48] == pytest.approx(clean[48], rel=0.002)


@pytest.mark.parametrize(('standoff', 'sign'), [(0.30, -1), (0.20, 1)])
def test_distance_costs_paint_and_shaping_air_holds_the_plume_together(standoff, sign):
    clean, film = change('standoff_efficiency', COLUMN, 0.5, standoff_m=standoff)
    assert film.sum() / clean.sum() == pytest.approx(np.exp(sign * 0.5 * 0.05 / 0.3), rel=0.03)
    clean, film = change('pattern_spread', COLUMN, 0.4, standoff_m=standoff)
    assert sign * (width(film, COLUMN[1]) / width(clean, COLUMN[1]) - 1.0) > 0.04
    assert film.sum() == pytest.approx(clean.sum(), rel=0.01)


@pytest.mark.parametrize(
    ('kind', 'x', 'z', 'passes', 'index_m'),
    [
        ('ledge', (0.0, 0.0), (0.02, 0.4), 4, 0.36),
        ('trim', (0.0, 0.0), (0.30, 0.48), 2, 0.30),
        ('bar', (-0.2, 0.2), (0.4, 0.4), 3, 0.30),
    ],
)
def test_obstacles_only_take_paint(kind, x, z, passes, index_m):
    points = np.linspace(*x, 20), np.linspace(*z, 20)
    more = {'drawn': {'kind': kind, 'at': 0.5}, 'passes': passes, 'index_m': index_m}
    gain = relative(*change('occlusion', points, 0.09, **more))
    assert gain.max() <= 1e-9
    assert -1.0 < gain.min() < -0.1
    assert np.median(gain) > gain.min() / 2


@pytest.mark.parametrize('name', sorted(n for n in library() if n.startswith('footprint:')))
def test_other_bells_keep_the_solids_and_change_the_shape(name):
    clean, film = change(name, COLUMN, 0.5, drawn={'angle_rad': 0.3})
    assert film.sum() == pytest.approx(clean.sum(), rel=0.02)
    assert np.sqrt(np.mean((film - clean) ** 2)) > 0.02 * clean.max()


def test_a_given_programme_lays_the_film_of_the_shops_own():
    """The shop's own motion as one would get it from a bag."""
    pattern, (job,) = draw_jobs(5, [], ('door',), 0.05, 'outside')
    spots, motion = scatter(job.part, 40, np.random.default_rng(1), 0.02), job.motion
    given = motion_of(
        motion.time_s, motion.tcp_m, Rotation.from_matrix(motion.turn).as_quat(),
        motion.trigger_s, motion.trigger_on,
    )  # fmt: skip
    expected = Bench(9, job, pattern, 300_000).readings([], *spots)[0]
    painted = Painted('door', job.part, pattern, [], given, 9, 300_000)
    np.testing.assert_allclose(painted.film_um(*spots), expected, rtol=1e-9)
