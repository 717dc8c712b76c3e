"""Another part of the same hidden world: what is changed changes, the rest stays."""

import json

import numpy as np
import pytest
import yaml

from .conner import film_um
from .files import write
from .gauge import GaugeNoise
from .jobs import hold
from .respray import respray, sprayed_again
from .shop import generate
from .truths import library

FEW = {'parcels': 300_000, 'noise': GaugeNoise(floor_um=0.0, relative=0.0)}


@pytest.fixture(scope='module')
def painted():
    return generate(5, readings=40, repeats=10, heldout=1, **FEW)


def film(painted, changes=(), truths=(), stand=None):
    """Films at the same points; the level of the part is that of its seed."""
    (experiment,) = painted.experiments
    more = {'stand': stand, **FEW}
    return respray(painted.pattern, list(truths), experiment, changes, 9, **more).readings.film_um


@pytest.fixture(scope='module')
def stand(painted):
    x, y, z = painted.experiments[0].readings.positions_m[0]
    return {'x_m': x, 'y_m': y, 'z_m': z, 'standoff_m': 0.25, 'dwell_s': 1.5}


@pytest.mark.slow
def test_a_standing_gun_leaves_the_footprint_of_eqs_1_and_2(painted, stand):
    spot = film(painted, ['standing'], stand=stand)
    (experiment,) = painted.experiments
    readings = experiment.readings
    _, first = np.unique(readings.point, return_index=True)
    place = readings.positions_m[0]
    motion = hold(experiment.part, experiment.plan, place, 0.25, 1.5)
    at, normals = (values[np.sort(first)] for values in (readings.positions_m, readings.normals))
    expected = film_um(painted.pattern, motion, at, normals)
    of_its_level = expected.sum() / spot[: len(expected)].sum()
    assert of_its_level == pytest.approx(1.0, abs=0.1)
    assert of_its_level * spot[: len(expected)] == pytest.approx(
        expected, abs=0.03 * expected.max()
    )
    longer = film(painted, stand=stand | {'dwell_s': 3.0})
    assert longer == pytest.approx(2.0 * spot, abs=0.03 * expected.max())


@pytest.mark.slow
def test_twice_the_flow_is_twice_the_film_and_half_the_speed_too(painted):
    usual = film(painted)
    assert film(painted, ['double_flow']) == pytest.approx(2.0 * usual, rel=1e-9)
    assert film(painted, ['half_speed']).mean() == pytest.approx(2.0 * usual.mean(), rel=0.03)
    assert film(painted, ['voltage_off']) == pytest.approx(0.75 * usual, rel=1e-9)


@pytest.mark.slow
def test_what_needs_voltage_is_gone_without_it(painted):
    shielding = library()['faraday_shielding'](0.5)
    assert np.ptp(film(painted, truths=[shielding]) / film(painted)) > 0.05
    off = film(painted, ['voltage_off'], [shielding])
    assert off == pytest.approx(film(painted, ['voltage_off']), rel=1e-9)


@pytest.mark.slow
def test_a_campaign_says_what_was_done_otherwise(painted, tmp_path):
    changes = ['draught_off', 'upside_down', 'half_flow']
    both = sprayed_again(painted, [], 'door', changes, 9, **FEW)
    entry = yaml.safe_load(write(both, tmp_path / 'both').read_text())['experiments'][1]
    assert (entry['name'], entry['switched_off']) == ('door_next', ['draught'])
    assert entry['down'] == [0.0, 0.0, 1.0]
    assert 'door_next' not in json.loads((tmp_path / 'both/truth/truth.json').read_text())
    with pytest.raises(ValueError, match=r"no change 'louder'; there are: roll_180"):
        film(painted, ['louder'])
