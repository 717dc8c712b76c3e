"""A learned map: the film follows the place on the part that it was learned on, and no other."""

import numpy as np
import pytest

from booth import door, panel
from paint_deposition.effects.learned.law import LearnedMap, PartGrid, places_m
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
