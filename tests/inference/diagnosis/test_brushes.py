"""A missing effect found in parts that two brushes painted, as droplets that know no model."""

import json

import pytest

from cli.command import paint
from paint_deposition.api.inference import calibrate, diagnose
from paint_deposition.files.campaign_file import read_campaign
from paint_deposition.files.model_file import read_model_file
from paint_deposition.inference.fitting.estimates import estimates
from virtual_paint_shop.files import write
from virtual_paint_shop.shop import generate

pytestmark = pytest.mark.slow

SEED, WIDTH = 5, 0.75


def painted(folder, truth, *parts):
    """A campaign whose passes take brush 1 and the narrower brush 2 in turn."""
    made = generate(
        SEED, truth, experiments=parts, readings=90, repeats=24, second_brush=WIDTH,
        parcels=2_000_000,
    )  # fmt: skip
    return write(made, folder), made.truth


def test_the_hidden_effect_is_named_and_the_error_falls(tmp_path, undrawn):
    """A door with more paint along its edges; nothing but the recording names the brushes."""
    campaign, truth = painted(tmp_path / 'door', 'edge_build', 'door')
    done = paint('diagnose', campaign, '-o', tmp_path / 'd')
    assert done.returncode == 0, done.stderr
    assert 'effect missing: The readings show edge_build.' in done.stdout
    found = json.loads((tmp_path / 'd/diagnosis.json').read_text())
    assert found['accepted'] == ['edge_build']
    gain = found['classes'][0]['parameters']['gain']
    assert gain['low'] <= truth['hidden'][0]['amplitude'] <= gain['high']
    error = found['rmse_um']
    # Whole patches are left out, where the edge is and where it is not.
    assert error['holdout_after'] < 0.97 * error['holdout_before']
    assert error['after'] < error['noise_floor'] < error['before']
    file = read_model_file(tmp_path / 'd/model.yaml')
    assert [brush.number for brush in file.model.brushes] == [1, 2]
    assert [effect.id for effect in file.model.effects] == ['edge_build']
    narrower = [brush.planar.r_m + brush.planar.sigma1_m for brush in file.model.brushes]
    assert narrower[1] < 0.9 * narrower[0]
    assert 'brush_2.log_K1' in file.posterior.names
    assert 'brush 2: ' in (tmp_path / 'd/report.html').read_text()


def test_brushes_calibrated_before_name_nothing_in_a_job_without_an_effect(tmp_path):
    """The calibration's readings are the prior of the job's; its other brush moves along."""
    panel, _ = painted(tmp_path / 'panel', None, 'panel')
    door, truth = painted(tmp_path / 'door', None, 'door')
    known = calibrate(read_campaign(panel))
    found = diagnose(read_campaign(door), known.model, posterior=known.posterior)
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
