"""Laws learned over two coordinates: a map of a part, and the footprint of the spray."""

import numpy as np
import pytest
from numba import float32, float64, njit

from booth import MODEL, door, painted, panel, spot
from paint_deposition.effects.learned.law import (
    WAVES,
    LearnedFootprint,
    LearnedMap,
    PartGrid,
    places_m,
)
from paint_deposition.kernel.laws import Ray, in_precision
from paint_deposition.part.points import SurfacePoints

PANEL = panel().points()
# Three columns 0.3 m apart and two rows 0.2 m apart.
GRID = np.array([[0.1, -0.2, 0.4], [0.3, 0.2, -0.1]])


def grid_on(points: SurfacePoints, **more) -> PartGrid:
    """Knots of a map on a part."""
    values = {
        'part_m': tuple(points.extent_m), 'low_m': (-0.3, -0.1), 'high_m': (0.3, 0.1),
        'columns': 3, 'rows': 2,
    }  # fmt: skip
    return PartGrid(**values | more)


def on_part(points: SurfacePoints = PANEL, learned=GRID, kind: str = 'factor') -> LearnedMap:
    """A map learned on one part; by default the panel of the booth."""
    return LearnedMap(
        maps=(grid_on(points),), kind=kind, learned=tuple(np.ravel(learned).tolist())
    )


def h_at(*places: tuple[float, float]) -> np.ndarray:
    return grid_on(PANEL).weights(np.array(places, dtype=float)) @ GRID.ravel()


def test_it_has_its_values_row_by_row_from_the_lowest_linear_between_and_neutral_beyond():
    knots = [(x, y) for y in (-0.1, 0.1) for x in (-0.3, 0.0, 0.3)]
    np.testing.assert_allclose(h_at(*knots), GRID.ravel(), atol=1e-12)
    assert h_at((-0.15, -0.1)) == pytest.approx(GRID[0, :2].mean())
    assert h_at((0.15, 0.0)) == pytest.approx(GRID[:, 1:].mean())
    assert h_at((0.45, 0.1)) == pytest.approx(0.5 * GRID[1, 2])
    beyond = [(-0.6, 0.0), (0.6, 0.0), (0.0, 0.3), (0.0, -0.3), (9.0, 9.0)]
    np.testing.assert_allclose(h_at(*beyond), 0.0, atol=1e-12)


def test_places_are_to_the_right_of_the_centre_and_above_it_as_the_gun_sees_the_part():
    """The gun looks along +y at a panel in x and z: right is +x, up is +z."""
    np.testing.assert_allclose(places_m(PANEL), PANEL.positions_m[:, [0, 2]], atol=1e-12)


@pytest.mark.parametrize('kind', ['factor', 'addition'])
def test_the_film_changes_by_the_map_on_its_part_and_on_no_other(kind):
    law = on_part(kind=kind)
    film_um = np.linspace(5.0, 30.0, len(PANEL))
    h = grid_on(PANEL).weights(places_m(PANEL)) @ GRID.ravel()
    expected = film_um * (1.0 + h) if kind == 'factor' else film_um + h
    np.testing.assert_allclose(law.on_film(film_um, PANEL), expected, rtol=1e-12)
    assert np.ptp(h) > 0.4
    for other in (door(), panel(0.25)):
        film_um = np.ones(len(other.points()))
        assert law.on_film(film_um, other.points()) is film_um


@pytest.mark.parametrize(('kind', 'count'), [('factor', 1), ('addition', 60)])
def test_few_points_are_changed_as_they_are_among_many(kind, count):
    """To the bit: readings are predicted by themselves, the film of a part as a whole."""
    points, random = door().points(), np.random.default_rng(count)
    law = on_part(points, GRID, kind)
    film_um = random.uniform(1.0, 30.0, len(points))
    rows = np.sort(random.choice(len(points), count, replace=False))
    whole = law.on_film(film_um, points)
    assert not np.array_equal(whole, film_um)
    assert np.array_equal(law.on_film(film_um[rows], points.select(rows)), whole[rows])


def test_each_part_follows_its_own_map():
    door_points = door().points()
    both = LearnedMap(
        maps=(grid_on(PANEL), grid_on(door_points, columns=2)),
        learned=(*GRID.ravel().tolist(), 0.1, 0.2, 0.3, 0.4),
    )
    film_um = np.full(len(PANEL), 20.0)
    assert np.array_equal(both.on_film(film_um, PANEL), on_part().on_film(film_um, PANEL))
    film_um = np.full(len(door_points), 20.0)
    h = both.on_film(film_um, door_points) / 20.0 - 1.0
    assert h.max() == pytest.approx(0.4, abs=0.02)
    (_, first), (_, second) = both.values_by_part()
    assert np.array_equal(first, GRID)
    assert second.tolist() == [[0.1, 0.2], [0.3, 0.4]]


# The footprint.

REACH_M = 0.2
STEP_M = REACH_M / 4
# At each of five radii, of which the innermost has no direction.
RINGS = np.random.default_rng(2).uniform(-0.15, 0.15, size=(5, WAVES))
RINGS[0, 1:] = 0.0
LAW = LearnedFootprint(reach_m=REACH_M, learned=tuple(RINGS.ravel()))


def at(x_m: float, y_m: float) -> Ray:
    """A ray that pierces the model plane here."""
    return Ray(x_m, y_m, 1.1, 0.9, 0.4)


@pytest.mark.slow
@pytest.mark.parametrize(('real', 'tolerance'), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_the_compiled_factor_is_one_plus_h_in_its_own_precision(real, tolerance):
    compiled = njit(in_precision(LAW.flux_factor, real))
    values = np.array(LAW.values(), real)
    x_m, y_m = np.random.default_rng(3).uniform(-1.3 * REACH_M, 1.3 * REACH_M, size=(2, 60))
    found = [
        compiled(Ray(*np.array(at(x, y), real)), *values) for x, y in zip(x_m, y_m, strict=True)
    ]
    np.testing.assert_allclose(found, 1.0 + LAW.h(x_m, y_m), rtol=tolerance)
    (signature,) = compiled.nopython_signatures
    assert signature.return_type == {np.float64: float64, np.float32: float32}[real]


def test_at_its_radii_it_has_the_mean_and_the_harmonics_that_were_given():
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    table = [np.ones(12), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)]
    for ring, values in enumerate(RINGS):
        radius = ring * STEP_M
        found = LAW.h(radius * np.cos(angle), radius * np.sin(angle))
        np.testing.assert_allclose(found, values @ table, atol=1e-9)


def test_between_two_radii_it_is_linear_and_one_step_beyond_reach_nothing():
    along = LAW.h(np.array([1.0, 1.25, 2.0]) * STEP_M, np.zeros(3))
    assert along[1] == pytest.approx(0.75 * along[0] + 0.25 * along[2])
    beyond = np.array([REACH_M + STEP_M, 3.0 * REACH_M])
    assert LAW.h(beyond, np.zeros(2)).tolist() == [0.0, 0.0]
    for radius in beyond:
        assert LAW.flux_factor(at(0.0, radius), *LAW.values()) == 1.0


@pytest.mark.parametrize('x_m', [0.0, 1e-12])
def test_at_the_very_centre_it_is_finite(x_m):
    assert LAW.flux_factor(at(x_m, 0.0), *LAW.values()) == pytest.approx(1.0 + RINGS[0, 0])


def volume_um_m2(*effects) -> float:
    """Paint on the panel in front of a gun that stands still for a second."""
    surface = panel(0.5, 0.01)
    return float(painted(surface, spot(), *effects).raw_um.sum())


def of_the_pattern(h) -> float:
    """Integral over the model plane of the pattern times a function of the place."""
    line = np.linspace(-0.6, 0.6, 801)
    x, y = np.meshgrid(line, line)
    return float((MODEL.planar.flux_um_per_s(x, y) * h(x, y)).sum())


@pytest.mark.slow
def test_the_paint_on_a_flat_panel_changes_as_the_integral_of_the_pattern():
    """All that passes the model plane lands on the panel, wherever it passes."""
    expected = of_the_pattern(lambda x, y: 1.0 + LAW.h(x, y)) / of_the_pattern(lambda x, y: 1.0)
    assert abs(expected - 1.0) > 0.01
    assert volume_um_m2(LAW) / volume_um_m2() == pytest.approx(expected, abs=3e-4)
