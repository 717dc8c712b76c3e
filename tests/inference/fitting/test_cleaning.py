"""Outliers are found, texture and facets are estimated, scans are condensed."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from booth import MODEL as SMALL
from booth import painted, path_of, serpentine
from inference.fitting.panels import ORDERS, column, grid_m, painted_by, passes, reading
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.diagnosis.procedure import diagnose
from paint_deposition.inference.diagnosis.state import trouble_with
from paint_deposition.inference.fitting import cleaning, outliers
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.outliers import FittedPoints, find_outliers
from paint_deposition.inference.fitting.random_effects import amounts
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.report.words import count_words
from small_campaign import small_campaign
from surfaces import refined

FILM_UM, GAUGE_UM = 30.0, 0.7
COUNT = 96
MODEL = pd.DepositionModel()


def scattered(seed: int, texture: float = 0.005) -> FittedPoints:
    """Readings over a sheet, a share of them at its edge, beside a model of one free level."""
    random = np.random.default_rng(seed)
    positions = np.column_stack([random.uniform(0.0, 1.0, (COUNT, 2)), np.zeros(COUNT)])
    edge_m = np.minimum(np.min(np.minimum(positions[:, :2], 1.0 - positions[:, :2]), axis=1), 0.1)
    noise = GAUGE_UM * random.normal(size=COUNT)
    noise = noise + texture * FILM_UM * random.normal(size=COUNT)
    along = {'edge_distance_m': edge_m, 'height_m': positions[:, 1], 'across_m': positions[:, 0]}
    film = np.full(COUNT, FILM_UM)
    return FittedPoints(
        noise, film, np.full(COUNT, GAUGE_UM), film[:, np.newaxis], np.zeros(COUNT, dtype=int),
        positions, along,
    )  # fmt: skip


def built_up(misfit: FittedPoints) -> FittedPoints:
    """The same with half as much film again at the edge, falling off within 20 mm."""
    distance_m = misfit.covariates['edge_distance_m']
    more = 0.5 * FILM_UM * np.exp(-distance_m / 0.02)
    return replace(misfit, residual_um=misfit.residual_um + more)


def slipped(misfit: FittedPoints, row: int, by_um: float) -> FittedPoints:
    residual = misfit.residual_um.copy()
    residual[row] += by_um
    return replace(misfit, residual_um=residual)


EVERY = np.ones(COUNT, dtype=bool)


@pytest.mark.slow
@pytest.mark.parametrize('missing', [lambda misfit: misfit, built_up])
def test_sound_readings_are_kept_whatever_is_missing(missing):
    """Of 768 readings at most one: an outlier is one that has no like."""
    removed = sum(len(find_outliers(missing(scattered(seed)), EVERY)) for seed in range(8))
    assert removed <= 1


@pytest.mark.parametrize('missing', [lambda misfit: misfit, built_up])
@pytest.mark.parametrize('by_um', [9.0 * FILM_UM, -0.9 * FILM_UM, 12.0 * GAUGE_UM])
def test_a_slip_is_found_whatever_is_missing(missing, by_um):
    misfit = missing(scattered(0))
    row = int(np.argmax(misfit.covariates['edge_distance_m']))  # well inside the sheet
    assert list(find_outliers(slipped(misfit, row, by_um), EVERY)) == [row]


def test_slips_do_not_hide_each_other_and_many_and_those_read_again_are_none():
    """Where a tenth of all readings is off, the model is at fault and not the pen."""
    for rows, found in (((3, 30, 60), {3, 30, 60}), (range(0, 96, 10), set())):
        misfit = scattered(1)
        for row in rows:
            misfit = slipped(misfit, row, 9.0 * FILM_UM)
        assert set(find_outliers(misfit, EVERY)) == found
    again = np.arange(COUNT) != 5
    assert find_outliers(slipped(scattered(2), 5, 9.0 * FILM_UM), again) == {}


@pytest.mark.parametrize(('rows', 'slips'), [([0], 1), ([0, 1, 2], 0), ([0, 40], 2)])
def test_neighbours_that_are_off_the_same_way_are_no_slips(rows, slips):
    """As on a stripe. Numbers count from one point outward."""
    misfit = scattered(2)
    away_m = np.linalg.norm(misfit.positions_m - misfit.positions_m[40], axis=1)
    for row in np.argsort(away_m)[rows]:
        misfit = slipped(misfit, row, -0.3 * FILM_UM)
    assert len(find_outliers(misfit, EVERY)) == slips


def test_a_prediction_without_the_reading_is_that_of_the_others_alone():
    """The closed form against a mixture that has never seen the reading."""
    # Without covariates, whose scale would be that of the readings.
    misfit, row = replace(built_up(scattered(4)), covariates={}), 17
    others = np.delete(np.arange(COUNT), row)
    joint = misfit.log_likelihood - misfit.select(others).log_likelihood
    normal = -0.5 * np.log(2.0 * np.pi)
    # The smallest directions of a field, which are left out, are not quite those of all.
    assert misfit.log_density[row] == pytest.approx(joint + normal, abs=0.01)


@pytest.mark.parametrize(
    ('written', 'expected', 'guess'),
    [(312.0, 30.4, 31.2), (3.12, 30.4, 31.2), (13.2, 30.9, 31.2), (0.2, 30.4, None)],
)
def test_what_was_probably_meant(written, expected, guess):
    outlier = outliers.Outlier('door: P7', written, expected, 0.9)
    assert outlier.guess_um == (None if guess is None else pytest.approx(guess))
    assert f"point 'door: P7': {written:.4g} µm" in str(outlier)
    assert ('?' in str(outlier)) == (guess is not None)


@pytest.mark.slow
@pytest.mark.parametrize('texture', [0.002, 0.02])
def test_the_texture_is_estimated_beside_a_missing_effect(texture):
    misfits = [built_up(scattered(seed, texture)) for seed in range(12)]
    shares = [misfit.texture_share for misfit in misfits]
    assert np.mean(shares) == pytest.approx(texture, abs=0.006)


@pytest.mark.slow
def test_a_typing_error_does_not_change_the_verdict(tmp_path):
    """A door with edge build, 97 readings, of which one is ten times too large."""
    (door,) = small_campaign(
        tmp_path, seed=5, truth='edge_build', amplitude=0.5, experiments=('door',),
        readings=97, repeats=20, style='random', parcels=2_000_000,
    ).experiments  # fmt: skip
    row = int(np.flatnonzero(door.readings.repeats[door.readings.owner] == 1)[10])
    factor = np.where(np.arange(len(door.readings)) == row, 10.0, 1.0)
    bad = pd.Campaign((reading(door, factor * door.readings.thickness_um),))
    library = {name: EFFECTS[name] for name in ('air_drift', 'edge_build', 'faraday_shielding')}
    found = diagnose(bad, pd.DepositionModel(), library)
    assert found.verdict == 'effect_missing'
    assert found.accepted == ('edge_build',)
    (outlier,) = found.to_dict()['left_out']
    assert outlier['thickness_um'] == bad.readings.thickness_um[row]
    assert outlier['guess_um'] == pytest.approx(0.1 * outlier['thickness_um'])
    left_out = [note for note in found.notes if "point 'door: " in note]
    assert ['left out of the fit' in note for note in left_out] == [True]
    study, _ = cleaning.clean_and_fit(bad, pd.DepositionModel(), sound=[outlier['point']])
    assert study.outliers == ()
    compared = pd.compare(bad, found.history[0].model)
    assert [one.point for one in compared.study.outliers] == [str(bad.readings.point[row])]


def test_a_thick_film_without_texture_is_no_broken_fit():
    """A gauge of 0.5 µm on 80 µm of even film: the usual texture alone would be 0.8 µm."""
    at, path = grid_m(8, 24), passes([0.2, 0.6, 1.0, 1.4, 1.8])
    even = painted_by(MODEL, path, at, noise_um=0.0, repeats=1)
    film = even.readings.thickness_um * 80.0 / even.readings.thickness_um.mean()
    readings = film + 0.5 * np.random.default_rng(8).normal(size=len(film))
    stated = pd.Readings.of(at, readings, sigma_um=np.full(len(film), 0.5))
    campaign = pd.Campaign((even.with_readings(stated),))
    study, fit = cleaning.clean_and_fit(campaign, MODEL, starts=1)
    assert trouble_with(study, fit) == ''
    assert study.estimated_texture < 0.004
    assert study.noise_figures['texture_source'] == 'neighbours'
    (note,) = study.notes
    assert note.startswith("The film's own texture is 0.")
    # An assumed noise leaves the texture assumed.
    experiment = painted_by(MODEL, passes([0.55, 1.35]), grid_m(), repeats=1)
    study, _ = cleaning.clean_and_fit(pd.Campaign((experiment,)), MODEL, starts=1)
    assert study.texture_share == 0.01
    assert study.noise_figures['texture_source'] == 'assumed'


NOISE_UM, SCANNED = 0.4, 6000


def test_the_mean_of_a_cell_is_its_film_and_readings_by_hand_beside_a_scan_are_kept():
    """A panel is read at random places, denser than any cell."""
    places = np.random.default_rng(5).uniform((-0.35, 0.05), (0.35, 1.95), (SCANNED, 2))
    points_m = np.column_stack([places[:, 0], np.zeros(SCANNED), places[:, 1]])
    motion, noise = passes(ORDERS[0], samples=80), {'noise_um': NOISE_UM, 'repeats': 1}
    scan = pd.Campaign((painted_by(MODEL, motion, points_m, **noise),))
    # Off by a tenth of the film, as a rough fit may be.
    planar = MODEL.planar.model_copy(update={'K1_cm3_per_s': 1.1 * MODEL.planar.K1_cm3_per_s})
    cells = cleaning.condensed(scan, MODEL.model_copy(update={'planar': planar}))
    assert 0.8 * cleaning.CELLS < len(cells) <= cleaning.CELLS
    sigma_um = cells.readings.sigma_um
    expected_um = NOISE_UM / np.sqrt(SCANNED / len(cells))
    assert np.median(sigma_um) == pytest.approx(expected_um, rel=0.1)
    off_um = cells.readings.mean_um - Forward(cells, ()).predict_um(MODEL)
    # Chi-square of that many cells: within five of its standard deviations.
    five_sd = 5.0 * np.sqrt(2.0 / len(cells))
    assert np.mean((off_um / sigma_um) ** 2) == pytest.approx(1.0, abs=five_sd)
    motion = passes(ORDERS[1], samples=80)
    hand = painted_by(MODEL, motion, column(), name='by hand', noise_um=NOISE_UM)
    study = pd.compare(pd.Campaign((*scan.experiments, hand)), MODEL).study
    kept = study.campaign.experiments[1].readings
    assert np.array_equal(kept.thickness_um, hand.readings.thickness_um)
    read = SCANNED + len(hand.readings)
    told = f'{read} readings were condensed to the means of {len(study)} cells'
    assert any(note.startswith(told) for note in study.notes)
    assert count_words(study) == f'{read} readings in {len(study)} cells on panel and by hand'


@pytest.mark.parametrize(
    ('points', 'cells'),
    [((6000,), [300]), ((6000, 40), [260, 40]), ((9000, 20, 500), [140, 20, 140]),
     ([60] * 12, [25] * 12), ([2] * 400, [1] * 400)],
)  # fmt: skip
def test_parts_share_the_cells_evenly(points, cells):
    assert cleaning.cells_by_part(points) == cells


RADIUS_M, HALF_M, COARSE_M, FINE_M = 0.15, 0.1, 0.05, 0.004
PATH = path_of(serpentine((0.06, -0.04), opens_at_m=0.3, period_s=0.05))


def fold(edge_m: float) -> pd.Surface:
    """Flat below, part of a pipe above."""

    def depth(x, z):
        return RADIUS_M - np.sqrt(RADIUS_M**2 - np.maximum(z, 0.0) ** 2)

    return refined(depth, edge_m, 0.008, half_width_m=HALF_M, jitter=0.2)


def measured(edge_m: float, sigma_um: float = 0.1, count: int = 120, seed: int = 3) -> Experiment:
    """Readings on the fine part, set beside one with edges of this length."""
    fine = fold(FINE_M)
    film_um = painted(fine, PATH).raw_um
    rng = np.random.default_rng(seed)
    at = rng.choice(np.flatnonzero(film_um > 1.0), count, replace=False)
    noisy_um = film_um[at] + sigma_um * rng.normal(size=count)
    readings = pd.Readings.of(
        fine.vertices_m[at], noisy_um, normals=fine.normals[at],
        sigma_um=np.full(count, sigma_um),
    )  # fmt: skip
    return Experiment.of('fold', fold(edge_m), PATH, readings)


def study(edge_m: float):
    return cleaning.clean_and_fit(pd.Campaign((measured(edge_m),)), SMALL)[0]


def test_facets_of_a_coarse_mesh_are_noise_which_points_keep_and_a_fine_one_has_none():
    coarse = study(COARSE_M)
    assert any('The mesh of fold is coarser' in note for note in coarse.notes)
    assert coarse.nuisance.shape == (len(coarse), 0)
    without = replace(coarse, facet_um=None)
    assert coarse.sigma_um == pytest.approx(np.hypot(without.sigma_um, coarse.facet_um))
    kept = np.arange(len(coarse)) % 3 > 0
    some = coarse.of_points(kept)
    np.testing.assert_array_equal(some.facet_um, coarse.facet_um[kept])
    np.testing.assert_array_equal(some.sigma_um, coarse.sigma_um[kept])
    fine = study(FINE_M)
    assert fine.facet_um is None
    assert not any('coarser' in note for note in fine.notes)
    # The model is the true one: what is left of the readings is noise and facets.
    left_um = coarse.measured_um - coarse.forward.predict_um(SMALL)
    amount = left_um @ coarse.facet_um / (coarse.facet_um @ coarse.facet_um)
    assert 0.5 < amount < 1.5
    assert np.var(left_um - amount * coarse.facet_um) < 0.7 * np.var(left_um)


def test_levels_of_parts_are_told_beside_their_facets():
    """Two parts 3 % off either way, on a mesh whose facets cost more than the gauge's noise."""
    parts = []
    for seed, (name, level) in enumerate((('thick', 1.03), ('thin', 0.97))):
        part = replace(measured(COARSE_M, seed=seed), name=name)
        parts.append(reading(part, level * part.readings.thickness_um))
    found, fit = cleaning.clean_and_fit(pd.Campaign(tuple(parts)), SMALL)
    assert np.abs(found.facet_um).max() > 3.0 * found.gauge_um.max()
    by_name = {(a.kind, a.of): a for a in amounts(*fit.amplitudes, found.random_effects)}
    for name, level in (('thick', 3.0), ('thin', -3.0)):
        amount = by_name['part level', name]
        assert amount.value == pytest.approx(level, abs=3.0 * amount.sd)
        assert amount.sd < 0.7
        assert amount.is_notable
