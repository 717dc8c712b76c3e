"""What is written can be read back by others' tools, and gives nothing away."""

import json

import numpy as np
import pytest
import yaml

from .files import write
from .gauge import layout
from .shop import generate

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def campaign():
    return generate(4, 'edge_build', experiments=('panel', 'door'), parcels=300_000, heldout=20)


@pytest.fixture(scope='module')
def folder(campaign, tmp_path_factory):
    return write(campaign, tmp_path_factory.mktemp('shop') / 'out').parent


def test_campaign_file_names_what_exists_and_hides_the_truth(campaign, folder):
    text = (folder / 'campaign.yaml').read_text()
    assert 'truth' not in text
    assert 'edge' not in text
    for entry in yaml.safe_load(text)['experiments']:
        for key in ('mesh', 'trajectory', 'measurements'):
            assert (folder / entry[key]).exists()
    assert json.loads((folder / 'truth' / 'truth.json').read_text())['id'] == 'edge_build'
    with pytest.raises(FileExistsError, match='not empty'):
        write(campaign, folder)


@pytest.mark.parametrize('style', ['columns', 'rows', 'random'])
def test_layouts_stay_on_the_part_and_repeat(campaign, style):
    part = campaign.experiments[1].part
    spots = layout(part, style, 120, 30, np.random.default_rng(3))
    assert spots.x_m.size == 90
    assert spots.repeats.sum() == 120
    assert spots.repeats.max() == 3
    assert part.edge_distance(spots.x_m, spots.z_m).min() > 0.0125
