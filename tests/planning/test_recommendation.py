"""The index that is recommended, and what is said about it."""

import math
import re

import numpy as np
import pytest
from matplotlib.figure import Figure

from inference.fitting.panels import column, passes
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq3_collapse import SampledCollapse
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses
from paint_deposition.part.points import SurfacePoints
from paint_deposition.planning.recommendation import recommend
from paint_deposition.planning.requests import IndexRequest
from paint_deposition.report.plan_pictures import draw_curve
from refusals import refusal
from scenes import painted

SYMMETRIC = DepositionModel(planar=PlanarPattern(K3=0.0))
LOPSIDED = DepositionModel()


def recommended(model=SYMMETRIC, **what):
    return recommend(model, IndexRequest(**({'speed_m_per_s': 0.2} | what)))


def sigma_n(model, index_m, **options):
    return ParallelPasses.one_way(sampled_collapse(model, 0.2, **options)).sigma_n(index_m)


def test_every_local_minimum_is_found_and_the_deepest_recommended():
    answer = recommended()
    assert [round(index_m, 2) for index_m, _ in answer.curve.minima] == [0.27, 0.58]
    for index_m, least in answer.curve.minima:
        assert least == pytest.approx(sigma_n(SYMMETRIC, index_m), rel=1e-9)
        for aside in (-1e-4, 1e-4):
            assert least <= sigma_n(SYMMETRIC, index_m + aside)
    assert answer.sigma_n == min(least for _, least in answer.curve.minima)
    assert answer.index_drift_m is None


def test_with_a_tolerance_the_best_index_of_the_widest_range_is_recommended():
    answer = recommended(tolerance=0.05)
    widths = [high - low for low, high in answer.windows_m]
    low, high = answer.windows_m[int(np.argmax(widths))]
    assert len(widths) == 2
    assert low <= answer.index_m <= high
    assert answer.sigma_n == min(least for m, least in answer.curve.minima if low <= m <= high)
    for low, high in answer.windows_m:
        inside = np.linspace(low, high, 50)[1:-1]
        assert max(sigma_n(SYMMETRIC, index) for index in inside) <= 0.05
        if low > answer.index_range_m[0]:
            assert sigma_n(SYMMETRIC, low - 1e-4) > 0.05
        assert sigma_n(SYMMETRIC, high + 1e-4) > 0.05


@pytest.mark.parametrize(('range_m', 'side'), [((0.2, 0.32), 'left'), ((0.54, 0.66), 'right')])
def test_the_tolerance_is_named_where_the_curve_is_away_from_it(range_m, side):
    axes, (low, high) = Figure().subplots(), range_m
    draw_curve(axes, recommended(tolerance=0.05, index_min_m=low, index_max_m=high))
    (label,) = (text for text in axes.texts if text.get_text() == 'tolerance 5 %')
    assert label.get_ha() == side


def test_drift_limits_are_where_the_tolerance_breaks_and_with_effects_not_known():
    answer = recommended(tolerance=0.05, index_min_m=0.4)
    assert answer.index_drift_m in answer.windows_m
    for change in answer.standoff_drift_m:
        there = sigma_n(SYMMETRIC, answer.index_m, standoff_m=0.25 + change)
        assert there == pytest.approx(0.05, abs=1e-5)
    assert answer.standoff_drift_m[0] < 0.0 < answer.standoff_drift_m[1]
    answer = recommended(SYMMETRIC.with_effect(EFFECTS['overspray_fog']()), tolerance=0.05)
    assert any('overspray_fog' in note for note in answer.notes)
    assert answer.standoff_drift_m is None


def test_passes_cover_the_width_to_its_edges():
    width = 1.5
    answer = recommended(tolerance=0.05, width_m=width, target_um=20.0)
    assert any('target of 20 µm would need' in note for note in answer.notes)
    across_m, one_pass = np.linspace(-0.5, 0.5, 201) * width, answer.curve.parallel.first
    film, fewer = (
        sum(
            one_pass.thickness_um(across_m - (k - 0.5 * (count - 1)) * answer.index_m)
            for k in range(count)
        )
        for count in (answer.passes, answer.passes - 1)
    )
    least = answer.curve.parallel.thickness_um(answer.index_m, np.linspace(0, 1, 201)).min()
    assert film.min() >= 0.949 * least
    assert fewer.min() < 0.95 * least
    strokes = answer.passes * width + (answer.passes - 1) * answer.index_m
    assert answer.cycle_time_s == pytest.approx(strokes / 0.2)
    one_way = recommended(tolerance=0.05, width_m=width, one_way=True)
    assert one_way.sigma_n == answer.sigma_n
    assert one_way.cycle_time_s > answer.cycle_time_s
    assert (one_way.travel, answer.travel) == ('one_way', 'alternating')


@pytest.mark.parametrize('turns', [False, True])
def test_a_simulated_serpentine_is_as_even_as_said(turns):
    answer = recommended(LOPSIDED, tolerance=0.2, gun_turns=turns, speed_m_per_s=0.15)
    height = 1.0 + answer.index_m * np.arange(4.5, -5.0, -1.0)
    motion = passes(height, speed_m_per_s=0.15, turned=turns)
    period = 2.0 * answer.index_m
    points = column(1.0 - 0.5 * period, 1.0 + 0.5 * period, 401)[:-1]
    wall = SurfacePoints(points, np.tile([0.0, 1.0, 0.0], (len(points), 1)))
    film = painted(wall, motion, LOPSIDED, 'double').film_um
    assert film.std() / film.mean() == pytest.approx(answer.sigma_n, rel=2e-3)
    assert film.mean() == pytest.approx(answer.mean_um, rel=1e-3)


def test_gun_that_turns_makes_an_asymmetric_pattern_less_even():
    kept, turned = (recommended(LOPSIDED, tolerance=0.2, gun_turns=k) for k in (False, True))
    assert turned.sigma_n > 1.2 * kept.sigma_n
    assert 'keeps its orientation' in kept.request.assumption
    assert 'turns' in turned.request.assumption
    note = next(line for line in kept.notes if 'turned by 180 deg' in line)
    profile = kept.curve.parallel.first
    other_way = SampledCollapse(-profile.x_m[::-1], profile.film_um[::-1], profile.finest_m)
    mirrored = ParallelPasses(profile, other_way).sigma_n(kept.index_m)
    assert float(note.split()[-2]) == pytest.approx(100 * mirrored, abs=0.01)


@pytest.mark.parametrize('scale', [0.2, 4.0])
def test_default_range_follows_the_width_of_the_pattern(scale):
    planar = PlanarPattern(K3=0.0, r_m=0.22 * scale, sigma1_m=0.09 * scale, sigma2_m=0.15 * scale)
    answer = recommended(DepositionModel(planar=planar))
    assert answer.index_range_m[0] < 0.5 * answer.sb50_m < 1.3 * answer.sb50_m
    assert answer.index_range_m[1] > 1.3 * answer.sb50_m
    assert answer.index_m == pytest.approx(recommended().index_m * scale, rel=1e-3)
    assert recommended().index_range_m == (0.2, 0.8)


@pytest.mark.parametrize(('low', 'high', 'what'), [
    (0.35, 0.45, {}), (0.45, 0.55, {}), (0.29, 0.5, {'tolerance': 0.06}),
])  # fmt: skip
def test_without_a_minimum_the_more_even_end_is_recommended(low, high, what):
    answer = recommended(index_min_m=low, index_max_m=high, **what)
    ends = answer.windows_m[0] if 'tolerance' in what else answer.index_range_m
    assert answer.index_m in ends
    assert answer.sigma_n == pytest.approx(min(sigma_n(SYMMETRIC, end) for end in ends))
    side = 'smaller' if answer.index_m == ends[0] else 'greater'
    told = f'no minimum of sigma_n here; it is more even at a {side}'
    assert any(told in note for note in answer.notes)


def test_the_speed_for_a_target_keeps_its_limits():
    """Film times index times speed is constant: a limit of speed is one of the index."""
    wanted = {'speed_m_per_s': None, 'target_um': 20.0, 'speed_max_m_per_s': 2.0}
    free = recommended(**wanted)
    slowest = 1.05 * free.speed_m_per_s
    held = recommended(**wanted | {'speed_min_m_per_s': slowest})
    assert held.speed_m_per_s >= slowest
    assert held.index_m < free.index_m
    assert held.mean_um == pytest.approx(20.0)
    assert any('other speeds than are allowed' in note for note in held.notes)
    assert not any('other speeds than are allowed' in note for note in free.notes)


@pytest.mark.parametrize(
    ('what', 'words'),
    [
        ({'speed_m_per_s': None}, 'neither speed_m_per_s nor target_um'),
        ({'speed_m_per_s': 200.0}, 'a number 0.005 to 3: speed of the passes'),
        ({'speed_m_per_s': None, 'target_um': 2e4}, 'the closest is'),
        ({'tolerance': 1e-5}, r'the closest is 0\.\d+ %'),
        ({'index_min_m': 0.9}, 'is empty'),
        ({'index_min_m': 2.5, 'index_max_m': 3.0}, 'bare stripes'),
        ({'width_m': math.nan}, 'width_m is nan; expected a number above 0 and up to 100'),
    ],
)
def test_impossible_requests_say_why(what, words):
    line = refusal(PaintError, recommended, **what)
    assert re.search(words, line), line
