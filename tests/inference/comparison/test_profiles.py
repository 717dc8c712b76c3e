"""Profiles along columns of readings."""

import numpy as np
import pytest
import trimesh
import yaml

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.files.campaign_file import read_campaign
from paint_deposition.inference.comparison.profiles import profiles_of
from paint_deposition.inference.fitting.study import Study
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


def test_lines_go_on_beyond_the_outermost_readings_and_end_with_the_part(study, profiles):
    parts = {e.name: e.surface for e in study.campaign.experiments}
    for profile in profiles:
        assert profile.line_m[0] < profile.position_m[0]
        assert profile.position_m[-1] < profile.line_m[-1]
        heights_m = parts[profile.experiment].vertices_m[:, 2]
        assert np.ptp(profile.line_m) < np.ptp(heights_m) + 0.01


def test_on_a_part_that_lies_profiles_run_along_it(tmp_path):
    """A panel on its back has no height over which its columns could be drawn."""
    small_campaign(tmp_path, experiments=('panel',))
    file = tmp_path / 'campaign.yaml'
    told = yaml.safe_load(file.read_text())
    told['experiments'][0]['down'] = [0.0, 1.0, 0.0]
    file.write_text(yaml.safe_dump(told))
    profiles = profiles_of(Study.of(read_campaign(file)), [DepositionModel()])
    assert len(profiles) > 1
    for profile in profiles:
        assert 'height' not in profile.axis
        assert np.all(np.diff(profile.position_m) > 0.01)


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


def test_lines_break_over_an_opening_and_do_not_run_over_its_hem(tmp_path):
    """A panel with a window of 300 x 300 mm, its edge folded back by 20 mm."""
    small_campaign(tmp_path, experiments=('panel',), style='random')
    mesh = trimesh.load(tmp_path / 'panel.stl')
    middle = mesh.bounds.mean(axis=0)

    def from_middle(points_m):
        return np.abs(points_m - middle)[:, [0, 2]].max(axis=1)

    inner = from_middle(mesh.triangles_center) < 0.15
    hem = trimesh.creation.box((0.3, 0.02, 0.3))
    hem.update_faces(np.abs(hem.face_normals[:, 1]) < 0.5)
    hem.apply_translation(middle + np.array([0.0, 0.01, 0.0]))
    mesh.update_faces(~inner)
    trimesh.util.concatenate([mesh, hem]).export(tmp_path / 'panel.stl')
    head, *rows = (tmp_path / 'panel.csv').read_text().splitlines()
    places = np.array([row.split(',')[:3] for row in rows], dtype=float)
    kept = [row for row, far in zip(rows, from_middle(places) > 0.16, strict=True) if far]
    (tmp_path / 'panel.csv').write_text('\n'.join([head, *kept]))
    study = Study.of(read_campaign(tmp_path / 'campaign.yaml'))
    profiles = profiles_of(study, [DepositionModel()])
    gone = np.concatenate([p.line_m[np.isnan(p.lines_um[0])] for p in profiles])
    assert len(gone) > 20
    assert np.abs(gone - middle[2]).max() < 0.16
    assert all(np.isfinite(profile.lines_um[0]).sum() > 20 for profile in profiles)
