"""What the diagnosis says of real sprays: the known cause, or nobody."""

from pathlib import Path

import numpy as np
import pytest

import paint_deposition as pd
from nature.sprays import NOZZLES, spray_campaign

pytestmark = pytest.mark.slow
nozzles = pytest.mark.parametrize('nozzle', NOZZLES)


@pytest.fixture(scope='module')
def diagnosed(shared_data: Path, tmp_path_factory):
    """Diagnoses a campaign made of sprays of a nozzle, by the options of its builder."""

    def diagnose(nozzle: str, **options) -> pd.Diagnosis:
        folder = tmp_path_factory.mktemp('sprays') / 'campaign'
        table = shared_data / 'patternator_two_nozzles.csv'
        return pd.diagnose(pd.read_campaign(spray_campaign(table, nozzle, folder, **options)))

    return diagnose


def named(diagnosis: pd.Diagnosis) -> list[set[str]]:
    """The groups of effects that were accepted; learned laws name none."""
    return [
        set(found.members)
        for found in diagnosis.classes
        if found.best in diagnosis.accepted and ':' not in found.best
    ]


@nozzles
@pytest.mark.parametrize('as_repeats', [True, False], ids=['repeats', 'parts'])
def test_of_three_heights_the_spread_is_named_and_nothing_else(diagnosed, nozzle, as_repeats):
    found = diagnosed(nozzle, as_repeats=as_repeats)
    assert named(found) == [{'pattern_spread'}]
    exponent = found.model.effect('pattern_spread').exponent
    assert -0.4 < exponent < -0.1
    before, after = found.history[0], found.history[-1]
    assert after.holdout_rmse_um < before.holdout_rmse_um


@nozzles
@pytest.mark.parametrize('height_in', [20, 30, 40])
def test_of_one_height_nobody_is_blamed(diagnosed, nozzle, height_in):
    found = diagnosed(nozzle, as_repeats=True, heights_in=(height_in,))
    assert named(found) == []


@nozzles
def test_two_heights_name_the_spread_or_what_looks_like_it_if_anything(diagnosed, nozzle):
    groups = named(diagnosed(nozzle, as_repeats=True, heights_in=(20, 40)))
    assert len(groups) <= 1
    assert all(group <= {'pattern_spread', 'tcp_standoff'} for group in groups)


@nozzles
def test_heights_told_wrongly_blame_the_standoff_or_the_spread_alone(diagnosed, nozzle):
    found = diagnosed(nozzle, as_repeats=True, told_off_m=-0.2 * 30 * 0.0254 / 4.0)
    groups = named(found)
    assert len(groups) <= 1
    assert all(group <= {'pattern_spread', 'tcp_standoff'} for group in groups)


@nozzles
def test_what_nature_leaves_over_is_as_large_as_sprays_differ(diagnosed, nozzle):
    """Sprays of one setting differ by some per cent of the peak, over centimetres."""
    found = diagnosed(nozzle, heights_in=(40,)).remainder
    assert 0.002 < found.part_share < 0.05
    assert 0.005 < found.length_m < 0.1
    assert np.isfinite(found.footprint_of_peak)
