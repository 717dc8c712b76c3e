"""Slips among single readings are found, what neighbours share is kept; texture is estimated."""

from dataclasses import replace

import numpy as np
import pytest

from inference.fitting.panels import painted_by, passes
from paint_deposition.api import inference
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.faraday_shielding import FaradayShielding
from paint_deposition.inference.diagnosis import run
from paint_deposition.inference.diagnosis.procedure import diagnose
from paint_deposition.inference.fitting import calibration
from paint_deposition.inference.fitting.sifting import sifted
from paint_deposition.inference.fitting.slips import Slip, slips
from paint_deposition.inference.fitting.smooth_misfit import Misfit, Scatter
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.covariates import Covariate
from paint_deposition.inference.readings.readings import Readings
from small_campaign import small_campaign

FILM_UM, GAUGE_UM = 30.0, 0.7
COUNT = 96


def scattered(seed: int, texture: float = 0.005) -> Misfit:
    """Readings over a sheet, a share of them at its edge, beside a model of one free level."""
    random = np.random.default_rng(seed)
    positions = np.column_stack([random.uniform(0.0, 1.0, (COUNT, 2)), np.zeros(COUNT)])
    edge_m = np.minimum(np.min(np.minimum(positions[:, :2], 1.0 - positions[:, :2]), axis=1), 0.1)
    noise = GAUGE_UM * random.normal(size=COUNT)
    noise = noise + texture * FILM_UM * random.normal(size=COUNT)
    return Misfit(
        noise,
        np.full(COUNT, FILM_UM),
        np.full(COUNT, GAUGE_UM),
        np.full((COUNT, 1), FILM_UM),
        np.zeros(COUNT, dtype=int),
        positions,
        (
            Covariate('edge_distance_m', edge_m),
            Covariate('height_m', positions[:, 1]),
            Covariate('across_m', positions[:, 0]),
        ),
    )


def built_up(misfit: Misfit) -> Misfit:
    """The same with half as much film again at the edge, falling off within 20 mm."""
    distance_m = misfit.covariates[0].values
    more = 0.5 * FILM_UM * np.exp(-distance_m / 0.02)
    return replace(misfit, residual_um=misfit.residual_um + more)


def slipped(misfit: Misfit, row: int, by_um: float) -> Misfit:
    residual = misfit.residual_um.copy()
    residual[row] += by_um
    return replace(misfit, residual_um=residual)


EVERY = np.ones(COUNT, dtype=bool)


@pytest.mark.slow
@pytest.mark.parametrize('missing', [lambda misfit: misfit, built_up])
def test_sound_readings_are_kept_whatever_is_missing(missing):
    """Of 2400 readings at most two: a slip is one that has no like."""
    removed = sum(len(slips(missing(scattered(seed)), EVERY)) for seed in range(25))
    assert removed <= 2


@pytest.mark.parametrize('missing', [lambda misfit: misfit, built_up])
@pytest.mark.parametrize('by_um', [9.0 * FILM_UM, -0.9 * FILM_UM, 12.0 * GAUGE_UM])
def test_a_slip_is_found_whatever_is_missing(missing, by_um):
    for seed in range(3):
        misfit = missing(scattered(seed))
        row = int(np.argmax(misfit.covariates[0].values))  # well inside the sheet
        assert list(slips(slipped(misfit, row, by_um), EVERY)) == [row]


def test_slips_do_not_hide_each_other():
    misfit = scattered(1)
    for row in (3, 30, 60):
        misfit = slipped(misfit, row, 9.0 * FILM_UM)
    assert set(slips(misfit, EVERY)) == {3, 30, 60}


def test_many_slips_are_none():
    """Where a tenth of all readings is off, the model is at fault and not the pen."""
    misfit = scattered(1)
    for row in range(0, COUNT, 10):
        misfit = slipped(misfit, row, 3.0 * FILM_UM)
    assert slips(misfit, EVERY) == {}


def test_a_point_that_was_read_again_is_no_slip():
    again = EVERY.copy()
    again[5] = False
    assert slips(slipped(scattered(2), 5, 9.0 * FILM_UM), again) == {}


def test_a_prediction_without_the_reading_is_that_of_the_others_alone():
    """The closed form against a mixture that has never seen the reading."""
    # Without covariates, whose scale would be that of the readings.
    misfit, row = replace(built_up(scattered(4)), covariates=()), 17
    others = np.delete(np.arange(COUNT), row)
    whole, without = Scatter.of(misfit), Scatter.of(misfit.select(others))
    joint = np.logaddexp.reduce(whole.log_weight) - np.logaddexp.reduce(without.log_weight)
    normal = -0.5 * np.log(2.0 * np.pi)
    # The smallest directions of a field, which are left out, are not quite those of all.
    assert whole.log_density[row] == pytest.approx(joint + normal, abs=0.01)


@pytest.mark.parametrize(
    ('written', 'expected', 'guess'),
    [(312.0, 30.4, 31.2), (3.12, 30.4, 31.2), (13.2, 30.9, 31.2), (0.2, 30.4, None)],
)
def test_what_was_probably_meant(written, expected, guess):
    slip = Slip('door: P7', written, expected, 0.9)
    assert slip.guess_um == (None if guess is None else pytest.approx(guess))
    assert f"point 'door: P7': {written:.4g} µm" in str(slip)
    assert ('?' in str(slip)) == (guess is not None)


@pytest.mark.slow
@pytest.mark.parametrize('texture', [0.002, 0.02])
def test_the_texture_is_estimated_beside_a_missing_effect(texture):
    shares = [Scatter.of(built_up(scattered(seed, texture))).texture_share for seed in range(12)]
    assert np.mean(shares) == pytest.approx(texture, abs=0.006)


# --- through the real interface


@pytest.fixture(scope='module')
def campaign(tmp_path_factory):
    """A door with edge build, 97 readings, of which one is a typing error."""
    good = small_campaign(
        tmp_path_factory.mktemp('edge'), seed=5, truth='edge_build', amplitude=0.5,
        experiments=('door',), readings=97, repeats=20, style='random', parcels=2_000_000,
    )  # fmt: skip
    (door,) = good.experiments
    row = int(np.flatnonzero(door.means.repeats[door.means.owner] == 1)[10])
    thickness = door.readings.thickness_um.copy()
    thickness[row] *= 10.0
    readings = replace(door.readings, thickness_um=thickness)
    return row, Campaign((Experiment.of(door.name, door.surface, door.path, readings),))


@pytest.mark.slow
def test_a_typing_error_does_not_change_the_verdict(campaign, monkeypatch):
    for room in (run, inference, calibration):
        monkeypatch.setattr(room, 'STARTS', 2)
    row, bad = campaign
    library = {e.id: e for e in (AirDrift, EdgeBuild, FaradayShielding)}
    found = diagnose(bad, DepositionModel(), library)
    assert found.verdict == 'effect_missing'
    assert found.accepted == ('edge_build',)
    (slip,) = found.to_dict()['left_out']
    assert slip['thickness_um'] == bad.readings.thickness_um[row]
    assert slip['guess_um'] == pytest.approx(0.1 * slip['thickness_um'])
    assert (
        sum("point 'door: " in note and 'left out of the fit' in note for note in found.notes) == 1
    )
    label = str(bad.readings.point[row])
    calibrated = inference.calibrate(bad)
    for result in (inference.compare(bad, found.history[0].model), calibrated):
        assert [one.point for one in result.study.slips] == [label]
    assert any(label in warning for warning in calibrated.warnings)


@pytest.mark.slow
def test_a_thick_film_without_texture_is_no_broken_fit(monkeypatch):
    """A gauge of 0.5 µm on 80 µm of even film: the usual texture alone would be 0.8 µm."""
    monkeypatch.setattr(run, 'STARTS', 1)
    x, z = np.meshgrid(np.linspace(-0.35, 0.35, 8), np.linspace(0.1, 1.9, 24))
    grid_m = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)
    model = DepositionModel()
    path = passes([0.2, 0.6, 1.0, 1.4, 1.8])
    film = painted_by(model, path, grid_m, noise_um=0.0, repeats=1).readings.thickness_um
    thick = model.model_copy(
        update={
            'planar': model.planar.model_copy(
                update={'K1_cm3_per_s': model.planar.K1_cm3_per_s * 80.0 / film.mean()}
            )
        }
    )
    even = painted_by(thick, path, grid_m, noise_um=0.0, repeats=1)
    readings = even.readings.thickness_um + 0.5 * np.random.default_rng(8).normal(size=x.size)
    stated = Readings.of(grid_m, readings, sigma_um=np.full(x.size, 0.5))
    experiment = Experiment.of(even.name, even.surface, even.path, stated)
    found = diagnose(Campaign((experiment,)), thick, {'air_drift': AirDrift})
    assert found.verdict == 'none_missing'
    texture = found.study.texture
    assert texture.source == 'neighbours'
    assert texture.share < 0.004
    assert found.to_dict()['noise']['texture_share'] == texture.share
    assert found.notes == (str(texture),)


def test_an_assumed_noise_leaves_the_texture_assumed():
    experiment = painted_by(DepositionModel(), passes([0.55, 1.35]), grid(), repeats=1)
    study, _ = sifted(Campaign((experiment,)), DepositionModel(), starts=1)
    assert (study.texture.share, study.texture.source) == (0.01, 'assumed')


def grid() -> np.ndarray:
    x, z = np.meshgrid(np.linspace(-0.35, 0.35, 5), np.linspace(0.1, 1.9, 14))
    return np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)
