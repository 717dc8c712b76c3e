"""The diagnosis of small campaigns of the virtual paint shop, whose defects are known."""

import json
import os
import time
from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from inference.diagnosis.readings_on_door import DOOR, SHIELDED
from inference.fitting.panels import ORDERS, gauged, reading
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.files.atomic import json_text
from paint_deposition.inference.diagnosis.model_space import ALPHA, SURE
from paint_deposition.inference.diagnosis.procedure import diagnose
from paint_deposition.inference.diagnosis.refit import refit
from paint_deposition.inference.diagnosis.verdict import percent
from paint_deposition.model.eq1_pattern import PlanarPattern
from small_campaign import generated, small_campaign
from virtual_paint_shop.draw import stream
from virtual_paint_shop.gauge import GaugeNoise, measure

pytestmark = pytest.mark.slow
BASE, SHIELDING = pd.DepositionModel(), EFFECTS['faraday_shielding']


@pytest.fixture(scope='module')
def shielded(tmp_path_factory):
    """A door with a shielded valley."""
    return small_campaign(tmp_path_factory.mktemp('shielded'), **SHIELDED)


@pytest.fixture(scope='module')
def clean(tmp_path_factory):
    """A door painted as the model says, all readings in one group."""
    options = DOOR | {'seed': 3, 'truth': None}
    (one,) = small_campaign(tmp_path_factory.mktemp('clean'), **options).experiments
    grouped = replace(one.readings, group=np.full(len(one.readings), 'column 1'))
    return one.with_readings(grouped)


def test_nothing_is_found_where_nothing_is_missing(clean):
    nothing_found = diagnose(pd.Campaign((clean,)), BASE, EFFECTS)
    assert nothing_found.verdict == 'none_missing'
    assert nothing_found.p_value > 0.05
    assert (nothing_found.accepted, nothing_found.classes) == ((), ())
    assert nothing_found.unknown is None
    assert nothing_found.detectable.keys().isdisjoint(nothing_found.not_testable)
    assert set(nothing_found.detectable) | set(nothing_found.not_testable) == set(EFFECTS)
    misfits = nothing_found.comparisons[0].misfits
    assert [label for _, kind, label in misfits if kind == 'group'] == ['column 1']
    figures = nothing_found.discrepancy
    # The paint shop's sprays are even, and its footprint is that of eq. (1).
    assert 0.0 < figures.setting_share < 0.03
    assert figures.part_share == 0.0
    assert figures.footprint_of_peak < 0.15
    assert str(figures) in nothing_found.notes


def test_the_effect_is_named_and_predicts_readings_left_out(shielded):
    found = diagnose(shielded, BASE, EFFECTS)
    assert found.verdict == 'effect_missing'
    assert found.p_value < 0.01
    best = found.classes[0]
    assert found.accepted == (best.best,)
    # In one valley a shielded film and a gauge that reads low there look alike.
    assert 'faraday_shielding' in best.members
    assert {EFFECTS[name].family for name in best.members} == {'curvature'}
    assert best.probability > SURE
    before, after = found.history
    assert (before.added, after.added) == ('', best.best)
    assert after.rmse_um < 0.8 * before.rmse_um
    assert after.holdout_rmse_um < before.holdout_rmse_um
    content = json.loads(json_text(found.to_dict()))
    one = content['classes'][0]
    assert content['accepted'] == [one['best']] == [one['members'][0]] == [best.best]
    assert content['regions'][0]['mean_residual_um'] < 0.0  # too little paint in the valley
    assert content['rmse_um']['left_out'] == 'points'
    (part,) = content['experiments']
    assert [part['rmse_before_um'], part['rmse_after_um']] == [before.rmse_um, after.rmse_um]


def test_an_effect_outside_the_library_is_not_blamed_on_another(tmp_path):
    hidden = {'seed': 22, 'truth': 'convex_attraction', 'amplitude': 0.3}
    campaign = small_campaign(tmp_path, **DOOR | hidden)
    # Those that look alike on these readings, as the effect itself declares, would be right, too.
    alike = {'convex_attraction', *EFFECTS['convex_attraction'].rivals}
    library = {key: effect for key, effect in EFFECTS.items() if key not in alike}
    diagnosis = diagnose(campaign, BASE, library)
    assert diagnosis.verdict in ('unknown_effect', 'undecided')
    assert all(name.startswith('learned:') for name in diagnosis.accepted)
    assert diagnosis.p_value < 0.01
    curve = diagnosis.unknown.curve
    assert set(curve) == {diagnosis.unknown.covariate, 'residual_um'}
    assert np.isfinite(list(curve.values())).all()


def test_a_wrong_footprint_is_not_blamed_on_physics(tmp_path):
    campaign = small_campaign(tmp_path, **DOOR | {'seed': 22, 'truth': 'footprint:two_lobes'})
    diagnosis = diagnose(campaign, BASE, EFFECTS)
    assert diagnosis.verdict in ('none_missing', 'unknown_effect')
    assert set(diagnosis.accepted) <= {'learned:footprint'}
    peak = diagnosis.to_dict()['footprint']['deviation_of_peak']
    assert peak == diagnosis.discrepancy.footprint_of_peak > 0.1
    assert pd.calibrate(campaign).discrepancy.footprint_of_peak > 0.1


def test_what_a_footprint_could_show_as_well_is_blamed_on_nothing_else(tmp_path):
    """Displacement with the square of the way; a tilted gun and a shifted part look like it."""
    hidden = {'seed': 1, 'truth': 'air_drift~square', 'amplitude': 0.04, 'readings': 120}
    campaign = small_campaign(tmp_path, **DOOR | hidden)
    diagnosis = diagnose(campaign, BASE, EFFECTS)
    named = {m for c in diagnosis.classes if c.best in diagnosis.accepted for m in c.members}
    families = {EFFECTS[name].family for name in named if name in EFFECTS}
    assert families <= {'lateral shift'}
    assert diagnosis.p_value < 0.05


def test_an_effect_in_the_start_model_is_refitted_and_not_found_again(shielded):
    start = pd.DepositionModel(effects=(SHIELDING(shielding=0.1),))
    diagnosis = diagnose(shielded, start, {SHIELDING.id: SHIELDING})
    assert diagnosis.verdict == 'none_missing'
    assert diagnosis.accepted == ()
    assert diagnosis.model.effect('faraday_shielding').shielding == pytest.approx(0.35, abs=0.12)


def test_a_few_readings_are_too_few_and_a_path_that_misses_the_part_is_told(clean):
    for points in (2, 11):
        few = clean.with_readings(clean.readings.select(clean.readings.owner < points))
        diagnosis = diagnose(pd.Campaign((few,)), BASE, {})
        assert diagnosis.verdict == 'fit_broken'
        assert f'{points} points cannot determine 7 parameters' in diagnosis.reason
    off = clean.path.with_(flow=np.zeros(len(clean.path)))
    campaign = pd.Campaign((replace(clean, path=off),))
    for diagnosis in (diagnose(campaign, BASE, {}), refit(campaign, BASE, SHIELDING)):
        assert diagnosis.verdict == 'fit_broken'
        assert 'leaves 100 % of the points bare, where the gauge found paint' in diagnosis.reason


def test_no_probability_is_printed_as_certain():
    told = [percent(probability) for probability in (1.0, 0.9951, 0.97, 0.004, 0.0)]
    assert told == ['> 99 %', '> 99 %', '97 %', '< 1 %', '< 1 %']


# Small panels that the model itself painted, and a library of three effects: a diagnosis is cheap.
LIBRARY = {name: EFFECTS[name] for name in ('fog_gradient', 'flow_drift', 'air_drift')}


def test_two_effects_are_found_each_with_a_step_that_improves_the_prediction():
    """On two panels, painted in opposite orders."""
    acting = EFFECTS['fog_gradient'](fog_um=6.0), EFFECTS['flow_drift'](drift_per_pass=0.1)
    truth = pd.DepositionModel(effects=acting)
    campaign = gauged(truth, seed=0, orders=ORDERS)
    one = diagnose(campaign, BASE, {'flow_drift': LIBRARY['flow_drift']})
    assert one.accepted == ('flow_drift',)
    assert one.reason.endswith(f' They show more than that (p = 0.0011). {one.unknown}')
    found = diagnose(campaign, BASE, LIBRARY)
    assert found.verdict == 'effect_missing'
    assert found.unknown is None
    # A footprint that the readings learned beside them is no effect.
    named = set(found.accepted) - {'learned:footprint'}
    assert named == {'fog_gradient', 'flow_drift'}
    assert all(name in found.reason for name in named)
    accepted = found.classes[: len(found.accepted)]
    assert [c.best for c in accepted] == list(found.accepted)
    assert all(c.probability > SURE for c in accepted)
    steps = found.history
    assert [step.added for step in steps] == ['', *found.accepted]
    for before, after, group in zip(steps, steps[1:], found.classes, strict=False):
        assert after.rmse_um < before.rmse_um
        errors = {'before': before.holdout_rmse_um, 'after': after.holdout_rmse_um}
        assert group.holdout_rmse_um == errors
    assert steps[-1].rmse_um < 1.2 * found.study.noise_floor_um
    assert {effect.id for effect in found.model.effects} == set(found.accepted)
    assert found.model.effect('fog_gradient').fog_um == pytest.approx(6.0, abs=1.2)
    assert found.model.effect('flow_drift').drift_per_pass == pytest.approx(0.1, abs=0.03)


def test_a_stripe_on_parts_painted_alike_is_unknown_with_its_place():
    """An upright stripe lost a fifth of its film on three panels."""
    panels = []
    for number in range(3):
        (panel,) = gauged(BASE, seed=number, columns=7).experiments
        across_m = panel.readings.positions_m[:, 0]
        lost = 0.2 * np.exp(-0.5 * ((across_m - 0.15) / 0.08) ** 2)
        striped = reading(panel, panel.readings.thickness_um * (1.0 - lost))
        panels.append(replace(striped, name=f'panel {number + 1}'))
    found = diagnose(pd.Campaign(tuple(panels)), BASE, EFFECTS)
    assert found.verdict == 'unknown_effect'
    assert found.p_value < ALPHA
    assert not [name for name in found.accepted if not name.startswith('learned:')]
    unknown = found.unknown
    assert unknown.parts == ('panel 1', 'panel 2', 'panel 3')
    assert -0.25 < unknown.share < -0.03
    assert 'of the width from the left' in unknown.where
    assert str(unknown) in found.reason
    assert 'Spray the same part another way' in found.reason
    rmse_um = found.to_dict()['rmse_um']
    for when in ('before', 'after'):
        square = rmse_um[f'beyond_noise_{when}'] ** 2 + rmse_um['noise_floor'] ** 2
        most = max(rmse_um[f'holdout_{when}'], rmse_um['noise_floor'])
        assert square == pytest.approx(most**2)
    assert rmse_um['holdout_after'] < rmse_um['holdout_before']


PARTS, A_DAY, READINGS, TURNS = 40, 10, 36, 6
GREATEST = 0.8
MANY = {
    'seed': 3, 'truth': 'faraday_shielding', 'amplitude': GREATEST, 'experiments': ('door',),
    'readings': READINGS, 'repeats': 0, 'heldout': 1, 'style': 'random', 'parcels': 2_000_000,
    'mesh_edge_m': 0.03,
}  # fmt: skip


@pytest.mark.skipif('PAINT_LONG' not in os.environ, reason='over a minute: make many')
def test_an_effect_that_grows_over_each_day_is_named_with_its_mean(tmp_path):
    """Forty parts over four days, alike but for it."""
    (door,) = small_campaign(tmp_path, **MANY).experiments
    painted = generated(**MANY)
    shown = painted.experiments[0].readings
    parts = []
    for row in range(PARTS):
        share = row % A_DAY / (A_DAY - 1)
        film_um = shown.clean_um + share * (shown.expected_um - shown.clean_um)
        noise = GaugeNoise(level=0.015)
        read_um, *_ = measure(shown.point, film_um, film_um, noise, stream(row, 80))
        taken = reading(door, read_um).readings
        taken = taken.select(np.arange(READINGS) % TURNS == row % TURNS)
        parts.append(replace(door.with_readings(taken), name=f'part {row}'))
    pattern = painted.truth['pattern']
    planar = PlanarPattern(**{name: pattern[name] for name in PlanarPattern.model_fields})
    start = time.process_time()
    found = diagnose(pd.Campaign(tuple(parts)), pd.DepositionModel(planar=planar), EFFECTS)
    assert time.process_time() - start < 120.0  # of one core, on any machine
    assert found.accepted == ('faraday_shielding',)
    shielding = found.classes[0].parameters['shielding']
    assert shielding.low < GREATEST / 2 < shielding.high
