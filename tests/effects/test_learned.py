"""Laws learned from readings: a curve that acts over its covariate, and nowhere else."""

import pickle
from dataclasses import fields

import numpy as np
import pytest

from booth import MODEL, door, painted, panel, path_of, serpentine, spot
from paint_deposition.effects.catalogue import EFFECTS, effect_class
from paint_deposition.effects.learned.curves import CURVES, LearnedCurve, along_path, at_points
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.pass_film import collapse_um
from reference import reference_film_um

LAW = pytest.mark.parametrize('law', CURVES.values(), ids=CURVES)
RAY_LAWS = [law for law in CURVES.values() if law.flux_factor is not None]
RAY_LAW = pytest.mark.parametrize('law', RAY_LAWS, ids=lambda law: law.covariate)
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
@RAY_LAW
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
    integrator = FilmIntegrator(some, model, 'double', parallel=False)
    integrator.add(leaning)
    expected = reference_film_um(some, leaning, model)
    assert not np.allclose(expected, reference_film_um(some, leaning, MODEL), rtol=1e-2, atol=0.0)
    np.testing.assert_allclose(integrator.raw_um, expected, rtol=0.0, atol=2e-9 * expected.max())


@pytest.mark.parametrize('covariate', ['time_s', 'spray_pass'])
def test_a_pass_by_itself_knows_no_time_and_no_number(covariate):
    across = np.linspace(-0.2, 0.2, 9)
    law = CURVES[covariate](low=0.0, high=5.0, learned=(0.5, 0.5))
    plain = collapse_um(MODEL, across, 0.3)
    with_law = collapse_um(MODEL.with_effect(law), across, 0.3)
    np.testing.assert_allclose(with_law, plain, rtol=0.0, atol=2e-6 * plain.max())


@LAW
def test_it_is_called_by_its_covariate(law):
    assert effect_class(f'learned:{law.covariate}') is law
    assert law.id not in EFFECTS
    assert law.__doc__
    assert law.over in law.__doc__
    assert pickle.loads(pickle.dumps(law.typical())) == law.typical()
