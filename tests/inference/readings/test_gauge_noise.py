"""Repeats: the noise they show, and outliers among them; where readings lie, and may lie."""

import numpy as np
import pytest

import paint_deposition as pd
from booth import panel, path_of, serpentine
from paint_deposition.errors import ReadingsError
from paint_deposition.inference.readings import gauge_noise as repeats
from paint_deposition.inference.readings import places as on_part
from paint_deposition.inference.readings import readings as taken
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.inference.readings.gauge_noise import gauge_noise, gross_outliers
from paint_deposition.inference.readings.readings import Residuals
from paint_deposition.motion.path import SprayPath
from surfaces import refined


def usual_noise_um(film_um: np.ndarray) -> np.ndarray:
    return np.hypot(0.7, 0.01 * film_um)


def at_points(points: str, thickness_um, sigma_um=np.nan) -> pd.Readings:
    """Readings at points of one letter each."""
    places, sigma_um = np.zeros((len(points), 3)), np.broadcast_to(sigma_um, len(points))
    point = np.array(list(points))
    return pd.Readings.of(places, thickness_um, point=point, sigma_um=sigma_um.astype(float))


def honest_pairs(count: int = 10, sigma_um: float = 0.7) -> tuple[str, list[float]]:
    """Pairs at points A, B, ... of 26 um, whose scatter has this standard deviation."""
    offset = sigma_um * np.abs(np.random.default_rng(5).normal(size=count)) / np.sqrt(2.0)
    thickness = np.column_stack([26.0 - offset, 26.0 + offset]).ravel()
    return ''.join(2 * chr(ord('A') + k) for k in range(count)), thickness.tolist()


@pytest.mark.parametrize('counts', [[2] * 20, [1] * 30 + [2] * 10 + [3] * 5 + [5] * 2])
def test_normal_readings_stay_and_their_noise_is_unbiased(counts):
    """100 campaigns with 20 degrees of freedom or more know a standard deviation to 1.6 %."""
    random, owner = np.random.default_rng(3), np.repeat(np.arange(len(counts)), counts)
    film, places = np.linspace(20.0, 60.0, len(counts))[owner], np.zeros((len(owner), 3))
    squares, dropped = [], []
    for _ in range(100):
        thickness = film + usual_noise_um(film) * random.normal(size=len(owner))
        noise = gauge_noise(pd.Readings.of(places, thickness, point=owner.astype(str)))
        squares.append(np.mean((noise.sigma_um / usual_noise_um(film)) ** 2))
        dropped.append(noise.gross.mean())
    assert np.sqrt(np.mean(squares)) == pytest.approx(1.0, abs=0.05)
    assert np.mean(dropped) < 2e-3


def test_one_slip_does_not_raise_the_noise_and_what_is_left_out_is_named():
    labels, thickness = honest_pairs()
    readings = at_points(labels + 'xxx', [*thickness, 15.5, 26.6, 26.1])
    noise = gauge_noise(readings)
    assert np.flatnonzero(noise.gross).tolist() == [20]
    honest = gauge_noise(readings.select(~noise.gross))
    assert noise.sigma_um[:20] == pytest.approx(honest.sigma_um[:20])
    assert noise.degrees_of_freedom == honest.degrees_of_freedom == 11
    read = at_points('abab' + 'b', [15.5, 20.0, 26.25, 4.0, 20.5])
    assert repeats.left_out_lines(read, np.array([False, True, False, False, True])) == [
        "point 'a': 15.5, 26.25 µm contradict each other; left out of the fit, measure there "
        'again',
        "point 'b': 4 µm beside 20, 20.5; left out of the fit, measure it again",
    ]


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
    # Nine pairs in ten without any scatter are no reason to doubt the tenth.
    assert not gross_outliers(at_points(labels, [26.0] * 19 + [27.0])).any()
    # The point is on another part, which has a point of the name 'A' as well.
    here = at_points('A' * len(gross), thickness)
    both = pd.Readings.joined({'rest': at_points(labels, others), 'here': here})
    found = gross_outliers(both)
    assert found[20:].tolist() == gross
    assert not found[:20].any()


def test_without_repeats_only_what_no_gauge_reads_is_gross_and_usual_noise_is_assumed():
    for thickness, gross in (([26.0, 45.0, 20.0], [True, True, False]),
                             ([26.0, 32.0, 20.0], [False] * 3), ([], [])):  # fmt: skip
        found = gross_outliers(at_points('aab'[: len(gross)], thickness))
        assert found.tolist() == gross
    for labels, thickness in (('ab', [20.0, 30.0]), ('a' * 9, [20.0] * 9)):
        noise = gauge_noise(at_points(labels, thickness))
        assert (noise.source, noise.degrees_of_freedom) == ('assumed', repeats.ASSUMED_FREEDOM)
        assert noise.sigma_um == pytest.approx(usual_noise_um(np.array(thickness)))


def test_repeats_are_averaged_in_order_and_one_label_at_two_places_is_refused():
    read = at_points('bacabb', [10.0, 20.0, 30.0, 22.0, 13.0, 16.0])
    assert read.first.tolist() == [0, 1, 2]
    assert read.repeats.tolist() == [3, 2, 1]
    assert read.mean_um.tolist() == [13.0, 21.0, 30.0]
    assert read.owner.tolist() == [0, 1, 2, 1, 0, 0]
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.02], [0.0, 0.0, 0.05]])
    labels = np.array(['A', 'A', 'A'])
    taken.require_repeats_close(pd.Readings.of(places[:2], [1.0, 2.0], point=labels[:2]))
    with pytest.raises(ReadingsError, match=r"point 'A' is used 0\.050 m apart"):
        taken.require_repeats_close(pd.Readings.of(places, [1.0, 2.0, 3.0], point=labels))


def test_noise_is_pooled_within_points_beside_those_whose_noise_is_stated():
    """At zero film it is the textbook formula; a precise instrument does not make the gauge so."""
    values = np.array([-1.0, 0.3, 0.7, 1.2, -1.2, 0.5, 0.1, -0.6, 0.0])
    noise = gauge_noise(at_points('aaabbbccc', values))
    squares = sum(np.var(values[k : k + 3], ddof=1) * 2 for k in (0, 3, 6))
    assert (noise.source, noise.degrees_of_freedom) == ('repeats', 6)
    assert noise.sigma_um == pytest.approx(np.sqrt(squares / 6), rel=1e-3)
    values = [5.0, 5.001, 4.999] * 3 + [0.0, 2.0, -2.0, 1.0, -1.0, 2.0, -2.0]
    stated = [0.001] * 9 + [np.nan] * 7
    noise = gauge_noise(at_points('aaaaaaaaabbbbbbb', values, stated))
    assert (noise.source, noise.degrees_of_freedom) == ('repeats', 6)
    assert noise.sigma_um[:9] == pytest.approx(0.001)
    assert noise.sigma_um[-1] == pytest.approx(np.std(values[9:], ddof=1), rel=0.01)


def test_figures_of_residuals_by_hand():
    predicted_um, measured_um = np.array([0.0, 10.0, 20.0]), np.array([4.0, 12.0, 17.0])
    found = Residuals(measured_um, predicted_um, np.full(3, 2.0))
    assert found.bias_um == pytest.approx(1.0)
    assert found.rmse_um == pytest.approx(np.sqrt((16 + 4 + 9) / 3))
    assert found.select(found.painted).rmse_um == pytest.approx(np.sqrt((4 + 9) / 2))
    assert found.chi_square_per_reading == pytest.approx(29 / 3 / 4)
    assert found.worst == 0


# On the booth's panel, one metre by one about the origin in x-z.
PLACES_M = np.array([[-0.4, 0.0, -0.3], [0.1, 0.0, 0.2], [0.3, 0.0, 0.45], [-0.2, 0.0, 0.1]])


def placed(positions_m: np.ndarray) -> Experiment:
    readings = pd.Readings.of(positions_m, np.full(len(positions_m), 20.0))
    return Experiment.of('panel', panel(), SprayPath.empty(), readings)


@pytest.mark.parametrize(
    ('positions_m', 'words'),
    [
        (1000.0 * PLACES_M, 'they fit in millimetres'),
        (0.001 * PLACES_M, r'all points lie on one spot: .* they fit in metres'),
        (PLACES_M / 0.0254, 'they fit in inches'),
        (np.add(PLACES_M, [2.0, 0.5, 0.0]), 'they look like positions in another frame'),
        (np.vstack([PLACES_M, [[0.0, 0.3, 0.0]]]), 'most points lie on the part'),
        (PLACES_M * 3.0, 'give positions in the mesh frame, in metres, or name their unit'),
    ],
)
def test_the_cause_is_named_with_both_boxes(positions_m, words):
    with pytest.raises(ReadingsError, match=words) as refused:
        placed(positions_m)
    assert 'the readings span' in str(refused.value)
    box = 'and the part x -0.500 to 0.500, y 0.000 to 0.000, z -0.500 to 0.500 m'
    assert box in str(refused.value)
    # Three repeats beside each other on a large part are readings, not a mistake.
    assert len(placed(PLACES_M[0] + 0.001 * PLACES_M[:3])) == 3


@pytest.mark.parametrize(
    ('factor', 'guessed', 'words'),
    [(0.1, True, 'in cm, too: say unit: {position: cm}, or mm'),
     (1 / 25.4, True, 'in cm and in inch, too: say unit: {position: inch}, or mm'),
     (0.1, False, ''), (1.0, True, '')],
)  # fmt: skip
def test_a_guessed_unit_is_doubted_where_another_fits(factor, guessed, words):
    readings = pd.Readings.of(factor * PLACES_M, np.full(4, 20.0), unit_is_guessed=guessed)
    doubt = on_part.unit_in_doubt(panel(), readings)
    assert words in doubt
    assert bool(doubt) == bool(words)


def test_how_far_points_were_moved_is_measured_along_the_normal():
    off = placed(PLACES_M + np.outer([-0.001, 0.002, 0.003, 0.0], [0.0, 1.0, 0.0]))
    assert off.off_surface_m == pytest.approx([0.001, 0.002, 0.003, 0.0], abs=1e-9)
    assert off.understood.endswith('by 1.5 mm (median), 3.0 mm at most')


def grid(columns_m, rows_m, stray_m=0.0) -> np.ndarray:
    """(N, 3) places on the booth's panel, columns one after the other."""
    x, z = (values.ravel() for values in np.meshgrid(columns_m, rows_m, indexing='ij'))
    stray = np.random.default_rng(3).uniform(-stray_m, stray_m, (2, len(x)))
    return np.stack([x + stray[0], np.zeros(len(x)), z + stray[1]], axis=1)


X, Z = np.linspace(-0.4, 0.4, 9), np.linspace(-0.4, 0.4, 8)


@pytest.mark.parametrize(
    ('places', 'lines'),
    [
        *((grid([-0.3, 0.0, 0.2], Z[:5], stray_m), [(f'column {k}', 5) for k in (1, 2, 3)])
          for stray_m in (0.0, 0.01)),
        # Rows serve where there are no columns.
        (np.concatenate([grid(X, [0.2]), grid(X + 0.043, [-0.1])]), [('row 1', 9), ('row 2', 9)]),
        (grid([0.1], np.linspace(-0.4, 0.4, 12), 0.004), [('column 1', 12)]),
        (np.vstack([grid([-0.3, 0.3], Z), [[0.05, 0.0, 0.33]]]),
         [('column 1', 8), ('column 2', 8), ('', 1)]),
        *((np.random.default_rng(seed).uniform(-0.4, 0.4, (40, 3)) * [1.0, 0.0, 1.0], [('', 40)])
          for seed in range(5)),
    ],
    ids=['grid', 'by hand', 'rows', 'one line', 'stray', *5 * ['scattered']],
)  # fmt: skip
def test_a_grid_is_read_across_the_passes(places, lines):
    labels = on_part.columns_or_rows(panel(), path_of(serpentine()), places)
    assert labels.tolist() == [label for label, count in lines for _ in range(count)]


def folded(slope: float) -> pd.Surface:
    """A sheet with a bend along z at x = 0, its radius 40 mm over the slope where it is slight."""
    return refined(lambda x, z: slope * 0.01 * np.logaddexp(0.0, x / 0.01), 0.01, 0.02)


def test_a_foot_keeps_off_edges_and_does_not_stand_on_a_bend():
    inside = np.abs(panel().vertices_m[:, [0, 2]]).max(axis=1) < 0.5 - 0.03
    np.testing.assert_array_equal(on_part.can_stand(panel(), 0.03), inside)
    surface = folded(1.2)
    x = surface.vertices_m[:, 0]
    standing = on_part.can_stand(surface)
    assert not standing[np.abs(x) < 0.005].any()
    assert standing[(np.abs(x) > 0.1) & (np.abs(x) < 0.17)].any()
    assert on_part.can_stand(folded(0.1))[np.abs(x) < 0.005].any()


def test_spread_places_are_about_as_many_as_wanted_and_apart_and_those_of_a_grid_exactly():
    surface = panel()
    usable = surface.vertices_m[:, 0] > 0.0
    rows = on_part.spread_places(surface, usable, 100, seed=1)
    assert usable[rows].all()
    assert 80 < len(rows) < 120
    positions = surface.vertices_m[rows]
    distance = np.linalg.norm(positions[:, np.newaxis] - positions, axis=2) + np.eye(len(rows))
    assert distance.min() > 0.05
    rows = on_part.grid_places(surface, on_part.can_stand(surface), 25)
    assert len(set(rows)) == 25
    face = on_part.from_edges_m(surface, surface.vertices_m[rows])
    # Five rows and five columns, to the spacing of the vertices.
    for axis in range(2):
        assert np.count_nonzero(np.diff(np.sort(face[:, axis])) > 0.1) == 4
    # Places on a face are found again.
    surface = folded(0.3)
    at = np.array([[0.05, 0.1], [0.21, 0.33], [0.3, 0.02]])
    points, hit = on_part.on_face_m(surface, at)
    assert hit.all()
    np.testing.assert_allclose(on_part.from_edges_m(surface, points), at, atol=1e-9)
