"""Campaigns are repeatable, give nothing away as files, and the shop keeps to itself."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from .doors import draw_door
from .files import write
from .gauge import layout
from .shop import generate

FEW = {'parcels': 300_000, 'readings': 40, 'repeats': 10, 'heldout': 10}


@pytest.mark.slow
def test_same_seed_same_campaign_whatever_is_hidden():
    clean, again, other = generate(5, **FEW), generate(5, **FEW), generate(6, **FEW)
    hidden = generate(5, 'overspray_fog', amplitude=1.0, **FEW)
    a, b, c, d = (x.experiments[0] for x in (clean, again, hidden, other))
    assert np.array_equal(a.readings.thickness_um, b.readings.thickness_um)
    assert np.array_equal(a.log.positions_m, c.log.positions_m)
    assert np.array_equal(a.readings.positions_m, c.readings.positions_m)
    assert np.allclose(c.readings.thickness_um - a.readings.thickness_um, 1.0, atol=0.1)
    assert not np.array_equal(d.vertices_m, a.vertices_m)


@pytest.mark.slow
def test_campaign_file_names_what_exists_and_hides_the_truth(tmp_path):
    campaign = generate(4, 'edge_build', experiments=('panel', 'door'), **FEW)
    text = write(campaign, tmp_path / 'out').read_text()
    assert 'truth' not in text
    assert 'edge' not in text
    for entry in yaml.safe_load(text)['experiments']:
        for key in ('mesh', 'trajectory', 'measurements'):
            assert (tmp_path / 'out' / entry[key]).exists()
    assert json.loads((tmp_path / 'out/truth/truth.json').read_text())['id'] == 'edge_build'
    with pytest.raises(FileExistsError, match='not empty'):
        write(campaign, tmp_path / 'out')


@pytest.mark.parametrize('style', ['columns', 'rows', 'random'])
def test_layouts_stay_on_the_part_and_repeat(style):
    part = draw_door(np.random.default_rng(4))
    spots = layout(part, style, 120, 30, np.random.default_rng(3))
    assert spots.x_m.size == 90
    assert spots.repeats.sum() == 120
    assert spots.repeats.max() == 3
    assert part.edge_distance(spots.x_m, spots.z_m).min() > 0.0125


def test_the_shop_shares_no_code_with_what_it_judges():
    for source in Path(__file__).parent.glob('*.py'):
        imports = re.findall(r'^\s*(?:from|import)\s+(\S+)', source.read_text(), re.MULTILINE)
        assert not [name for name in imports if name.startswith('paint_')], source.name
