"""Levels of parts and zeros of gauge sessions, found back where they were put in."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from inference.diagnosis.linear import fit_linear
from inference.fitting.panels import grid_m, painted_by, passes
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.fitting.random_effects import (
    LEVEL_SHARE,
    OTHER_LEVEL_SHARE,
    SESSION_UM,
    amounts,
    random_effects,
)
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.model.eq1_pattern import PATTERN


def part(name: str, session: str | np.ndarray = '') -> Experiment:
    """Read from the middle of the pass to where hardly any paint arrives."""
    places = grid_m(4, 10, 1.0, 1.5)
    one = painted_by(pd.DepositionModel(), passes([1.0]), places, name=name)
    return one.with_readings(
        replace(one.readings, session=np.broadcast_to(session, len(one.readings)))
    )


def study_of(*parts: Experiment) -> Study:
    return Study.of(pd.Campaign(parts))


def estimated(study: Study, change_um: np.ndarray) -> dict:
    """Amounts of the random effects where the readings deviate so from what is known for sure."""
    nothing = np.zeros((len(study), len(PATTERN)))
    fit = fit_linear(nothing, change_um / study.sigma_um)
    fit = replace(fit, nuisance=study.nuisance)
    return {(a.kind, a.of): a for a in amounts(fit, study.random_effects)}


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
    assert study.residuals((1.0 - 0.03 * sign) * film_um).rmse_um < 0.006 * np.sqrt(
        np.mean(film_um**2)
    )
    assert study.residuals(0.97 * film_um).residual_um == pytest.approx(0.03 * film_um)


def test_sessions_run_across_parts_and_those_without_a_name_are_their_own():
    study = study_of(part('left', 'Monday'), part('right', 'Monday'), part('roof'))
    level, zero = study.random_effects
    assert level.names == ('left', 'right', 'roof')
    assert zero.names == ('Monday', 'roof')
    assert study.nuisance.shape == (len(study), 5)


def test_a_part_without_voltage_has_a_level_of_its_own():
    study = study_of(part('usual'), replace(part('off'), switched_off=frozenset(['voltage'])))
    level, _ = study.random_effects
    first, other = level.columns.T
    assert not first.any()  # there is no other part that it could differ from
    rows = study.campaign.experiment_of == 1
    share = OTHER_LEVEL_SHARE * study.measured_um / study.sigma_um
    np.testing.assert_allclose(other, np.where(rows, share, 0.0))
    double = study.residuals(study.measured_um * np.where(rows, 2.0, 1.0))
    np.testing.assert_allclose(double.predicted_um, study.measured_um, rtol=0.02)
    assert study.has(EFFECTS['edge_build']).tolist() == (~rows).tolist()
    assert study.has(EFFECTS['sag']).all()


def test_a_part_left_out_has_no_level_and_the_others_differ_among_themselves():
    study = study_of(part('left'), part('roof'), part('right'))
    owner = study.campaign.experiment_of
    level, zero = random_effects(study.campaign, study.measured_um, study.sigma_um, owner != 1)
    others = np.array([[0.5, 0.0, -0.5], [0.0, 0.0, 0.0], [-0.5, 0.0, 0.5]])
    assert level.mixing == pytest.approx(100.0 * LEVEL_SHARE * others)
    assert not level.columns[owner == 1].any()
    # Its readings without a name of their session were taken in one of their own.
    assert zero.mixing == pytest.approx(SESSION_UM * others)
    # One that is left has nothing that it could differ from.
    assert random_effects(study.campaign, study.measured_um, study.sigma_um, owner == 0) == ()


def test_two_sessions_on_one_part_differ_by_their_zero():
    evening = np.arange(40) % 2 == 0
    study = study_of(part('door', np.tile(np.where(evening, 'evening', 'noon'), 2)))
    (zero,) = study.random_effects
    assert zero.kind == 'gauge zero'
    found = estimated(study, np.where(evening, 0.5, -0.5))
    assert found['gauge zero', 'evening'].value == pytest.approx(0.5, abs=0.1)
    assert found['gauge zero', 'noon'].is_notable
