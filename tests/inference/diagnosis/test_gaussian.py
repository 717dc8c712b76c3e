"""Log Bayes factors in closed form, and laws of any form as changes of readings."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.stats import f, kstest, multivariate_normal, multivariate_t, norm

from booth import MODEL
from inference.diagnosis.linear import KNOWN, PARAMETERS, fit_linear, linear_fit, null_of
from inference.diagnosis.readings_on_door import on_door, on_panel, study_of
from paint_deposition.effects.catalogue import LEARNED
from paint_deposition.effects.learned_laws import hat_weights
from paint_deposition.inference.diagnosis import gaussian, smooth_laws
from paint_deposition.inference.diagnosis.model_space import SIZES
from paint_deposition.report.colour_scales import TWO_SIDED_95
from reference import reference_film_um

READINGS = 30


@pytest.fixture(params=[PARAMETERS, KNOWN], ids=['weak', 'known'])
def fit(request):
    return linear_fit(np.random.default_rng(3), READINGS, parameters=request.param)


@pytest.fixture
def columns():
    return np.random.default_rng(4).normal(size=(READINGS, 3))


def test_the_null_model_has_the_covariance_of_all_that_varies(fit, columns):
    """It is the same where the discrepancy is given as columns; some readings have their part."""
    plain, discrepancy = null_of(fit, columns), 2.0 * columns @ columns.T
    prior = fit.parameters.prior
    pattern = fit.jacobian @ prior.factor
    covariance = np.eye(READINGS) + pattern @ pattern.T + columns @ columns.T
    deviation = fit.residual + fit.jacobian @ (fit.vector - prior.centre)
    assert plain.lower @ plain.lower.T == pytest.approx(covariance)
    rows = np.arange(READINGS) % 3 > 0
    around = partial(gaussian.NullModel.around, fit, columns)
    other, beside = around(discrepancy=covariance), plain.beside(np.sqrt(2.0) * columns)
    for null in (around(discrepancy=discrepancy), other.with_discrepancy(discrepancy), beside):
        assert null.lower @ null.lower.T == pytest.approx(covariance + discrepancy)
        assert null.lower @ null.deviation == pytest.approx(deviation)
        part = null.select(rows)
        expected = (covariance + discrepancy)[np.ix_(rows, rows)]
        assert part.lower @ part.lower.T == pytest.approx(expected)
        assert part.lower @ part.deviation == pytest.approx(null.scaled_deviation[rows])


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_signed_amplitude_beside_free_ones_is_integrated_over_its_side(side):
    """Two directions that are not orthogonal, the second of one sign."""
    random = np.random.default_rng(6)
    columns = random.normal(size=(8, 2)) * 0.5
    columns[:, 1] += 0.5 * columns[:, 0]
    data = random.normal(size=8) + columns @ [0.5, 1.0]

    def likelihood_ratio(second: float, first: float) -> float:
        left = data - columns @ [first, second]
        prior = 2.0 * norm.pdf(first) * norm.pdf(second)
        return np.exp(0.5 * (data @ data - left @ left)) * prior

    integral, _ = dblquad(likelihood_ratio, -7.0, 7.0, *sorted((0.0, 7.0 * side)))
    directions = gaussian.OrthogonalDirections.of(columns, np.array([0.0, side]))
    found = directions.log_bayes_factors(data[:, np.newaxis], np.ones(1), np.inf)[0, 0]
    assert found == pytest.approx(np.log(integral), abs=1e-5)


def test_simulated_deviations_are_as_wide_as_the_noise_is_uncertain():
    squares = (gaussian.simulated(1, 8.0, 4000, seed=3) ** 2).ravel()
    assert kstest(squares, f(1, 8).cdf).pvalue > 0.01
    assert np.std(gaussian.simulated(50, np.inf, 400, seed=3)) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize('beyond', [0.5, 1.0, 3.0])
def test_evidence_at_a_bound_is_the_integral_over_what_is_physical(fit, beyond):
    """Of readings that ask for K2 below zero by so many of its standard deviations."""
    prior, k2, rest = fit.parameters.prior, 1, [0, *range(2, 7)]
    covariance, jacobian = prior.factor @ prior.factor.T, fit.jacobian
    fitted = np.linalg.inv(jacobian.T @ jacobian + prior.whitening.T @ prior.whitening)
    wanted = -beyond * np.sqrt(fitted[k2, k2])
    data = jacobian @ fit.vector + fit.residual
    data = data + jacobian[:, k2] * (wanted - fit.vector[k2]) / (1.0 - fitted[k2, k2])

    def given(value: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance of the others, K2 having a value."""
        slope = covariance[rest, k2] / covariance[k2, k2]
        spread = covariance[np.ix_(rest, rest)] - np.outer(slope, covariance[k2, rest])
        return prior.centre[rest] + slope * (value - prior.centre[k2]), spread

    def density(value: float) -> float:
        mean, spread = given(value)
        expected = jacobian[:, rest] @ mean + jacobian[:, k2] * value
        shape = np.eye(READINGS) + jacobian[:, rest] @ spread @ jacobian[:, rest].T
        likelihood = multivariate_normal(expected, shape).logpdf(data)
        density_of_k2 = norm(prior.centre[k2], prior.width[k2]).pdf(value)
        return float(np.exp(likelihood + 0.5 * READINGS * np.log(2.0 * np.pi)) * density_of_k2)

    (mean, spread), vector = given(0.0), np.zeros(7)
    part, left = jacobian[:, rest], data - jacobian[:, rest] @ mean
    gain = spread @ part.T @ np.linalg.inv(np.eye(READINGS) + part @ spread @ part.T)
    vector[rest] = mean + gain @ left
    stopped = replace(fit, vector=vector, residual=data - jacobian @ vector)
    null = null_of(stopped)
    found = null.log_evidence(null.deviation[:, np.newaxis], np.inf)[0]
    integral, _ = quad(density, 0.0, 20.0 * np.sqrt(fitted[k2, k2]))
    assert found == pytest.approx(np.log(integral), abs=1e-4)
    assert null.columns.shape[1] == len(rest)


@pytest.mark.parametrize('freedom', [np.inf, 6.0])
@pytest.mark.parametrize('count', [3, 40])
def test_factor_is_the_ratio_of_densities_whatever_does_not_show(count, freedom):
    """Of directions there may be more than readings or fewer."""
    random = np.random.default_rng(4)
    seen = random.normal(size=(12, count))
    columns = np.hstack([seen, seen @ random.normal(size=(count, 30))])
    data = random.normal(size=(12, 5))
    found = gaussian.OrthogonalDirections.of(columns, np.zeros(columns.shape[1]))
    assert found.columns.shape[1] == min(count, 12)
    factor = found.log_bayes_factors(data, np.array([0.7]), freedom)[0]
    covariance = np.eye(12) + 0.49 * columns @ columns.T
    shapes = covariance, np.eye(12)
    of_one, of_none = (multivariate_t(shape=c, df=freedom).logpdf(data.T) for c in shapes)
    np.testing.assert_allclose(factor, of_one - of_none, rtol=1e-8)
    amounts = found.amplitudes(data[:, 0], np.array([0.7]))[0]
    mean = 0.49 * columns.T @ np.linalg.solve(covariance, data[:, 0])
    np.testing.assert_allclose(amounts, mean, atol=1e-8)


@pytest.mark.parametrize('side', [0.0, 1.0])
def test_shifted_deviations_are_weighed_as_if_they_were_there(columns, side):
    draws = gaussian.simulated(READINGS, 8.0, 4, seed=6)
    shifts = np.random.default_rng(8).normal(size=(READINGS, 3))
    moved = (draws[:, np.newaxis] + shifts[:, :, np.newaxis]).reshape(READINGS, -1)
    principal = gaussian.OrthogonalDirections.of(columns, np.array([side, 0.0, 0.0]))
    expected = principal.log_bayes_factors(moved, SIZES, 8.0)
    np.testing.assert_allclose(principal.log_bayes_factors(draws, SIZES, 8.0, shifts), expected)


@pytest.fixture(scope='module')
def study():
    return study_of(on_door(count=12))


def film_um(experiment, model, law=None) -> np.ndarray:
    """(P,) film at the readings, ray by ray, with a law in the model or none."""
    points, path = experiment.measured_points, experiment.path
    if law is None:
        return reference_film_um(points, path, model)
    arrived_um = reference_film_um(points, law.on_path(path, None), model.with_effect(law))
    return law.on_film(arrived_um, points)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('law', 'kind'),
    [(law, k) for name, law in LEARNED.items() if name != 'speed_m_per_s' for k in law.kinds],
    ids=lambda value: value if isinstance(value, str) else value.covariate,
)  # fmt: skip
def test_a_random_law_changes_the_readings_as_the_law_in_the_model_does(law, kind, study):
    """No linearisation is left: film is linear in the values of one law at its knots."""
    (basis,) = smooth_laws.bases_over(study, MODEL, law, kind)
    random = basis.random(0.03, 1.0)
    amplitudes = np.random.default_rng(2).normal(size=random.at_knots.shape[1])
    change_um = random.change_um @ amplitudes
    (door,) = study.campaign.experiments
    in_model = film_um(door, MODEL, random.learned(amplitudes)) - film_um(door, MODEL)
    assert np.abs(in_model).max() > 0.01
    np.testing.assert_allclose(change_um, in_model, atol=1e-10)


def test_around_another_model_a_law_keeps_its_values_and_changes_other_film(study):
    twice = MODEL.planar.model_copy(update={'K1_cm3_per_s': 2.0 * MODEL.planar.K1_cm3_per_s})
    other = MODEL.model_copy(update={'planar': twice})
    for covariate in ('time_s', 'place', 'footprint'):
        (basis,) = smooth_laws.bases_over(study, MODEL, LEARNED[covariate], 'factor')
        random = basis.random(0.05, 1.0)
        moved = random.around(study, other)
        assert np.array_equal(moved.at_knots, random.at_knots)
        np.testing.assert_allclose(moved.change_um, 2.0 * random.change_um, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(
    ('edges', 'lengths', 'correlation'),
    [
        (False, (0.5, 1.0, 3.0), lambda d: np.exp(-0.5 * d**2)),
        # A map bends more sharply: beyond an edge it still knows less of the other side.
        (True, (3.0,), lambda d: (1.0 + np.sqrt(3.0) * d) * np.exp(-np.sqrt(3.0) * d)),
    ],
    ids=['curve', 'map'],
)
def test_values_have_the_size_and_the_correlation_that_were_asked_for(edges, lengths, correlation):
    step, knots = 0.5, np.arange(9)
    at = step * knots[:, np.newaxis]
    basis = smooth_laws.Basis(LEARNED['height_fraction'], {}, np.eye(9), at, step, edges=edges)
    away = step * np.abs(np.subtract.outer(knots, knots))
    for length in lengths:
        random = basis.random(0.2, length)
        expected = 0.2**2 * correlation(away / length)
        covariance = random.at_knots @ random.at_knots.T
        assert covariance == pytest.approx(expected, abs=0.03 * 0.2**2)


def test_harmonics_of_a_footprint_are_independent(study):
    random = smooth_laws.footprint_basis(study, MODEL).random(1.0, 2.0)
    covariance = random.at_knots @ random.at_knots.T
    wave = np.arange(len(covariance)) % 5
    assert np.abs(covariance[wave[:, np.newaxis] != wave]).max() < 1e-9
    assert covariance[10, 5] == pytest.approx(np.exp(-0.5 / 2.0**2), abs=0.03)


def test_each_part_has_a_map_of_its_own_and_parts_of_one_shape_share_it():
    study = study_of(on_door(count=12), on_panel('first'), on_panel('second'))
    owner = study.campaign.experiment_of
    door, panel, both = smooth_laws.map_bases(study, MODEL)
    assert door.film_um[owner == 0].any()
    assert not door.film_um[owner > 0].any()
    assert not panel.film_um[owner == 0].any()
    assert np.array_equal(panel.film_um[owner == 1], panel.film_um[owner == 2])
    points = [experiment.measured_points for experiment in study.campaign.experiments]
    grids = both.settings['maps']
    assert grids == (*door.settings['maps'], *panel.settings['maps'])
    of_grid = [[grid.is_of(p) for p in points] for grid in grids]
    assert of_grid == [[True, False, False], [False, True, True]]


KNOTS, FILM_UM, NOISE_UM = 12, 30.0, 0.6


def fitted(law: smooth_laws.RandomLaw, truth: np.ndarray, random: np.random.Generator):
    """The fit of readings of a true curve (K,), the level of all film being unknown, too."""
    jacobian = np.zeros((len(law.basis.film_um), len(PARAMETERS)))
    jacobian[:, 0] = FILM_UM / NOISE_UM
    level = PARAMETERS.prior.centre[0] + 0.05
    true = law.basis.film_um @ truth / NOISE_UM + jacobian[:, 0] * level
    fit = fit_linear(jacobian, true + random.normal(size=len(true)))
    return replace(fit, nuisance=law.change_um / NOISE_UM)


def covered(law: smooth_laws.RandomLaw, truth: np.ndarray, random) -> np.ndarray:
    """(K,) whether the band of a fit holds the true curve at the knots, but for its level."""
    learned = law.learned(*fitted(law, truth, random).amplitudes)
    away = np.array(learned.learned) - truth
    away -= np.average(away, weights=law.basis.film_um.sum(axis=0))
    return np.abs(away) <= TWO_SIDED_95 * np.array(learned.sd)


@pytest.fixture
def law() -> smooth_laws.RandomLaw:
    """Factors over a covariate of which each reading has one value; few are on one side."""
    places = (KNOTS - 1) * np.random.default_rng(1).beta(1.0, 2.0, size=60)
    settings = {'kind': 'factor', 'low': 0.0, 'high': KNOTS - 1.0}
    film_um = FILM_UM * hat_weights(places, KNOTS)
    at = np.arange(KNOTS, dtype=float)[:, np.newaxis]
    return smooth_laws.Basis(LEARNED['time_s'], settings, film_um, at, 1.0).random(0.1, 3.0)


def test_the_band_holds_curves_of_the_prior_as_often_as_it_says(law):
    random, count = np.random.default_rng(2), law.at_knots.shape[1]
    held = [covered(law, law.at_knots @ random.normal(size=count), random) for _ in range(300)]
    # The standard error is below 0.7 %, as a curve counts for several independent values.
    assert np.mean(held) == pytest.approx(0.95, abs=0.02)
    assert np.mean(held, axis=0) == pytest.approx(np.full(KNOTS, 0.95), abs=0.05)


def test_the_band_is_wide_where_readings_are_few_and_not_for_a_level_of_the_pattern(law):
    random = np.random.default_rng(4)
    fit = fitted(law, np.zeros(KNOTS), random)
    sd, before = law.sd(fit.amplitudes[1]), law.sd(np.eye(law.at_knots.shape[1]))
    assert sd[-1] > 3.0 * sd[2]
    assert (sd < before).all()
    doubled = replace(fit, nuisance=0.5 * fit.nuisance, jacobian=0.5 * fit.jacobian)
    assert (law.sd(doubled.amplitudes[1]) > 1.2 * sd).all()
    # A level would hide the form: that of pattern and factor together is known, not each.
    covariance = fitted(law, np.zeros(KNOTS), np.random.default_rng(5)).amplitudes[1]
    level = np.sqrt(np.diag(law.at_knots @ covariance @ law.at_knots.T)).min()
    assert level > 2.0 * np.median(law.sd(covariance))
    settings = {**law.basis.settings, 'kind': 'addition'}
    # Its form is what a centred law keeps.
    forms = [np.diff(one.at_knots, axis=0) for one in (law.centred, law)]
    np.testing.assert_allclose(*forms)
    added = replace(law, basis=replace(law.basis, settings=settings))
    assert added.sd(covariance).min() == pytest.approx(level)
