"""Campaigns are repeatable and believable, and the shop keeps to itself."""

import re
from pathlib import Path

import numpy as np
import pytest

from .shop import generate


@pytest.mark.slow
def test_same_seed_same_campaign_whatever_is_hidden():
    few = {'parcels': 300_000, 'readings': 40, 'repeats': 10, 'heldout': 10}
    clean, again = generate(5, **few), generate(5, **few)
    hidden = generate(5, 'overspray_fog', amplitude=1.0, **few)
    a, b, c = (x.experiments[0] for x in (clean, again, hidden))
    assert np.array_equal(a.readings.thickness_um, b.readings.thickness_um)
    assert np.array_equal(a.log.positions_m, c.log.positions_m)
    assert np.array_equal(a.readings.positions_m, c.readings.positions_m)
    assert np.allclose(c.readings.thickness_um - a.readings.thickness_um, 1.0, atol=0.1)
    assert hidden.truth['hidden'][0]['visible_rms_um']['door'] == pytest.approx(1.0)
    other = generate(6, **few).experiments[0]
    assert not np.array_equal(other.vertices_m, a.vertices_m)


def test_the_shop_shares_no_code_with_what_it_judges():
    for source in Path(__file__).parent.glob('*.py'):
        imports = re.findall(r'^\s*(?:from|import)\s+(\S+)', source.read_text(), re.MULTILINE)
        assert not [name for name in imports if name.startswith('paint_')], source.name
