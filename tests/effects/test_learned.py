"""Learned laws: curves over a covariate, maps of a part, and the footprint of the spray."""

from dataclasses import fields

import numpy as np
import pytest
from numba import float32, float64, njit

import scenes
from booth import MODEL, door, painted, panel, path_of, serpentine, spot
from paint_deposition.effects import learned_laws as laws
from paint_deposition.effects.learned_curves import CURVES, LearnedCurve, along_path, at_points
from paint_deposition.effects.learned_laws import LearnedFootprint, LearnedMap, PartGrid, places_m
from paint_deposition.film.pass_film import collapse_um
from paint_deposition.kernel.eq2_flux import Ray, in_precision
from paint_deposition.part.points import SurfacePoints
from reference import reference_film_um

LAW = pytest.mark.parametrize('law', CURVES.values(), ids=CURVES)
RAY_LAWS = {name: law for name, law in CURVES.items() if law.flux_factor is not None}
PATH_LAWS = ('time_s', 'spray_pass', 'stroke_end_m', 'since_trigger_s', 'speed_m_per_s')
SURFACE_LAWS = (
    'curvature_per_m', 'edge_distance_m', 'sky_view_factor', 'height_fraction', 'across_m',
)  # fmt: skip
# A range of each covariate inside what the scenes below have.
RANGES = {
    'incidence_deg': (10.0, 50.0), 'standoff_ratio': (0.8, 1.3), 'time_s': (1.0, 4.0),
    'spray_pass': (0.0, 1.0), 'stroke_end_m': (0.1, 0.3), 'since_trigger_s': (0.1, 0.6),
    'speed_m_per_s': (0.1, 0.5), 'curvature_per_m': (-2.0, 2.0), 'edge_distance_m': (0.02, 0.1),
    'sky_view_factor': (0.6, 0.9), 'height_fraction': (0.2, 0.6), 'across_m': (-0.1, 0.2),
    'film_um': (2.0, 12.0),
}  # fmt: skip
VALUES = (0.3, -0.2, 0.1, 0.4)


def law_over(covariate: str, learned=VALUES, **more) -> LearnedCurve:
    low, high = RANGES[covariate]
    return CURVES[covariate](low=low, high=high, learned=learned, **more)


@LAW
def test_the_curve_has_its_values_at_even_steps_and_is_linear_between(law):
    learned = law_over(law.covariate)
    ends = np.array([learned.low, learned.high])
    np.testing.assert_allclose(learned.curve(ends), [0.3, 0.4], atol=1e-12)
    many = np.linspace(learned.low, learned.high, 7)
    expected = np.interp(law.axis(many), learned.knots, VALUES)
    np.testing.assert_allclose(learned.curve(many), expected, atol=1e-12)
    assert np.ptp(expected) > 0.3


@LAW
def test_one_step_beyond_its_range_it_is_neutral_and_how_well_it_is_known_is_not_told(law):
    """On the axis of the law: the covariate itself may end sooner."""
    linear = type('Linear', (law,), {'axis': staticmethod(lambda value: value)})
    plain = linear(low=1.0, high=4.0, learned=VALUES)
    assert plain.curve(np.array([0.0, 5.0, -3.0, 90.0, np.nan])).tolist() == [0.0] * 5
    np.testing.assert_allclose(plain.curve(np.array([0.5, 4.5])), [0.15, 0.2])
    known = plain.model_copy(update={'sd': (0.1, 0.02, 0.04, 0.2)})
    np.testing.assert_allclose(known.deviation(np.array([1.0, 2.5, 4.0])), [0.1, 0.03, 0.2])
    assert np.isnan(known.deviation(np.array([0.99, 4.01, -3.0, 90.0, np.nan]))).all()
    assert np.isnan(plain.deviation(np.array([2.5]))).all()
    many = np.linspace(-1.0, 6.0, 30)
    assert np.array_equal(known.curve(many), plain.curve(many))


@pytest.mark.parametrize('covariate', PATH_LAWS)
def test_a_law_over_the_path_scales_the_flow_where_the_covariate_is_in_range(covariate):
    passes = path_of(serpentine((0.08, -0.08)))
    law = law_over(covariate, (0.2, 0.2))
    if covariate == 'spray_pass':
        law = CURVES[covariate](low=1.0, high=2.0, learned=(0.2, 0.2))
    value = along_path(passes)[covariate]
    step = law.high - law.low
    inside = (value >= law.low) & (value <= law.high)
    outside = (value <= law.low - step) | (value >= law.high + step)
    changed = law.on_path(passes, None)
    sprays = passes.flow > 0.0
    assert (inside & sprays).any()
    np.testing.assert_allclose(changed.flow[inside], 1.2 * passes.flow[inside])
    np.testing.assert_allclose(changed.open_flow[inside], 1.2 * passes.open_flow[inside])
    assert np.array_equal(changed.flow[outside], passes.flow[outside])
    for column in fields(passes):
        if column.name not in ('flow', 'open_flow'):
            before = getattr(passes, column.name)
            assert np.array_equal(getattr(changed, column.name), before, equal_nan=True)


@pytest.mark.slow
@pytest.mark.parametrize('kind', ['factor', 'addition'])
@pytest.mark.parametrize('covariate', SURFACE_LAWS)
def test_a_law_over_the_surface_changes_the_film_where_the_covariate_is_in_range(covariate, kind):
    points = door().points()
    value = at_points(points)[covariate]()
    low, high = np.quantile(value, 0.3), np.quantile(value, 0.5) + 1e-6
    law = CURVES[covariate](low=low, high=high, learned=(0.5, 0.5), kind=kind)
    position = (law.axis(value) - law.axis(low)) / (law.axis(high) - law.axis(low))
    inside, outside = (position >= 0.0) & (position <= 1.0), (position <= -1.0) | (position >= 2.0)
    assert inside.any()
    assert outside.any()
    film = np.linspace(1.0, 30.0, len(points))
    changed = law.on_film(film, points)
    expected = 1.5 * film if kind == 'factor' else film + 0.5
    np.testing.assert_allclose(changed[inside], expected[inside])
    assert np.array_equal(changed[outside], film[outside])


def test_an_addition_leaves_bare_metal_bare_and_takes_no_more_than_is_there():
    points = door().points()
    film = np.where(points.height_fraction > 0.5, 0.3, 0.0)
    law = CURVES['height_fraction'](learned=(-1.0, -1.0), kind='addition')
    assert law.on_film(film, points).tolist() == [0.0] * len(film)


@pytest.mark.slow
@pytest.mark.parametrize('law', RAY_LAWS.values(), ids=RAY_LAWS)
def test_a_law_over_the_ray_acts_where_the_covariate_is_in_range_as_the_kernel_computes_it(law):
    """A gun at rest before a flat panel: each point has one incidence, all the same distance."""
    points, path = panel().points(), path_of(spot())
    base = painted(panel(), path).raw_um
    film = painted(panel(), path, law_over(law.covariate, (0.25,) * 4)).raw_um
    incidence = np.degrees(np.arctan2(np.hypot(*points.positions_m[:, [0, 2]].T), 0.30))
    inside, axis = base > 0.0, law.axis(incidence)
    if law.covariate == 'incidence_deg':
        inside &= (incidence > 10.0) & (incidence < 50.0)
        beyond = axis >= law.axis(50.0) + (law.axis(50.0) - law.axis(10.0)) / 3.0
        assert np.array_equal(film[beyond], base[beyond])
    assert inside.any()
    np.testing.assert_allclose(film[inside], 1.25 * base[inside], rtol=1e-9)
    some = door().points().select(slice(None, None, 7))
    leaning = path_of(spot(z_m=0.45, standoff_m=0.35))
    model = MODEL.with_effect(law_over(law.covariate))
    film_um = scenes.painted(some, leaning, model, 'double').raw_um
    expected = reference_film_um(some, leaning, model)
    assert not np.allclose(expected, reference_film_um(some, leaning, MODEL), rtol=1e-2, atol=0.0)
    np.testing.assert_allclose(film_um, expected, rtol=0.0, atol=2e-9 * expected.max())


@pytest.mark.parametrize('covariate', ['time_s', 'spray_pass'])
def test_a_pass_by_itself_knows_no_time_and_no_number(covariate):
    across = np.linspace(-0.2, 0.2, 9)
    law = CURVES[covariate](low=0.0, high=5.0, learned=(0.5, 0.5))
    plain = collapse_um(MODEL, across, 0.3)
    with_law = collapse_um(MODEL.with_effect(law), across, 0.3)
    np.testing.assert_allclose(with_law, plain, rtol=0.0, atol=2e-6 * plain.max())


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
    values = tuple(np.ravel(learned).tolist())
    return LearnedMap(maps=(grid_on(points),), kind=kind, learned=values)


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


@pytest.mark.parametrize('kind', ['factor', 'addition'])
def test_the_film_changes_by_the_map_on_its_part_and_on_no_other(kind):
    """Places are to the right of its centre and above it, as the gun sees it: along +x and +z."""
    np.testing.assert_allclose(places_m(PANEL), PANEL.positions_m[:, [0, 2]], atol=1e-12)
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
    grids = grid_on(PANEL), grid_on(door_points, columns=2)
    both = LearnedMap(maps=grids, learned=(*GRID.ravel().tolist(), 0.1, 0.2, 0.3, 0.4))
    film_um = np.full(len(PANEL), 20.0)
    assert np.array_equal(both.on_film(film_um, PANEL), on_part().on_film(film_um, PANEL))
    film_um = np.full(len(door_points), 20.0)
    h = both.on_film(film_um, door_points) / 20.0 - 1.0
    assert h.max() == pytest.approx(0.4, abs=0.02)
    (_, first), (_, second) = both.values_by_part()
    assert np.array_equal(first, GRID)
    assert second.tolist() == [[0.1, 0.2], [0.3, 0.4]]


REACH_M = 0.2
STEP_M = REACH_M / 4
# At each of five radii, of which the innermost has no direction.
RINGS = np.random.default_rng(2).uniform(-0.15, 0.15, size=(5, laws.WAVES))
RINGS[0, 1:] = 0.0
FOOTPRINT = LearnedFootprint(reach_m=REACH_M, learned=tuple(RINGS.ravel()))


def at(x_m: float, y_m: float) -> Ray:
    """A ray that pierces the model plane here."""
    return Ray(x_m, y_m, 1.1, 0.9, 0.4)


@pytest.mark.slow
@pytest.mark.parametrize(('real', 'tolerance'), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_the_compiled_factor_is_one_plus_h_in_its_own_precision(real, tolerance):
    compiled = njit(in_precision(FOOTPRINT.flux_factor, real))
    values = np.array(FOOTPRINT.values(), real)
    x_m, y_m = np.random.default_rng(3).uniform(-1.3 * REACH_M, 1.3 * REACH_M, size=(2, 60))
    rays = (Ray(*np.array(at(x, y), real)) for x, y in zip(x_m, y_m, strict=True))
    found = [compiled(ray, *values) for ray in rays]
    np.testing.assert_allclose(found, 1.0 + FOOTPRINT.h(x_m, y_m), rtol=tolerance)
    (signature,) = compiled.nopython_signatures
    assert signature.return_type == {np.float64: float64, np.float32: float32}[real]


def test_at_its_radii_it_has_the_mean_and_the_harmonics_that_were_given():
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    table = [np.ones(12), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)]
    for ring, values in enumerate(RINGS):
        radius = ring * STEP_M
        found = FOOTPRINT.h(radius * np.cos(angle), radius * np.sin(angle))
        np.testing.assert_allclose(found, values @ table, atol=1e-9)
    along = FOOTPRINT.h(np.array([1.0, 1.25, 2.0]) * STEP_M, np.zeros(3))
    assert along[1] == pytest.approx(0.75 * along[0] + 0.25 * along[2])
    beyond = np.array([REACH_M + STEP_M, 3.0 * REACH_M])
    assert FOOTPRINT.h(beyond, np.zeros(2)).tolist() == [0.0, 0.0]
    for radius in beyond:
        assert FOOTPRINT.flux_factor(at(0.0, radius), *FOOTPRINT.values()) == 1.0
    for x_m in (0.0, 1e-12):
        found = FOOTPRINT.flux_factor(at(x_m, 0.0), *FOOTPRINT.values())
        assert found == pytest.approx(1.0 + RINGS[0, 0])
