"""Repeats and the noise they show."""

import numpy as np
import pytest

from paint_deposition.errors import ReadingsError
from paint_deposition.inference.readings.gauge_noise import (
    ASSUMED_FREEDOM,
    ENOUGH_REPEATS,
    gauge_noise,
)
from paint_deposition.inference.readings.readings import (
    PointMeans,
    Readings,
    require_repeats_close,
)


def at_points(points: str, thickness_um, sigma_um=None) -> Readings:
    """Readings at points of one letter each."""
    count = len(thickness_um)
    stated = {} if sigma_um is None else {'sigma_um': np.array(sigma_um, dtype=float)}
    return Readings.of(np.zeros((count, 3)), thickness_um, point=np.array(list(points)), **stated)


def test_repeats_are_averaged_in_order_of_first_appearance():
    means = PointMeans.of(at_points('bacabb', [10.0, 20.0, 30.0, 22.0, 13.0, 16.0]))
    assert means.first.tolist() == [0, 1, 2]
    assert means.repeats.tolist() == [3, 2, 1]
    assert means.mean_um.tolist() == [13.0, 21.0, 30.0]
    assert means.owner.tolist() == [0, 1, 2, 1, 0, 0]


def test_readings_without_labels_are_points_of_their_own():
    assert len(PointMeans.of(Readings.of(np.zeros((3, 3)), [1.0, 2.0, 3.0])).first) == 3


def test_no_readings_are_no_points():
    assert len(PointMeans.of(at_points('', [])).mean_um) == 0


def test_one_label_at_two_places_is_refused():
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.02], [0.0, 0.0, 0.05]])
    labels = np.array(['A', 'A', 'A'])
    require_repeats_close(Readings.of(places[:2], [1.0, 2.0], point=labels[:2]))
    with pytest.raises(ReadingsError, match=r"point 'A' is used 0\.050 m apart"):
        require_repeats_close(Readings.of(places, [1.0, 2.0, 3.0], point=labels))


def test_noise_is_pooled_within_points():
    """At zero film the usual gauge's noise is its floor, so pooling is the textbook formula."""
    values = np.array([-1.0, 0.3, 0.7, 1.2, -1.2, 0.5, 0.1, -0.6, 0.0])
    labels = 'aaabbbccc'
    noise = gauge_noise(at_points(labels, values))
    squares = sum(np.var(values[k : k + 3], ddof=1) * 2 for k in (0, 3, 6))
    assert noise.source == 'repeats'
    assert noise.degrees_of_freedom == 6
    assert noise.sigma_um == pytest.approx(np.sqrt(squares / 6), rel=1e-3)


def test_noise_keeps_the_shape_of_a_usual_gauge():
    random = np.random.default_rng(1)
    film = np.repeat(random.uniform(0.0, 200.0, 400), 2)
    sigma = 1.5 * np.hypot(0.7, 0.01 * film)
    labels = np.repeat(np.arange(400).astype(str), 2)
    readings = Readings.of(
        np.zeros((800, 3)), film + sigma * random.normal(size=800), point=labels
    )
    noise = gauge_noise(readings)
    assert noise.degrees_of_freedom == 400
    # The standard error of a pooled deviation is 1 / sqrt(2 x 400) = 3.5 %.
    assert noise.sigma_um / sigma == pytest.approx(np.ones(800), abs=0.1)


def test_one_label_on_two_parts_is_two_points_of_one_gauge():
    first, second = at_points('aab', [1.0, 2.0, 9.0]), at_points('aabbbb', [7.0, 8.0, 1, 2, 3, 4])
    parts = {'first': first, 'second': second}
    noise = gauge_noise(Readings.joined(parts))  # 1 + 1 + 3 degrees of freedom are too few
    assert noise.source == 'assumed'
    parts['third'] = at_points('aa', [5.0, 6.0])
    assert gauge_noise(Readings.joined(parts)).degrees_of_freedom == ENOUGH_REPEATS


@pytest.mark.parametrize('thickness', [[20.0, 30.0], [20.0] * 9])
def test_without_scatter_to_go_by_the_usual_noise_is_assumed(thickness):
    labels = 'ab' if len(thickness) == 2 else 'a' * 9
    noise = gauge_noise(at_points(labels, thickness))
    assert noise.source == 'assumed'
    assert noise.degrees_of_freedom == ASSUMED_FREEDOM
    assert noise.sigma_um == pytest.approx(np.hypot(0.7, 0.01 * np.array(thickness)))


def test_stated_noise_wins():
    noise = gauge_noise(at_points('aaaaaaaa', np.arange(8.0), [0.5] * 8))
    assert (noise.source, noise.degrees_of_freedom) == ('stated', np.inf)
    assert noise.typical_um == 0.5


def test_repeats_of_stated_readings_say_nothing_of_the_others():
    """A precise instrument for some points must not make the gauge look precise."""
    values = [5.0, 5.001, 4.999] * 3 + [0.0, 2.0, -2.0, 1.0, -1.0, 2.0, -2.0]
    stated = [0.001] * 9 + [np.nan] * 7
    noise = gauge_noise(at_points('aaaaaaaaabbbbbbb', values, stated))
    assert noise.source == 'repeats'
    assert noise.degrees_of_freedom == 6
    assert noise.sigma_um[:9] == pytest.approx(0.001)
    assert noise.sigma_um[-1] == pytest.approx(np.std(values[9:], ddof=1), rel=0.01)
