"""Levels of parts and zeros of gauge sessions, and what is predicted of a part left out."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import paint_deposition as pd
from inference.diagnosis.linear import fit_linear
from inference.diagnosis.readings_on_door import study_of
from inference.fitting.panels import gauged, grid_m, painted_by, passes, reading
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.diagnosis.verdict import Step
from paint_deposition.inference.fitting import random_effects as effects
from paint_deposition.inference.fitting.cleaning import clean_and_fit
from paint_deposition.inference.fitting.random_effects import LEVEL_SHARE, SESSION_UM, amounts
from paint_deposition.inference.readings.readings import root_mean_square
from paint_deposition.model.eq1_pattern import PATTERN


def part(name: str, session: str | np.ndarray = ''):
    """Read from the middle of the pass to where hardly any paint arrives."""
    places = grid_m(4, 10, 1.0, 1.5)
    one = painted_by(pd.DepositionModel(), passes([1.0]), places, name=name)
    sessions = np.broadcast_to(session, len(one.readings))
    return one.with_readings(replace(one.readings, session=sessions))


def estimated(study, change_um: np.ndarray) -> dict:
    """Amounts of the random effects where the readings deviate so from what is known for sure."""
    nothing = np.zeros((len(study), len(PATTERN)))
    fit = fit_linear(nothing, change_um / study.sigma_um)
    fit = replace(fit, nuisance=study.nuisance)
    return {(a.kind, a.of): a for a in amounts(*fit.amplitudes, study.random_effects)}


def test_a_level_and_a_zero_come_back_with_their_uncertainty():
    study = study_of(part('left'), part('right'))
    left = study.campaign.experiment_of == 0
    sign = np.where(left, 1.0, -1.0)
    found = estimated(study, sign * (0.03 * study.measured_um + 0.4))
    level, zero = found['part level', 'left'], found['gauge zero', 'right']
    assert level.unit == '%'
    assert level.value == pytest.approx(3.0, abs=2.0 * level.sd)
    assert zero.value == pytest.approx(-0.4, abs=2.0 * zero.sd)
    assert level.is_notable
    assert found['part level', 'right'].value == pytest.approx(-level.value)
    # The prior narrows both: half the difference between two draws.
    assert 0.0 < level.sd < 100.0 * LEVEL_SHARE / np.sqrt(2.0)
    assert 0.0 < zero.sd < SESSION_UM / np.sqrt(2.0)
    assert f'{level}'.startswith(f'part level of left: +{level.value:.2f} ± ')
    # The one residual is beside these levels; what all parts have in common is the model's.
    film_um = study.measured_um
    left = study.residuals((1.0 - 0.03 * sign) * film_um)
    assert left.rmse_um < 0.006 * root_mean_square(film_um)
    assert study.residuals(0.97 * film_um).residual_um == pytest.approx(0.03 * film_um)


def test_sessions_run_across_parts_and_two_on_one_part_differ_by_their_zero():
    study = study_of(part('left', 'Monday'), part('right', 'Monday'), part('roof'))
    level, zero = study.random_effects
    assert level.names == ('left', 'right', 'roof')
    assert zero.names == ('Monday', 'roof')
    assert study.nuisance.shape == (len(study), 5)
    evening = np.arange(40) % 2 == 0
    study = study_of(part('door', np.tile(np.where(evening, 'evening', 'noon'), 2)))
    (zero,) = study.random_effects
    assert zero.kind == 'gauge zero'
    found = estimated(study, np.where(evening, 0.5, -0.5))
    assert found['gauge zero', 'evening'].value == pytest.approx(0.5, abs=0.1)
    assert found['gauge zero', 'noon'].is_notable


def test_a_part_without_voltage_has_a_level_of_its_own():
    study = study_of(part('usual'), replace(part('off'), switched_off=frozenset(['voltage'])))
    level, _ = study.random_effects
    first, other = level.columns.T
    assert not first.any()  # there is no other part that it could differ from
    rows = study.campaign.experiment_of == 1
    share = effects.OTHER_LEVEL_SHARE * study.measured_um / study.sigma_um
    np.testing.assert_allclose(other, np.where(rows, share, 0.0))
    double = study.residuals(study.measured_um * np.where(rows, 2.0, 1.0))
    np.testing.assert_allclose(double.predicted_um, study.measured_um, rtol=0.02)
    assert study.has('voltage').tolist() == (~rows).tolist()
    assert study.has('').all()


def test_a_part_left_out_has_no_level_and_the_others_differ_among_themselves():
    study = study_of(part('left'), part('roof'), part('right'))
    owner = study.campaign.experiment_of
    known = study.campaign, study.measured_um, study.sigma_um
    level, zero = effects.random_effects(*known, owner != 1)
    others = np.array([[0.5, 0.0, -0.5], [0.0, 0.0, 0.0], [-0.5, 0.0, 0.5]])
    assert level.mixing == pytest.approx(100.0 * LEVEL_SHARE * others)
    assert not level.columns[owner == 1].any()
    # Its readings without a name of their session were taken in one of their own.
    assert zero.mixing == pytest.approx(SESSION_UM * others)
    assert effects.random_effects(*known, owner == 0) == ()


BASE = pd.DepositionModel()
# Heights of the passes on each panel [m], and how much more paint it got than the model says.
PASSES_M = ((0.3, 1.1, 0.7, 1.5), (1.6, 0.6, 1.1), (0.2, 1.0, 1.8))
LEVELS = (1.03, 0.97, 1.04)
MISSING = BASE.with_effect(EFFECTS['edge_build'](gain=1.0, length_m=0.08))


def levelled(truth: pd.DepositionModel) -> pd.Campaign:
    """Panels, each with passes of its own and more or less paint than the others."""
    panels = gauged(truth, seed=4, orders=PASSES_M).experiments
    return pd.Campaign(tuple(
        reading(panel, level * panel.readings.thickness_um)
        for panel, level in zip(panels, LEVELS, strict=True)
    ))  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize('truth', [BASE, MISSING], ids=['clean', 'an effect missing'])
def test_the_error_on_a_part_left_out_is_that_of_a_model_that_never_saw_it(truth):
    """Also where the model misses much: then the fit without a part is far from that with it."""
    campaign = levelled(truth)
    study, fit = clean_and_fit(campaign, BASE, starts=6)
    owner = study.campaign.experiment_of
    found_um, anew_um = [], []
    for number, part in enumerate(campaign.experiments):
        out = owner == number
        left_um = (study.measured_um - study.predicted_without_um(fit, out))[out]
        others = pd.Campaign(tuple(one for one in campaign.experiments if one is not part))
        model = pd.refit(others, None, BASE).model
        other_um = pd.compare(pd.Campaign((part,)), model).points.residual_um
        assert root_mean_square(left_um) == pytest.approx(root_mean_square(other_um), rel=0.03)
        found_um.append(left_um)
        anew_um.append(other_um)
    step = Step.of(study, '', fit)
    assert np.array_equal(study.folds(), owner)
    found, anew = (root_mean_square(np.concatenate(each)) for each in (found_um, anew_um))
    assert step.holdout_rmse_um == pytest.approx(found)
    assert step.holdout_rmse_um == pytest.approx(anew, rel=0.02)
    assert step.holdout_rmse_um > step.rmse_um
    # Points left out here and there have the level that the rest of their part tells.
    if truth is BASE:
        without = partial(study.predicted_without_um, fit)
        squares_um2 = study.squares_left_out_um2(without, study.scattered())
        assert np.sqrt(np.mean(squares_um2)) < 1.25 * study.noise_floor_um


@pytest.mark.slow
def test_a_level_that_no_other_part_tells_is_no_error_on_a_part_left_out():
    first, second, last = levelled(BASE).experiments
    quarter_less = reading(last, 0.75 * last.readings.thickness_um)
    off = replace(quarter_less, switched_off=frozenset(['voltage']))
    study, fit = clean_and_fit(pd.Campaign((first, second, off)), BASE, starts=6)
    model = pd.refit(pd.Campaign((first, second)), None, BASE).model
    anew = pd.compare(pd.Campaign((off,)), model).points.rmse_um
    found = study.errors_left_out_um(lambda out: study.predicted_without_um(fit, out))
    owner = study.campaign.experiment_of
    usual = owner != 2
    without = study.predicted_without_um
    others = [(study.measured_um - without(fit, owner == k))[owner == k] for k in (0, 1)]
    squares = np.sum(usual) * root_mean_square(np.concatenate(others)) ** 2
    expected = np.sqrt((squares + np.sum(~usual) * anew**2) / len(study))
    assert found == pytest.approx(expected, rel=0.03)
    assert anew < 0.1 * np.mean(study.measured_um[~usual])
    # What acts with the voltage only is not known without the one part that had it.
    assert study.leaves_out_parts
    assert not study_of(first, off).leaves_out_parts
    # Nor where all that had it are left out together, as the first and the seventh part are.
    others = (replace(off, name=str(number)) for number in range(5))
    assert not study_of(first, *others, second).leaves_out_parts


def test_readings_left_out_have_no_part_in_what_is_predicted_and_a_fitted_direction_has():
    """However wrong they are: neither by themselves nor by the level of their part."""
    study, fit = clean_and_fit(levelled(MISSING), BASE)
    out = study.campaign.experiment_of == 1
    first, part, last = study.campaign.experiments
    wrong = reading(part, part.readings.thickness_um + 100.0)
    other = replace(study, campaign=pd.Campaign((first, wrong, last)))
    assert (other.measured_um[out] > study.measured_um[out] + 99.0).all()
    before, after = (one.predicted_without_um(fit, out) for one in (study, other))
    assert after == pytest.approx(before, rel=1e-4, abs=1e-3)
    # What is learned beside the model from the other parts is predicted on the last.
    out = study.campaign.experiment_of == 2
    predict = study.forward.predict_um
    edge_um = predict(fit.model.with_effect(MISSING.effects[0])) - predict(fit.model)
    free = (edge_um / study.sigma_um)[:, np.newaxis]
    without_it, with_it = (
        root_mean_square((study.measured_um - study.predicted_without_um(fit, out, each))[out])
        for each in (None, free)
    )
    assert with_it < 0.6 * without_it
