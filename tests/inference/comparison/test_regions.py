"""Regions of misfit are found and described, noise is none; residuals spread over the surface."""

import numpy as np
import pytest

import paint_deposition as pd
from paint_deposition.inference.comparison.regions import (
    interpolate_over_surface,
    interpolation_matrix,
    misfit_regions,
    radius_of_readings_m,
    reached,
)
from paint_deposition.inference.fitting.study import Study


@pytest.fixture(scope='module')
def study(sample):
    return Study.of(sample)


def regions(study, residual_um):
    predicted_um = study.measured_um - residual_um
    return misfit_regions(study, study.residuals(predicted_um), pd.DepositionModel())


def planted(study, rows, size_um, seed=0):
    """Noise with a misfit at these points."""
    residual = study.sigma_um * np.random.default_rng(seed).normal(size=len(study))
    residual[rows] += size_um
    return residual


def test_noise_is_no_region(study):
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
    assert set(found.rows) >= set(rows) - set(rows[:1])
    assert found.mean_residual_um == pytest.approx(4.0, abs=1.0)
    assert 'upper third' in found.description
    assert 'lower third' not in found.description
    assert 'µm low' in found.description  # measured more: the model is low
    assert found.readings == door.means.repeats[found.rows - np.argmax(on_door)].sum()


@pytest.mark.parametrize(('side', 'from_left'), [(1.0, 98), (-1.0, 0)])
def test_left_is_the_guns(study, side, from_left):
    """The gun looks at this door along -y with z up: its right is -x."""
    door = study.campaign.experiments[1]
    looking = door.path.rotation[:, :, 2].mean(axis=0)
    assert looking[1] < -0.9
    right = np.cross(looking, [0.0, 0.0, 1.0])
    aside = (study.campaign.experiment_of == 1) & (
        side * (study.campaign.positions_m @ right) > 0.2
    )
    found = regions(study, planted(study, aside, -5.0))[0]
    assert f' at {from_left} % of the width' in found.description
    assert found.description.partition(', ')[0].endswith(' % of the width from the left')
    assert 'µm high' in found.description


def test_one_bad_reading_is_no_region(study):
    assert regions(study, np.where(np.arange(len(study)) == 60, 4.0 * study.sigma_um, 0.0)) == []


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
    matrix = interpolation_matrix(plate, points, np.tile([0.0, -1.0, 0.0], (2, 1)), 0.2)
    front = plate.normals[:, 1] < 0
    distance = np.linalg.norm(plate.vertices_m[:, None] - points, axis=2).min(axis=1)
    assert np.array_equal(reached(matrix), front & (distance < 0.2))
    np.testing.assert_allclose((matrix @ [7.0, 7.0])[reached(matrix)], 7.0, rtol=1e-12)
    near = np.flatnonzero(front)[[40, 41]]
    positions = plate.vertices_m[near]
    values = interpolation_matrix(plate, positions, plate.normals[near], 0.2) @ [-3.0, 5.0]
    weight = (1.0 - (np.linalg.norm(positions[0] - positions[1]) / 0.2) ** 2) ** 3
    assert values[near[0]] == pytest.approx((-3.0 + 5.0 * weight) / (1.0 + weight), abs=1e-12)


@pytest.mark.parametrize(('angle_deg', 'same_side'), [(59.0, True), (61.0, False)])
def test_surface_turned_by_more_than_60_deg_is_another_side(plate, angle_deg, same_side):
    angle = np.radians(angle_deg)
    normal = np.array([[np.sin(angle), -np.cos(angle), 0.0]])
    field = interpolate_over_surface(plate, np.array([[0.5, 0.0, 0.5]]), normal, np.array([2.0]))
    front = plate.normals[:, 1] < 0
    assert np.isfinite(field[front]).any() == same_side
    assert np.isnan(field[~front]).all()


def test_the_radius_is_from_the_spacing_unless_given(plate):
    points = np.array([[0.3, 0, 0.5], [0.34, 0, 0.5], [0.38, 0, 0.5]])
    normals = np.tile([0.0, -1.0, 0.0], (3, 1))
    assert radius_of_readings_m(points) == pytest.approx(0.072)
    given = interpolation_matrix(plate, points, normals, radius_of_readings_m(points))
    assert (interpolation_matrix(plate, points, normals) != given).nnz == 0
