"""Regions of misfit, residuals spread over the surface, and profiles along columns of readings."""

import numpy as np
import pytest
import trimesh
import yaml

import paint_deposition as pd
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.inference.comparison import regions as areas
from paint_deposition.inference.comparison.profiles import profiles_of
from paint_deposition.inference.comparison.regions import interpolation_matrix
from paint_deposition.inference.fitting.study import Study
from small_campaign import small_campaign


@pytest.fixture(scope='module')
def study(sample):
    return Study.of(sample)


def regions(study, residual_um):
    predicted_um = study.measured_um - residual_um
    return areas.misfit_regions(study, study.residuals(predicted_um), pd.DepositionModel())


def planted(study, rows, size_um, seed=0):
    """Noise with a misfit at these points."""
    residual = study.sigma_um * np.random.default_rng(seed).normal(size=len(study))
    residual[rows] += size_um
    return residual


def test_noise_and_one_bad_reading_are_no_region(study):
    bad_um = np.where(np.arange(len(study)) == 60, 4.0 * study.sigma_um, 0.0)
    assert regions(study, bad_um) == []
    alarms = sum(bool(regions(study, planted(study, [], 0.0, seed))) for seed in range(12))
    # At 2 % a part 0.5 of 12 are expected; four or more come with a chance of 0.2 %.
    assert alarms < 4


def test_a_planted_misfit_is_found_and_told(study):
    door = study.campaign.experiments[1]
    on_door = study.campaign.experiment_of == 1
    height = study.campaign.positions_m[:, 2] / np.ptp(door.surface.vertices_m[:, 2])
    rows = np.flatnonzero(on_door & (height > 0.7))
    found = regions(study, planted(study, rows, 4.0))[0]
    assert found.experiment == door.name
    assert set(found.rows) >= set(rows[1:])
    assert found.mean_residual_um == pytest.approx(4.0, abs=1.0)
    assert 'upper third' in found.description
    assert 'lower third' not in found.description
    assert 'µm low' in found.description  # measured more: the model is low
    assert found.readings == door.readings.repeats[found.rows - np.argmax(on_door)].sum()


@pytest.mark.parametrize(('side', 'from_left'), [(1.0, 98), (-1.0, 0)])
def test_left_is_the_guns(study, side, from_left):
    """The gun looks at this door along -y with z up: its right is -x."""
    door = study.campaign.experiments[1]
    looking = door.path.rotation[:, :, 2].mean(axis=0)
    assert looking[1] < -0.9
    across_m = study.campaign.positions_m @ np.cross(looking, [0.0, 0.0, 1.0])
    aside = (study.campaign.experiment_of == 1) & (side * across_m > 0.2)
    found = regions(study, planted(study, aside, -5.0))[0]
    assert f' at {from_left} % of the width' in found.description
    assert found.description.partition(', ')[0].endswith(' % of the width from the left')
    assert 'µm high' in found.description


@pytest.fixture
def plate():
    """Both sides of a thin square metre."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    vertices = np.concatenate([square, square + np.array([0, 0.002, 0])])
    both = np.concatenate([faces, faces[:, ::-1] + 4])
    return pd.Surface.from_triangles(vertices, both, 0.04)


def test_residuals_spread_evenly_within_the_radius_on_their_side_the_nearer_the_more(plate):
    points = np.array([[0.3, 0, 0.5], [0.6, 0, 0.5]])
    front = plate.normals[:, 1] < 0
    for apart_m, radius_m in ((0.3, 0.09), (0.04, 0.072), (0.01, 0.025)):
        points = np.array([[0.3, 0, 0.5], [0.3 + apart_m, 0, 0.5]])
        normals = np.tile([0.0, -1.0, 0.0], (2, 1))
        matrix, reached = interpolation_matrix(plate, points, normals)
        distance = np.linalg.norm(plate.vertices_m[:, None] - points, axis=2).min(axis=1)
        assert np.array_equal(reached, front & (distance < radius_m))
        np.testing.assert_allclose((matrix @ [7.0, 7.0])[reached], 7.0, rtol=1e-12)
    middle = np.linalg.norm(plate.vertices_m - [0.5, 0.0, 0.5], axis=1)
    near = np.argsort(np.where(front, middle, 9.0), kind='stable')[:2]
    positions = plate.vertices_m[near]
    matrix, _ = interpolation_matrix(plate, positions, plate.normals[near])
    apart_m = np.linalg.norm(positions[0] - positions[1])
    assert 0.025 < 1.8 * apart_m < 0.09
    weight = (1.0 - 1.0 / 1.8**2) ** 3
    expected = (-3.0 + 5.0 * weight) / (1.0 + weight)
    assert (matrix @ [-3.0, 5.0])[near[0]] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(('angle_deg', 'same_side'), [(59.0, True), (61.0, False)])
def test_surface_turned_by_more_than_60_deg_is_another_side(plate, angle_deg, same_side):
    angle = np.radians(angle_deg)
    normal = np.array([[np.sin(angle), -np.cos(angle), 0.0]])
    place = np.array([[0.5, 0.0, 0.5]])
    matrix, reached = interpolation_matrix(plate, place, normal)
    front = plate.normals[:, 1] < 0
    assert reached[front].any() == same_side
    assert not reached[~front].any()
    np.testing.assert_allclose((matrix @ [2.0])[reached], 2.0, rtol=1e-12)


BASE = pd.DepositionModel()
DRIFTING = pd.DepositionModel(effects=(AirDrift(shift_down_m=0.02),))


def every_reading_once(profiles, study) -> bool:
    rows = np.concatenate([profile.rows for profile in profiles])
    return np.array_equal(np.sort(rows), np.arange(len(study)))


@pytest.mark.slow
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
        assert profile.line_m[0] < profile.position_m[0]
        assert profile.position_m[-1] < profile.line_m[-1]
        assert np.ptp(profile.line_m) < np.ptp(part.surface.vertices_m[:, 2]) + 0.01
        assert len(profile.passes_um) > 1
        assert profile.passes_um.sum(axis=0) == pytest.approx(profile.lines_um[1], rel=1e-6)


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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
