"""Campaigns from real sprays of two nozzles, whose missing physics is known."""

from pathlib import Path

import numpy as np
import pytest

import paint_deposition as pd
from nature.sprays import NOZZLES, SCALE_M_PER_IN, spray_campaign, sprays

nozzles = pytest.mark.parametrize('nozzle', NOZZLES)


@pytest.fixture(scope='module')
def table(shared_data: Path) -> Path:
    return shared_data / 'patternator_two_nozzles.csv'


def test_the_campaigns_hold_the_measured_sprays(table, tmp_path):
    measured = sprays(table, 'E8003')
    campaign = pd.read_campaign(spray_campaign(table, 'E8003', tmp_path / 'campaign'))
    assert len(campaign.experiments) == len(measured) == 9
    assert campaign.readings.thickness_um.max() == pytest.approx(30.0)
    for experiment, ((height_in, _), rows) in zip(
        campaign.experiments, measured.items(), strict=True
    ):
        np.testing.assert_allclose(experiment.readings.thickness_um, rows[:, 1], atol=1e-3)
        standoff_m = -np.median(experiment.path.position_m[:, 1])
        assert standoff_m == pytest.approx(height_in * SCALE_M_PER_IN)


@nozzles
def test_the_width_grows_more_slowly_than_the_height_and_the_volume_stays(table, nozzle):
    heights, widths, volumes = [], [], []
    for (height_in, _), rows in sprays(table, nozzle).items():
        offset, film = rows.T
        middle = np.average(offset, weights=film)
        heights.append(height_in)
        widths.append(np.sqrt(np.average((offset - middle) ** 2, weights=film)))
        volumes.append(film.sum())
    power = np.polyfit(np.log(heights), np.log(widths), 1)[0]
    assert 0.6 < power < 0.85
    assert np.std(volumes) < 0.1 * np.mean(volumes)
