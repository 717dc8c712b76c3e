"""An effect that is asked for, and effects in parts that two brushes painted."""

import numpy as np
import pytest

import paint_deposition as pd
from inference.diagnosis.readings_on_door import SHIELDED
from inference.fitting.panels import ORDERS, gauged
from paint_deposition.effects.catalogue import EFFECTS, LEARNED
from paint_deposition.errors import ModelError
from paint_deposition.files.model_file import read_model_file
from paint_deposition.inference.diagnosis.model_space import SURE
from paint_deposition.inference.diagnosis.refit import refit
from paint_deposition.inference.fitting.estimates import estimates
from paint_deposition.report.write_inference import write_fitted
from small_campaign import small_campaign
from virtual_paint_shop.files import write
from virtual_paint_shop.shop import generate

pytestmark = pytest.mark.slow


BASE = pd.DepositionModel()
SHIELDING, DRIFT = EFFECTS['faraday_shielding'], EFFECTS['air_drift']


def test_refit_adds_what_was_asked_for_and_weighs_it(tmp_path):
    """To the model of a door with a shielded valley."""
    shielded = small_campaign(tmp_path, **SHIELDED)
    refitted = refit(shielded, BASE, SHIELDING)
    assert refitted.accepted == ('faraday_shielding',)
    assert refitted.classes[0].probability > 0.9
    assert refitted.history[1].holdout_rmse_um < 0.7 * refitted.history[0].holdout_rmse_um
    after = refit(shielded, refitted.model, DRIFT)
    assert [effect.id for effect in after.model.effects] == ['faraday_shielding', 'air_drift']
    # What does not act is not sure, and predicts no better.
    assert after.verdict == 'none_missing'
    assert after.classes[0].probability < SURE
    assert after.history[1].holdout_rmse_um > 0.98 * after.history[0].holdout_rmse_um
    with pytest.raises(ModelError, match='faraday_shielding is in the model already'):
        refit(shielded, refitted.model, SHIELDING)
    # With nothing added the model is kept and tested.
    assert refit(shielded, refitted.model, None).verdict == 'none_missing'
    assert refit(shielded, BASE, None).verdict == 'unknown_effect'


HIDDEN = LEARNED['time_s'](low=0.0, high=70.0, learned=(-0.15, 0.0, 0.08, 0.12, 0.13))


def test_a_law_is_learned_with_its_band_and_its_file_reads_back(tmp_path):
    """On panels painted with a flow that rises and levels off."""
    campaign = gauged(pd.DepositionModel(effects=(HIDDEN,)), seed=3, orders=ORDERS)
    done = refit(campaign, BASE, LEARNED['time_s'])
    assert done.verdict == 'unknown_effect'
    assert done.accepted == ('learned:time_s',)
    (found,) = done.classes
    assert found.members == ('learned:time_s',)
    assert found.probability > 0.95
    assert found.parameters == {}
    assert 'over the time since the motion began' in done.reason
    assert done.unknown is not None
    before, after = done.history
    assert after.rmse_um < 0.8 * before.rmse_um
    assert after.rmse_um < after.holdout_rmse_um < 0.9 * before.holdout_rmse_um
    law = done.model.effect('learned:time_s')
    times = np.linspace(law.low, law.high, 50)
    sd = law.deviation(times)
    away = law.factor(times) - HIDDEN.factor(times)
    away -= np.average(away, weights=sd**-2)
    assert np.mean(np.abs(away) < 1.96 * sd) > 0.9
    assert 1.96 * np.median(sd) < 0.25 * np.ptp(HIDDEN.factor(times))
    # The model that is written reads back.
    known = done.posterior, estimates(done.history[-1].fit)
    write_fitted(tmp_path / 'model.yaml', done.study, done.history, *known)
    file = read_model_file(tmp_path / 'model.yaml')
    law, read = done.model.effects[0], file.model.effects[0]
    np.testing.assert_allclose(read.learned, law.learned, rtol=1e-7)
    np.testing.assert_allclose(read.sd, law.sd, rtol=6e-3)
    assert [step['added'] for step in file.history] == ['pattern', 'learned:time_s']
    panel = pd.Campaign(campaign.experiments[:1])
    with pytest.raises(ModelError, match='sky_view_factor is the same at all readings'):
        refit(panel, BASE, LEARNED['sky_view_factor'])


def painted(folder, truth, part):
    """A campaign whose passes take brush 1 and the narrower brush 2 in turn, and its truth."""
    options = {'readings': 90, 'repeats': 24, 'second_brush': 0.75, 'parcels': 2_000_000}
    made = generate(5, truth, experiments=(part,), **options)
    return pd.read_campaign(write(made, folder)), made.truth


def test_the_hidden_effect_is_named_and_the_error_falls(tmp_path, undrawn):
    """A door with more paint along its edges; nothing but the recording names the brushes."""
    campaign, truth = painted(tmp_path / 'door', 'edge_build', 'door')
    found = pd.diagnose(campaign)
    assert found.verdict == 'effect_missing'
    assert found.accepted == ('edge_build',)
    gain = found.classes[0].parameters['gain']
    assert gain.low <= truth['hidden'][0]['amplitude'] <= gain.high
    error = found.to_dict()['rmse_um']
    assert error['holdout_after'] < 0.97 * error['holdout_before']
    assert error['after'] < error['noise_floor'] < error['before']
    pd.write(found, tmp_path / 'd')
    model = pd.read_model(tmp_path / 'd/model.yaml')
    assert [brush.number for brush in model.brushes] == [1, 2]
    assert [effect.id for effect in model.effects] == ['edge_build']
    wide, narrow = (brush.planar.r_m + brush.planar.sigma1_m for brush in model.brushes)
    assert narrow < 0.9 * wide
    assert 'brush 2: ' in (tmp_path / 'd/report.html').read_text()


def test_brushes_calibrated_before_name_nothing_in_a_job_without_an_effect(tmp_path):
    """The calibration's readings are the prior of the job's; its other brush moves along."""
    panel, _ = painted(tmp_path / 'panel', None, 'panel')
    door, truth = painted(tmp_path / 'door', None, 'door')
    known = pd.calibrate(panel)
    assert 'brush_2.log_K1' in known.posterior.names
    found = pd.diagnose(door, known.model, posterior=known.posterior)
    assert found.verdict == 'none_missing'
    assert found.accepted == ()
    shift = found.pattern_shift
    assert shift.distance < shift.usual
    assert len(shift.by_coordinate) == 13
    by_name = {value.name: value for value in estimates(found.history[-1].fit)}
    for number, true in truth['brushes'].items():
        level = by_name[f'brush_{number}.K1_cm3_per_s']
        assert abs(level.value - true['K1_cm3_per_s']) < 3.0 * level.sigma
        assert level.determined
