"""Figures of a film against what can be worked out by hand."""

import math

import numpy as np
import pytest

from paint_deposition.errors import PaintError
from paint_deposition.film.statistics import film_statistics
from paint_deposition.part.zones import Box, PointZones, Zone, Zones


def test_area_weighs_not_the_number_of_vertices():
    film = np.array([10.0, 10.0, 10.0, 30.0])
    area = np.array([0.1, 0.1, 0.1, 0.3])
    stats = film_statistics(film, area, emitted_cm3=15.0)
    assert stats.mean_um == pytest.approx(20.0, rel=1e-12)
    # 20 um on 0.6 m2 are 12 cm3.
    assert stats.painted_volume_cm3 == pytest.approx(12.0, rel=1e-12)
    assert stats.capture_fraction == pytest.approx(0.8, rel=1e-12)
    assert stats.std_dev_um == pytest.approx(10.0, rel=1e-12)
    assert (stats.min_um, stats.max_um) == (10.0, 30.0)


def test_bare_metal_and_dust_count_for_coverage_and_volume_only():
    film, area = np.array([0.0, 0.5, 20.0]), np.array([0.5, 0.25, 0.25])
    stats = film_statistics(film, area, emitted_cm3=10.0, painted_above_um=1.0)
    assert stats.coverage == pytest.approx(0.25)
    assert stats.mean_um == stats.min_um == stats.max_um == 20.0
    assert stats.painted_volume_cm3 == pytest.approx(0.125 + 5.0)


def test_below_within_and_above_share_the_painted_area():
    film, area = np.array([0.0, 10.0, 20.0, 30.0]), np.array([5.0, 0.2, 0.5, 0.3])
    stats = film_statistics(film, area, 1.0, target_um=20.0, target_tolerance_um=5.0)
    assert (stats.below_target, stats.within_target, stats.above_target) == pytest.approx(
        (0.2, 0.5, 0.3)
    )


def test_a_band_that_reaches_bare_metal_is_refused():
    with pytest.raises(PaintError, match='tolerance_um 20 is not less than target_um 20: bare'):
        film_statistics(np.ones(1), np.ones(1), 1.0, target_um=20.0, target_tolerance_um=20.0)


@pytest.mark.parametrize(('target', 'cpk'), [(20.0, 1.0), (22.0, 4.0 / 6.0), (28.0, -2.0 / 6.0)])
def test_cpk_is_the_way_to_the_nearer_limit_over_three_standard_deviations(target, cpk):
    # Half the area at 18, half at 22 um: mean 20, standard deviation 2.
    stats = film_statistics(
        np.array([18.0, 22.0]), np.ones(2), 1.0, target_um=target, target_tolerance_um=6.0
    )
    assert stats.cpk == pytest.approx(cpk, rel=1e-12)


def test_without_target_or_paint_figures_say_so():
    stats = film_statistics(np.zeros(4), np.full(4, 0.25), emitted_cm3=0.0)
    assert math.isnan(stats.within_target)
    assert math.isnan(stats.capture_fraction)
    assert stats.to_dict()['capture_fraction'] is None
    assert (stats.mean_um, stats.std_dev_um, stats.max_um, stats.coverage) == (0, 0, 0, 0)


def test_zones_share_the_area_and_add_up_to_the_whole():
    """Each vertex counts against its own band, and area with no target not at all."""
    corners, middle = [[-1.0, -1, -1], [1, 1, 1]], [[-1.0, -1, -1], [0, 1, 1]]
    left, right = (
        Zone(name, target, 2.0, (Box(np.array(box)),))
        for name, target, box in (('left', 10.0, middle), ('right', 20.0, corners))
    )
    x = np.array([-0.9, -0.5, -0.1, 0.1, 0.5, 0.9, 2.0])
    positions = np.stack([x, 0 * x, 0 * x], axis=1)
    numbers = Zones((left, right)).of(positions, positions)
    np.testing.assert_array_equal(numbers, [0, 0, 0, 1, 1, 1, -1])
    zones = PointZones(Zones((left, right)), numbers)
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
    everywhere = film_statistics(
        film, area, 1.0, target_um=50.0, target_tolerance_um=1.0, zones=zones
    )
    assert everywhere.within_target == pytest.approx((0.3 + 0.4 + 5.0) / 5.9)
    assert [zone['name'] for zone in everywhere.to_dict()['zones']] == ['left', 'right']
    assert 'zones' not in film_statistics(film, area, 1.0).to_dict()
