"""Passes planned on parts, and their files."""

import re
from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.errors import PaintError
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.planning.placement import lines_of, passes_to_cover, place_passes
from paint_deposition.planning.plan import plan
from paint_deposition.planning.planned_film import evenness
from paint_deposition.planning.requests import PlanRequest
from paint_deposition.report.write_plans import write_passes
from refusals import refusal
from scenes import painted
from surfaces import sheet

pytestmark = pytest.mark.slow

NARROW = pd.DepositionModel(
    planar=PlanarPattern(K1_cm3_per_s=1.0, K3=0.1, r_m=0.1, sigma1_m=0.042, sigma2_m=0.07)
)


@pytest.fixture(scope='module')
def bowed():
    """A surface that falls away toward its top and comes forward at its foot."""
    return sheet(lambda x, z: 0.2 * x**2 + 0.5 * np.maximum(z, 0.0) ** 2 + 0.15 * z, half_m=0.4)


@pytest.fixture(scope='module')
def planned(bowed):
    return plan(bowed, NARROW, PlanRequest(target_um=20.0), 'part')


def test_film_is_what_a_simulation_of_the_motion_gives(bowed, planned):
    film = painted(bowed.points(), planned.trajectory, NARROW).film_um
    np.testing.assert_allclose(planned.film_um, film, rtol=1e-5)
    mean, sigma_n = evenness(film, bowed.vertex_areas_m2)
    assert mean == pytest.approx(20.0, rel=3e-3)
    assert planned.sigma_n == pytest.approx(sigma_n, rel=1e-4)
    assert planned.statistics.coverage == 1.0


@pytest.mark.parametrize(
    ('wanted', 'words'),
    [
        ({'target_um': 20.0}, []),
        ({'target_um': 16.0, 'speed_m_per_s': 0.3}, ['mean film will be 20.0 µm, not the target']),
        ({'target_um': 20.0, 'speed_max_m_per_s': 0.11}, ['to 0.11 m/s are allowed']),
        ({'target_um': 25.0}, ['mean film will be 20.0 µm, not the target of 25 µm']),
        ({'target_um': 25.0, 'optimise': True}, [r'allow other speeds (--speed-min']),
    ],
)
def test_what_was_asked_for_and_is_not_reached_is_warned_of(planned, wanted, words):
    warnings = list(replace(planned, request=PlanRequest(**wanted)).warnings)
    assert all(word in line for word, line in zip(words, warnings, strict=True))


def test_placing_beats_the_plane_s_recommendation_and_neighbouring_indices(planned):
    assert planned.sigma_n == pytest.approx(planned.placement.sigma_n, rel=0.1)
    films, index = planned.line_films, planned.placement.index_m
    across, plane = films.surface_map.extent_m[1], planned.plane
    count = passes_to_cover(plane.curve.parallel, plane.index_m, np.ptp(across))
    of_plane = films.sigma_n(lines_of(count, plane.index_m, np.mean(across)))
    assert planned.sigma_n < 0.97 * of_plane
    for beside in (0.97 * index, 1.03 * index):
        other = place_passes(films, (beside, beside))
        assert other.index_m == pytest.approx(beside)
        np.testing.assert_allclose(np.diff(other.lines_m('horizontal')), beside, atol=1e-9)
        assert other.sigma_n > 0.97 * planned.placement.sigma_n
    assert 0.22 <= place_passes(films, (0.22, 0.3)).index_m <= 0.3
    assert place_passes(films, (5.0, 5.0)).index_m == 5.0


def test_on_a_wide_plane_the_plan_is_as_even_as_the_recommendation():
    surface = sheet(lambda x, z: 0.0 * x, half_m=0.6)
    flat = plan(surface, NARROW, PlanRequest(speed_m_per_s=0.2, overspray_m=0.5))
    assert flat.sigma_n < flat.plane.sigma_n + 0.015
    mean_um = NARROW.planar.K1_cm3_per_s / (0.2 * flat.placement.index_m)
    assert flat.statistics.mean_um == pytest.approx(mean_um, rel=0.03)


def test_passes_begin_at_the_top_to_the_right_as_the_gun_sees_it_or_run_downward(bowed, planned):
    first, last = (planned.passes[k].positions_m for k in (0, -1))
    assert first[:, 2].mean() > last[:, 2].mean() + 0.3
    assert first[-1, 0] > first[0, 0] + 0.5
    vertical = plan(bowed, NARROW, PlanRequest(direction='vertical', speed_m_per_s=0.3))
    first, last = (vertical.passes[k].positions_m for k in (0, -1))
    assert first[-1, 2] < first[0, 2] - 0.5
    assert last[:, 0].mean() > first[:, 0].mean() + 0.3


@pytest.mark.parametrize(
    ('what', 'words'),
    [
        ({'tolerance': 0.05, 'index_m': 0.3}, 'on this part within 5 %; the closest is'),
        (
            {'tolerance': 0.1, 'index_m': 0.2, 'optimise': True},
            r'within 10 %; the closest is .* at 0\.200 m',
        ),
        ({'index_m': 0.2, 'index_min_m': 0.25}, 'index_m is 0.2, beyond index_min_m, 0.25'),
        ({'target_um': 2e4, 'speed_m_per_s': None}, 'give another target or index'),
        ({'overspray_m': -0.1}, 'overspray_m is -0.1'),
        ({'direction': 'up'}, "'horizontal' or 'vertical'"),
    ],
)
def test_impossible_plans_say_why(bowed, what, words):
    line = refusal(PaintError, pd.plan, bowed, NARROW, **({'speed_m_per_s': 0.3} | what))
    assert re.search(words, line), line


def test_the_tolerance_is_that_of_the_film_with_all_effects(bowed):
    asked = {'speed_m_per_s': 0.3, 'index_m': 0.3}
    allowed = pd.plan(bowed, NARROW, **asked).sigma_n + 0.01
    rimmed = NARROW.with_effect(EFFECTS['edge_build'](gain=0.5))
    with pytest.raises(PaintError, match=r'lay a film of sigma_n .* %, not within'):
        pd.plan(bowed, rimmed, tolerance=allowed, **asked)


def test_writing_again_replaces_the_plan_but_no_stranger(planned, tmp_path):
    write_passes(tmp_path, planned)
    write_passes(tmp_path, planned)
    (tmp_path / 'trajectory' / 'notes.txt').write_text('mine')
    with pytest.raises(Exception, match='no planned bag; move it away'):
        write_passes(tmp_path, planned)
    assert (tmp_path / 'trajectory' / 'notes.txt').read_text() == 'mine'
