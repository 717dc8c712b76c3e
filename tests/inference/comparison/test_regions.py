"""Regions of misfit: what is planted is found and described in words, noise is not."""

import numpy as np
import pytest

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.comparison.regions import misfit_regions
from paint_deposition.inference.fitting.study import Study


@pytest.fixture(scope='module')
def study(sample):
    return Study.of(sample)


def regions(study, residual_um):
    predicted_um = study.measured_um - residual_um
    return misfit_regions(study, study.residuals(predicted_um), DepositionModel())


def planted(study, rows, size_um, seed=0):
    """Noise with a misfit at these points."""
    residual = study.sigma_um * np.random.default_rng(seed).normal(size=len(study))
    residual[rows] += size_um
    return residual


def test_noise_is_no_region(study):
    random = np.random.default_rng(1)
    alarms = sum(
        bool(regions(study, study.sigma_um * random.normal(size=len(study)))) for _ in range(12)
    )
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
    aside = side * (study.campaign.positions_m @ right)
    rows = np.flatnonzero((study.campaign.experiment_of == 1) & (aside > 0.2))
    found = regions(study, planted(study, rows, -5.0))[0]
    assert f' at {from_left} % of the width' in found.description
    assert found.description.partition(', ')[0].endswith(' % of the width from the left')
    assert 'µm high' in found.description


def test_one_bad_reading_is_no_region(study):
    assert regions(study, np.where(np.arange(len(study)) == 60, 4.0 * study.sigma_um, 0.0)) == []
