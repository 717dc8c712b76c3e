"""Profiles along columns of readings."""

import numpy as np
import pytest
import trimesh
import yaml

import paint_deposition as pd
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.inference.comparison.profiles import profiles_of
from paint_deposition.inference.fitting.study import Study
from small_campaign import small_campaign

pytestmark = pytest.mark.slow

BASE = pd.DepositionModel()
DRIFTING = pd.DepositionModel(effects=(AirDrift(shift_down_m=0.02),))


def every_reading_once(profiles, study) -> bool:
    rows = np.concatenate([profile.rows for profile in profiles])
    return np.array_equal(np.sort(rows), np.arange(len(study)))


def test_a_profile_passes_through_its_readings_and_ends_with_its_part(tmp_path):
    campaign = small_campaign(tmp_path)
    study = Study.of(campaign)
    profiles = profiles_of(study, [BASE, DRIFTING])
    assert every_reading_once(profiles, study)
    parts = {part.name: (k, part) for k, part in enumerate(campaign.experiments)}
    predicted_um = [study.forward.predict_um(model) for model in (BASE, DRIFTING)]
    for profile in profiles:
        number, part = parts[profile.experiment]
        assert (campaign.experiment_of[profile.rows] == number).all()
        here = np.searchsorted(profile.line_m, profile.position_m)
        for line_um, film_um in zip(profile.lines_um, predicted_um, strict=True):
            assert line_um[here] == pytest.approx(film_um[profile.rows], rel=1e-6, abs=1e-6)
        # It goes on beyond the outermost readings.
        assert profile.line_m[0] < profile.position_m[0]
        assert profile.position_m[-1] < profile.line_m[-1]
        assert np.ptp(profile.line_m) < np.ptp(part.surface.vertices_m[:, 2]) + 0.01
        assert len(profile.passes_um) > 1
        assert profile.passes_um.sum(axis=0) == pytest.approx(profile.lines_um[1], rel=1e-6)


def test_on_a_part_that_lies_profiles_run_along_it(tmp_path):
    """A panel on its back has no height over which its columns could be drawn."""
    small_campaign(tmp_path, experiments=('panel',))
    file = tmp_path / 'campaign.yaml'
    told = yaml.safe_load(file.read_text())
    told['experiments'][0]['down'] = [0.0, 1.0, 0.0]
    file.write_text(yaml.safe_dump(told))
    profiles = profiles_of(Study.of(pd.read_campaign(file)), [BASE])
    assert len(profiles) > 1
    for profile in profiles:
        assert 'height' not in profile.axis
        assert np.all(np.diff(profile.position_m) > 0.01)


def test_readings_without_rows_or_columns_fall_into_strips_with_a_line(tmp_path):
    """On a flat panel the passes leave the same film all along: at the middle of a strip, too."""
    study = Study.of(small_campaign(tmp_path, experiments=('panel',), style='random'))
    assert not any(study.campaign.readings.group)
    profiles = profiles_of(study, [BASE])
    assert every_reading_once(profiles, study)
    predicted_um = study.forward.predict_um(BASE)
    for profile in profiles:
        assert np.all(np.diff(profile.position_m) >= 0.0)
        assert len(profile.line_m) > len(profile.rows)
        middle_um = profile.lines_um[0][np.searchsorted(profile.line_m, profile.position_m)]
        assert middle_um == pytest.approx(predicted_um[profile.rows], rel=0.03)


def test_lines_break_over_an_opening_and_do_not_run_over_its_hem(tmp_path):
    """A panel with a window of 300 x 300 mm, its edge folded back by 20 mm."""
    small_campaign(tmp_path, experiments=('panel',), style='random')
    mesh = trimesh.load(tmp_path / 'panel.stl')
    middle = mesh.bounds.mean(axis=0)

    def from_middle(points_m):
        return np.abs(points_m - middle)[:, [0, 2]].max(axis=1)

    mesh.update_faces(from_middle(mesh.triangles_center) >= 0.15)
    hem = trimesh.creation.box((0.3, 0.02, 0.3))
    hem.update_faces(np.abs(hem.face_normals[:, 1]) < 0.5)
    hem.apply_translation(middle + np.array([0.0, 0.01, 0.0]))
    trimesh.util.concatenate([mesh, hem]).export(tmp_path / 'panel.stl')
    head, *rows = (tmp_path / 'panel.csv').read_text().splitlines()
    places = np.array([row.split(',')[:3] for row in rows], dtype=float)
    kept = [row for row, far in zip(rows, from_middle(places) > 0.16, strict=True) if far]
    (tmp_path / 'panel.csv').write_text('\n'.join([head, *kept]))
    profiles = profiles_of(Study.of(pd.read_campaign(tmp_path / 'campaign.yaml')), [BASE])
    gone = np.concatenate([p.line_m[np.isnan(p.lines_um[0])] for p in profiles])
    assert len(gone) > 20
    assert np.abs(gone - middle[2]).max() < 0.16
    assert all(np.isfinite(profile.lines_um[0]).sum() > 20 for profile in profiles)
