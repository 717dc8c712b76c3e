"""Profiles along columns of readings."""

from dataclasses import replace

import numpy as np
import pytest

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.inference.comparison.profiles import profiles_of
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment
from small_campaign import small_campaign

pytestmark = pytest.mark.slow

DRIFTING = DepositionModel(effects=(AirDrift(shift_down_m=0.02),))


@pytest.fixture(scope='module')
def study(tmp_path_factory):
    return Study.of(small_campaign(tmp_path_factory.mktemp('campaign')))


@pytest.fixture(scope='module')
def profiles(study):
    return profiles_of(study, [DepositionModel(), DRIFTING])


def test_every_reading_is_on_one_profile_of_its_own_experiment(study, profiles):
    rows = np.concatenate([p.rows for p in profiles])
    assert np.array_equal(np.sort(rows), np.arange(len(study)))
    for profile in profiles:
        campaign = study.campaign
        names = {campaign.experiments[k].name for k in campaign.experiment_of[profile.rows]}
        assert names == {profile.experiment}


def test_lines_pass_through_what_is_predicted_at_the_readings(study, profiles):
    for k, model in enumerate((DepositionModel(), DRIFTING)):
        predicted = study.forward.predict_um(model)
        for profile in profiles:
            here = np.searchsorted(profile.line_m, profile.position_m)
            line = profile.lines_um[k][here]
            assert line == pytest.approx(predicted[profile.rows], rel=1e-6, abs=1e-6)


def test_single_passes_add_up_to_the_film(profiles):
    for profile in profiles:
        assert len(profile.passes_um) > 1
        assert profile.passes_um.sum(axis=0) == pytest.approx(profile.lines_um[1], rel=1e-6)


def test_readings_without_rows_or_columns_fall_into_strips_with_a_line(tmp_path):
    """On a flat panel the passes leave the same film all along: at the middle of a strip, too."""
    study = Study.of(small_campaign(tmp_path, experiments=('panel',), style='random'))
    assert not any(study.campaign.readings.group)
    profiles = profiles_of(study, [DepositionModel()])
    rows = np.concatenate([p.rows for p in profiles])
    assert np.array_equal(np.sort(rows), np.arange(len(study)))
    predicted = study.forward.predict_um(DepositionModel())
    for profile in profiles:
        assert np.all(np.diff(profile.position_m) >= 0.0)
        assert len(profile.line_m) > len(profile.rows)
        middle = profile.lines_um[0][np.searchsorted(profile.line_m, profile.position_m)]
        assert middle == pytest.approx(predicted[profile.rows], rel=0.03)


def test_readings_whose_groups_are_lost_have_the_same_profiles(tmp_path):
    named = Study.of(small_campaign(tmp_path, experiments=('panel',)))
    (panel,) = named.campaign.experiments
    lost = replace(panel.readings, group=np.full(len(panel.readings), ''))
    again = Experiment.of(panel.name, panel.surface, panel.path, lost)
    found = Study.of(replace(named.campaign, experiments=(again,)))
    before, after = (
        {tuple(p.rows): p.lines_um for p in profiles_of(study, [DepositionModel()])}
        for study in (named, found)
    )
    assert before.keys() == after.keys()
    for rows, lines_um in before.items():
        assert after[rows] == pytest.approx(lines_um)
