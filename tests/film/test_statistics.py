"""Figures of a film and of its paint against what can be worked out by hand."""

import math

import numpy as np
import pytest

import scenes
from brushes import NARROW, WIDE, switched
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.film import statistics
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.statistics import PaintUsed, efficiency, film_statistics
from paint_deposition.model.eq1_pattern import Brush
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.zones import Zone, Zones
from scenes import lying_plane, stamps_ns, straight_pass


def test_area_weighs_and_is_shared_by_below_within_and_above():
    film = np.array([10.0, 10.0, 10.0, 30.0])
    area = np.array([0.1, 0.1, 0.1, 0.3])
    stats = film_statistics(film, area, emitted_cm3=15.0)
    assert stats.mean_um == pytest.approx(20.0, rel=1e-12)
    # 20 um on 0.6 m2 are 12 cm3.
    assert stats.painted_volume_cm3 == pytest.approx(12.0, rel=1e-12)
    assert stats.capture_fraction == pytest.approx(0.8, rel=1e-12)
    assert stats.std_dev_um == pytest.approx(10.0, rel=1e-12)
    assert (stats.min_um, stats.max_um) == (10.0, 30.0)
    film, area = np.array([0.0, 10.0, 20.0, 30.0]), np.array([5.0, 0.2, 0.5, 0.3])
    stats = film_statistics(film, area, 1.0, target_um=20.0, target_tolerance_um=5.0)
    shares = stats.below_target, stats.within_target, stats.above_target
    assert shares == pytest.approx((0.2, 0.5, 0.3))
    with pytest.raises(PaintError, match='tolerance_um 20 is not less than target_um 20: bare'):
        film_statistics(np.ones(1), np.ones(1), 1.0, target_um=20.0, target_tolerance_um=20.0)


def test_bare_metal_counts_for_coverage_and_volume_only_and_figures_say_what_is_not_known():
    film, area = np.array([0.0, 0.5, 20.0]), np.array([0.5, 0.25, 0.25])
    stats = film_statistics(film, area, emitted_cm3=10.0, painted_above_um=1.0)
    assert stats.coverage == pytest.approx(0.25)
    assert stats.mean_um == stats.min_um == stats.max_um == 20.0
    assert stats.painted_volume_cm3 == pytest.approx(0.125 + 5.0)
    stats = film_statistics(np.zeros(4), np.full(4, 0.25), emitted_cm3=0.0)
    assert math.isnan(stats.within_target)
    assert math.isnan(stats.capture_fraction)
    assert stats.to_dict()['capture_fraction'] is None
    assert (stats.mean_um, stats.std_dev_um, stats.max_um, stats.coverage) == (0, 0, 0, 0)


def test_cpk_is_the_way_to_the_nearer_limit_over_three_standard_deviations():
    """Half the area at 18, half at 22 um: mean 20, standard deviation 2."""
    half = np.array([18.0, 22.0]), np.ones(2), 1.0
    for target, cpk in ((20.0, 1.0), (22.0, 4.0 / 6.0), (28.0, -2.0 / 6.0)):
        stats = film_statistics(*half, target_um=target, target_tolerance_um=6.0)
        assert stats.cpk == pytest.approx(cpk, rel=1e-12)


def test_zones_share_the_area_and_add_up_to_the_whole():
    """Each vertex counts against its own band, and area with no target not at all."""
    corners, middle = [[-1.0, -1, -1], [1, 1, 1]], [[-1.0, -1, -1], [0, 1, 1]]
    left, right = (
        Zone(name, target, 2.0, np.array(box))
        for name, target, box in (('left', 10.0, middle), ('right', 20.0, corners))
    )
    x = np.array([-0.9, -0.5, -0.1, 0.1, 0.5, 0.9, 2.0])
    positions = np.stack([x, 0 * x, 0 * x], axis=1)
    zones = Zones((left, right)).at(positions, positions)
    np.testing.assert_array_equal(zones.number, [0, 0, 0, 1, 1, 1, -1])
    film = np.array([9.0, 12.5, 0.0, 20.0, 21.0, 30.0, 50.0])
    area = np.array([0.3, 0.1, 1.0, 0.2, 0.2, 0.1, 5.0])
    stats = film_statistics(film, area, 1.0, zones=zones)
    a, b = stats.zones.values()
    assert (a.within_target, b.within_target) == pytest.approx((0.75, 0.8))
    assert stats.within_target == pytest.approx((0.4 * 0.75 + 0.5 * 0.8) / 0.9)
    assert stats.below_target + stats.within_target + stats.above_target == pytest.approx(1.0)
    assert a.painted_volume_cm3 + b.painted_volume_cm3 == pytest.approx(film[:6] @ area[:6])
    assert (a.coverage, math.isnan(stats.cpk), math.isnan(b.cpk)) == (0.4 / 1.4, True, False)
    # With a target elsewhere, that area counts, too.
    target = {'target_um': 50.0, 'target_tolerance_um': 1.0}
    everywhere = film_statistics(film, area, 1.0, **target, zones=zones)
    assert everywhere.within_target == pytest.approx((0.3 + 0.4 + 5.0) / 5.9)
    assert [zone['name'] for zone in everywhere.to_dict()['zones']] == ['left', 'right']
    assert 'zones' not in film_statistics(film, area, 1.0).to_dict()


ONE = Brush(number=1, planar=NARROW, flow_cm3_per_min=180.0, solids=0.5, density_g_per_cm3=1.2)
TWO = Brush(number=2, planar=WIDE, flow_cm3_per_min=360.0, solids=0.5, density_g_per_cm3=1.1)
# One second of brush 1 at flow 0.5, two of brush 2.
MOTION = straight_pass(
    np.arange(0.0, 4.0, 0.02), (-0.2, 0.0, 0.25), (0.2, 0.0, 0.25),
    **switched(stamps_ns([0.5, 1.5, 3.5]), (0.5, 1), (1.0, 2), (0.0, 0)),
)  # fmt: skip


def painted(*brushes: Brush) -> tuple[FilmIntegrator, float, float]:
    """Integrator, mean film, solids on the plane."""
    points = lying_plane(1.5, 101)
    film = scenes.painted(points, MOTION, DepositionModel(brushes=brushes), 'double')
    return film, float(film.film_um.mean()), float(points.area_m2 @ film.film_um)


def test_paint_is_flow_times_time_and_density():
    film, mean_um, on_part_cm3 = painted(ONE, TWO)
    used = film.used
    assert used.spraying_s == pytest.approx({1: 0.5, 2: 2.0})
    assert used.wet_cm3 == pytest.approx(3.0 * 0.5 + 6.0 * 2.0)
    assert used.mass_g == pytest.approx(1.2 * 3.0 * 0.5 + 1.1 * 6.0 * 2.0)
    assert used.solids_cm3 == pytest.approx(0.5 * used.wet_cm3)
    # All of it lands on so large a plane: what K1 says, over what was sprayed.
    laid = NARROW.K1_cm3_per_s * 0.5 + WIDE.K1_cm3_per_s * 2.0
    figures = used.figures(mean_um, on_part_cm3)
    assert figures['transfer_efficiency'] == pytest.approx(laid / (0.5 * 13.5), rel=1e-4)
    # Solids and solvent: the wet film holds the dry one.
    assert figures['mean_wet_film_um'] == pytest.approx(2.0 * mean_um)
    assert figures['spraying_time_s_by_brush'] == pytest.approx({'1': 0.5, '2': 2.0})


def test_a_brush_that_says_less_leaves_only_that_unknown():
    without = TWO.model_copy(update={'density_g_per_cm3': None})
    figures = painted(ONE, without)[0].used.figures(10.0, 1.0)
    assert figures['mass_g'] is None
    assert figures['wet_cm3'] == pytest.approx(13.5)
    unknown = painted(ONE, Brush(number=2, planar=WIDE))[0].used.figures(10.0, 1.0)
    assert unknown['wet_cm3'] is unknown['transfer_efficiency'] is None
    # A brush that does not spray need not say anything.
    third = Brush(number=3, planar=WIDE)
    assert painted(ONE, TWO, third)[0].used.wet_cm3 == pytest.approx(13.5)


def test_amounts_add_up_however_the_path_was_cut():
    path, model = spray_path(MOTION)[0], DepositionModel(brushes=[ONE, TWO])
    whole = PaintUsed.of(model, path)
    parts = [PaintUsed.of(model, path.select(slice(k, k + 37))) for k in range(0, len(path), 37)]
    total = sum(parts, PaintUsed())
    assert vars(total) | {'spraying_s': 0} == pytest.approx(vars(whole) | {'spraying_s': 0})
    assert total.spraying_s == pytest.approx(whole.spraying_s)


def test_more_solids_than_are_sprayed_are_told():
    """K1 is 1.3 cm3/s; 120 cm3/min at half solids are 1."""
    thin = ONE.model_copy(update={'flow_cm3_per_min': 120.0})
    assert efficiency(thin) == pytest.approx(1.3)
    (line,) = statistics.impossible_brushes(DepositionModel(brushes=[thin, TWO]))
    assert line.startswith('brush 1 would lay 1.30 times the solids that it sprays')
    silent = Brush(number=2, planar=WIDE)
    assert math.isnan(efficiency(silent))
    assert statistics.impossible_brushes(DepositionModel(brushes=[silent])) == ()
