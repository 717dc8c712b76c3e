"""Campaigns from real sprays of two nozzles: the known cause is named, or nobody.

These are six of the ways in which the sprays make a campaign; `make bench-nature` runs all 52.
"""

from pathlib import Path

import pytest

import paint_deposition as pd
from nature.sprays import NOZZLES, SCALE_M_PER_IN, spray_campaign

pytestmark = pytest.mark.slow
ONE, OTHER = NOZZLES
ALIKE = {'pattern_spread', 'tcp_standoff'}


@pytest.fixture
def diagnosed(shared_data: Path, tmp_path):
    """`diagnosed(nozzle, **options)`: of a campaign, by the options of its builder."""
    table = shared_data / 'patternator_two_nozzles.csv'
    return lambda nozzle, **options: pd.diagnose(
        pd.read_campaign(spray_campaign(table, nozzle, tmp_path, **options))
    )


def named(diagnosis: pd.Diagnosis) -> list[set[str]]:
    """The groups of effects that were accepted; learned laws name none."""
    return [
        set(found.members)
        for found in diagnosis.classes
        if found.best in diagnosis.accepted and ':' not in found.best
    ]


@pytest.mark.parametrize(
    ('nozzle', 'as_repeats'), [(ONE, True), (OTHER, False)], ids=['repeats', 'parts']
)
def test_of_three_heights_the_spread_is_named_and_nothing_else(diagnosed, nozzle, as_repeats):
    """At the most with a standoff that was told wrongly, which can look the same."""
    found = diagnosed(nozzle, as_repeats=as_repeats)
    (group,) = named(found)
    assert {found.classes[0].best} == {'pattern_spread'} <= group <= ALIKE
    assert -0.4 < found.model.effect('pattern_spread').exponent < -0.1
    assert found.history[-1].rmse_um < found.history[0].rmse_um
    # No part is worse by more than the noise.
    for part in found.to_dict()['experiments']:
        assert part['rmse_after_um'] < part['rmse_before_um'] + found.study.noise_floor_um


@pytest.mark.parametrize(('nozzle', 'height_in', 'repeats'), [(OTHER, 30, True), (ONE, 40, False)])
def test_of_one_height_nobody_is_blamed(diagnosed, nozzle, height_in, repeats):
    found = diagnosed(nozzle, heights_in=(height_in,), as_repeats=repeats)
    assert named(found) == []
    if not repeats:
        # Sprays of one setting differ by some per cent of the peak, over centimetres.
        assert 0.002 < found.discrepancy.part_share < 0.05
        assert 0.005 < found.discrepancy.length_m < 0.1


@pytest.mark.parametrize(
    ('nozzle', 'options'),
    [(OTHER, {'heights_in': (20, 40)}), (ONE, {'told_off_m': -0.2 * 30 * SCALE_M_PER_IN})],
    ids=['two heights', 'heights told wrongly'],
)
def test_the_spread_or_what_looks_like_it_is_likeliest_and_nothing_else_named(
    diagnosed, nozzle, options
):
    found = diagnosed(nozzle, as_repeats=True, **options)
    assert set(found.classes[0].members) <= ALIKE
    assert all(group <= ALIKE for group in named(found))
