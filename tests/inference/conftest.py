"""The sample door, ready for inference."""

import pytest

from paint_deposition.formats.campaign_file import read_campaign
from paint_deposition.inference.campaign import Campaign

SAMPLE = 'ros2_ws/src/paint_deposition/samples/measured_door/campaign.yaml'


@pytest.fixture(scope='session')
def sample(repository) -> Campaign:
    """A panel and a door, painted by the virtual paint shop and measured."""
    return read_campaign(repository / SAMPLE)
