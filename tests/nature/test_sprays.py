"""What a diagnosis must say of real sprays of two nozzles, whose missing physics is known.

The width of both grows as the height to a power of about 0.65 to 0.8 instead of 1, and the volume
stays within 10 %: `pattern_spread` of about -0.2 to -0.35, and nothing else. One height alone
tells of the footprint only. A wrongly taught standoff shows as one, or as a pattern that spreads
otherwise: three heights do not tell the two apart.
"""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import paint_deposition as pd
from nature.sprays import HEIGHTS_IN, NOZZLES, SCALE_M_PER_IN, spray_campaign, sprays

SPREAD = 'pattern_spread'
STANDOFF = {SPREAD, 'tcp_standoff'}
WAYS = {'sprays as parts': False, 'sprays as repeats': True}
PAIRS = list(combinations(HEIGHTS_IN, 2))

nozzles = pytest.mark.parametrize('nozzle', NOZZLES)
ways = pytest.mark.parametrize('as_repeats', WAYS.values(), ids=WAYS.keys())


@pytest.fixture(scope='module')
def table(shared_data: Path) -> Path:
    return shared_data / 'patternator_two_nozzles.csv'


@pytest.fixture(scope='module')
def said(table, tmp_path_factory):
    """The diagnosis of a campaign as it is written, each made once."""
    known = {}

    def of(nozzle: str, **options) -> dict:
        key = nozzle, repr(options)
        if key not in known:
            folder = tmp_path_factory.mktemp('sprays') / 'campaign'
            campaign = pd.read_campaign(spray_campaign(table, nozzle, folder, **options))
            known[key] = pd.diagnose(campaign).to_dict()
        return known[key]

    return of


def named(said: dict) -> list[set[str]]:
    """The groups of named effects that were accepted."""
    accepted = [name for name in said['accepted'] if not name.startswith('learned:')]
    return [set(c['members']) for c in said['classes'] if c['best'] in accepted]


def assert_only(said: dict, wanted: set[str]) -> None:
    """One group was named, with one of the wanted effects, and no other effect."""
    groups = named(said)
    assert len(groups) == 1, said['accepted']
    assert groups[0] & wanted, said['accepted']


# --- the campaigns themselves


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


# --- what a diagnosis must say of them


@pytest.mark.slow
@pytest.mark.parametrize('hanging', ['column', 'row', 'lying'])
@ways
@nozzles
def test_the_pattern_that_spreads_otherwise_is_named_and_nothing_else(
    said, nozzle, as_repeats, hanging
):
    assert_only(said(nozzle, as_repeats=as_repeats, hanging=hanging), {SPREAD})


@pytest.mark.slow
@pytest.mark.parametrize('heights_in', PAIRS)
@ways
@nozzles
def test_two_heights_tell_it_as_well(said, nozzle, as_repeats, heights_in):
    assert_only(said(nozzle, as_repeats=as_repeats, heights_in=heights_in), {SPREAD})


@pytest.mark.slow
@pytest.mark.parametrize('height_in', HEIGHTS_IN)
@ways
@nozzles
def test_at_one_height_nobody_is_blamed(said, nozzle, as_repeats, height_in):
    found = said(nozzle, as_repeats=as_repeats, heights_in=(height_in,))
    assert named(found) == []
    assert found['verdict'] != 'effect_missing'


@pytest.mark.slow
@pytest.mark.parametrize('factor', [0.8, 1.2])
@ways
@nozzles
def test_heights_all_told_too_large_by_a_factor_change_nothing(said, nozzle, as_repeats, factor):
    """A factor on all heights moves the model plane with them."""
    found = said(nozzle, as_repeats=as_repeats, told_times=factor)
    assert_only(found, {SPREAD})


@pytest.mark.slow
@pytest.mark.parametrize('share', [-0.2, 0.2])
@ways
@nozzles
def test_a_standoff_taught_wrongly_is_called_one_or_its_like(said, nozzle, as_repeats, share):
    """All poses off by a fifth of the middle height: an error of the tool."""
    found = said(nozzle, as_repeats=as_repeats, told_off_m=share * 30 * SCALE_M_PER_IN)
    assert_only(found, STANDOFF)


@pytest.mark.slow
@nozzles
def test_no_part_gets_worse_by_what_is_found(said, nozzle):
    """The error after is no larger than before, of all readings and of those left out."""
    rmse = said(nozzle, as_repeats=True)['rmse_um']
    assert rmse['after'] <= rmse['before']
    assert rmse['holdout_after'] <= rmse['holdout_before']
