"""A missing effect found in parts that two brushes painted, as droplets that know no model."""

import pytest

import paint_deposition as pd
from paint_deposition.inference.fitting.estimates import estimates
from virtual_paint_shop.files import write
from virtual_paint_shop.shop import generate

pytestmark = pytest.mark.slow


def painted(folder, truth, part):
    """A campaign whose passes take brush 1 and the narrower brush 2 in turn, and its truth."""
    made = generate(
        5, truth, experiments=(part,), readings=90, repeats=24, second_brush=0.75,
        parcels=2_000_000,
    )  # fmt: skip
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
    # Whole patches are left out, where the edge is and where it is not.
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
