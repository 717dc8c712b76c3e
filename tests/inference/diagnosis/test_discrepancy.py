"""The discrepancy: which parts share it, and how large it is where."""

from dataclasses import replace

import numpy as np
import pytest

from booth import MODEL
from inference.diagnosis import readings_on_door
from inference.diagnosis.readings_on_door import at_model, on_door, on_panel, study_of
from paint_deposition.effects.learned_laws import WAVES
from paint_deposition.inference.design.sprays import MENU
from paint_deposition.inference.diagnosis import discrepancy as of_nature
from paint_deposition.inference.diagnosis.discrepancy import FINE_RADII, PRIOR, ModelDiscrepancy
from paint_deposition.inference.diagnosis.smooth_laws import footprint_basis

# Parts of the study: a door, and a panel twice.
DOOR, FIRST, SECOND = range(3)
X = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope='module')
def study():
    return study_of(on_door(count=16), on_panel('first'), on_panel('second'))


@pytest.fixture(scope='module')
def discrepancy(study) -> ModelDiscrepancy:
    return ModelDiscrepancy.of(study, at_model(study))


@pytest.fixture(scope='module')
def alone():
    """The door as the only part."""
    study = study_of(on_door(count=16))
    return study, ModelDiscrepancy.of(study, at_model(study))


def between(study, covariance: np.ndarray, one: int, other: int) -> np.ndarray:
    owner = study.campaign.experiment_of
    return covariance[np.ix_(owner == one, owner == other)]


def test_choices_are_as_probable_as_one_also_with_what_an_earlier_job_says(discrepancy, alone):
    for found, repeated in ((discrepancy, True), (alone[1], False)):
        choices = found.choices()
        for sizes in choices:
            covariance = found.covariance(sizes)
            np.testing.assert_allclose(covariance, covariance.T, rtol=1e-6, atol=1e-12)
            values = np.linalg.eigvalsh(covariance)
            assert values[0] > -1e-9 * values[-1]
            # Parts differ from each other only where some were painted alike.
            assert (sizes.part > 0.0) == found.is_repeated == repeated
        for beyond in (False, True):
            prior = [s.log_prior for s in choices if s.is_beyond_nature == beyond]
            assert np.exp(prior).sum() == pytest.approx(1.0)
    # Sizes in the middle of what was measured are the most probable.
    usual = [sizes for sizes in discrepancy.choices() if not sizes.is_beyond_nature]
    best = max(usual, key=lambda sizes: sizes.log_prior)
    assert (best.setting, best.part) == (0.02, 0.01)
    told = replace(discrepancy, known_footprint=(PRIOR.footprints[0], 1.1)).choices()
    prior = np.zeros(len(PRIOR.footprints))
    for sizes in told:
        prior[sizes.footprint] += np.exp(sizes.log_prior) * (not sizes.is_beyond_nature)
    assert prior.sum() == pytest.approx(1.0)
    # Three times the size is more than two standard deviations off: jobs differ by half.
    assert 0.02 < prior[1] < 0.1
    assert prior[2] < 1e-4


def test_parts_painted_alike_share_the_setting_and_others_the_footprint(study, discrepancy):
    """Those painted alike differ by the part. They were measured at the same places."""
    for settings, parts in zip(discrepancy.settings, discrepancy.parts, strict=True):
        own = between(study, settings, FIRST, FIRST)
        assert own.any()
        assert between(study, settings, FIRST, SECOND) == pytest.approx(own)
        assert between(study, parts, FIRST, FIRST) == pytest.approx(own)
        assert not between(study, parts, FIRST, SECOND).any()
        assert not between(study, parts, DOOR, DOOR).any()
    for sizes in discrepancy.choices():
        assert not between(study, discrepancy.of_parts(sizes), DOOR, FIRST).any()
        assert between(study, discrepancy.of_footprint(sizes), DOOR, FIRST).any()


def test_fields_fall_with_the_root_of_the_film_and_with_the_distance(alone):
    study, discrepancy = alone
    film_um = study.forward.predict_um(MODEL)
    for covariance, length_m in zip(discrepancy.settings, discrepancy.lengths_m, strict=True):
        scale = np.sqrt(film_um * film_um.max()) / study.sigma_um
        assert np.sqrt(np.diag(covariance)) == pytest.approx(scale)
        places = study.campaign.positions_m
        away_m = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
        correlation = np.exp(-0.5 * (away_m / length_m) ** 2)
        assert covariance / np.outer(scale, scale) == pytest.approx(correlation)


def mean_flux(radius_m: np.ndarray, power: tuple[float, float] = (1.0, 1.0)) -> np.ndarray:
    """Flux around the axis over the peak's, its Gaussians exp(-u) being exp(-u^power)."""
    p = MODEL.planar
    turned = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)[:, np.newaxis]
    even = p.f(np.cos(turned), np.sin(turned)).mean()
    u1 = (radius_m - p.r_m) ** 2 / (2.0 * p.sigma1_m**2)
    u2 = radius_m**2 / (2.0 * p.sigma2_m**2)
    ring = (1.0 - p.K2) * even * p.g1(radius_m, 0.0) * np.exp(u1 - u1 ** power[0])
    centre = p.K2 * p.g2(radius_m, 0.0) * np.exp(u2 - u2 ** power[1])
    return p.K1_cm3_per_s * (ring + centre) / p.peak_flux_um_per_s


def test_the_footprint_deviates_by_a_share_of_its_peak_its_tails_by_another_power(alone):
    study, discrepancy = alone
    basis = footprint_basis(study, MODEL, FINE_RADII)
    knots_m = np.linspace(0.0, basis.settings['reach_m'], FINE_RADII)
    flux, shape = mean_flux(knots_m), (FINE_RADII, WAVES, -1)
    tables = [of_peak.reshape(shape) for of_peak in discrepancy.footprint.of_peak]
    for size, of_peak in zip(PRIOR.footprints, tables, strict=True):
        # The pattern hardly moves the second harmonics.
        sd = np.sqrt(np.sum(of_peak[:, 3:] ** 2, axis=2))
        expected = np.minimum(size, flux)[:, np.newaxis]
        assert sd == pytest.approx(np.repeat(expected, 2, axis=1), rel=0.05, abs=0.15 * size)
        assert sd[flux.argmax()] == pytest.approx(size, rel=0.05)
        assert np.array_equal(of_peak[:, :, :2], tables[0][:, :, :2])
    assert flux[-1] < min(PRIOR.footprints)
    tails, step = tables[0][:, :, :2], 1e-4
    assert not tails[:, 1:].any()
    for k, power in enumerate(((1.0 + step, 1.0), (1.0, 1.0 + step))):
        change = PRIOR.tails * (mean_flux(knots_m, power) - flux) / step
        assert tails[:, 0, k] == pytest.approx(np.clip(change, -flux, flux), abs=2e-3)


def test_the_footprint_changes_the_readings_by_what_no_pattern_does(alone):
    study, discrepancy = alone
    columns, law = discrepancy.footprint.columns[-1], discrepancy.footprint.laws[-1]
    by_knots = law.change_um / study.sigma_um[:, np.newaxis]
    assert columns[:, :2] == pytest.approx(by_knots[:, :2])
    amounts = np.random.default_rng(1).normal(size=columns.shape[1])
    assert np.corrcoef(columns @ amounts, by_knots @ amounts)[0, 1] > 0.95
    fit = at_model(study)
    pattern = fit.jacobian[:, : len(fit.parameters.pattern)]
    assert np.abs(pattern.T @ columns[:, 2:]).max() < 1e-6 * np.linalg.norm(pattern)


def test_where_no_paint_lands_nothing_is_left_over():
    """On the back of a plate the model predicts exactly 0."""
    study = study_of(readings_on_door.plate_with_a_back())
    discrepancy = ModelDiscrepancy.of(study, at_model(study))
    covariance = discrepancy.covariance(discrepancy.choices()[-1])
    assert not covariance[-1].any()
    assert (np.diag(covariance)[:-1] > 0.0).all()


def test_which_parts_were_painted_alike():
    part = on_panel()
    near, far = (
        replace(part, path=part.path.with_(position_m=np.add(part.path.position_m, away_m * X)))
        for away_m in (0.002, 0.05)
    )
    off = replace(part, switched_off=frozenset(['voltage']))
    menu = {change.key: change.made(part) for change in MENU}
    found = of_nature.painted_alike(
        [part, near, far, on_door(count=16), off, replace(part, name='again')]
    )
    assert found.tolist() == [0, 0, 1, 2, 3, 0]
    for key in ('half_flow', 'double_speed', 'further', 'turned', 'longer_open', 'voltage_off'):
        assert of_nature.painted_alike([part, menu[key]]).tolist() == [0, 1], key
