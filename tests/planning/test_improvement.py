"""Speeds, flows and triggers of a given programme, chosen for an even film."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import paint_deposition as pd
from paint_deposition.effects.learned.curves import CURVES, LearnedAcross
from paint_deposition.effects.library.trigger_lag import TriggerLag
from paint_deposition.errors import PlanError
from paint_deposition.inference.fitting.draws import drawn
from paint_deposition.inference.posterior import Posterior
from paint_deposition.model.pattern import PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.planning.improvement.limits import Limits
from paint_deposition.planning.improvement.nodes import Nodes, timed_anew
from paint_deposition.planning.improvement.programme import Programme
from paint_deposition.planning.plan import plan
from paint_deposition.planning.plan_request import PlanRequest
from planning.test_surface_map import sheet

NARROW = pd.DepositionModel(
    planar=PlanarPattern(K1_cm3_per_s=1.0, K3=0.1, r_m=0.1, sigma1_m=0.06, sigma2_m=0.1)
)
# More to the right, by 30 % over the width of the panel.
SKEWED = NARROW.with_effect(LearnedAcross(low=-0.3, high=0.3, learned=(-0.15, 0.15)))


@pytest.fixture(scope='module')
def panel():
    return sheet(lambda x, z: 0.0 * x, half_m=0.25, count=13)


@pytest.fixture(scope='module')
def even(panel):
    """Level passes at one speed, even in the model without effects."""
    return plan(
        panel, NARROW, PlanRequest(speed_m_per_s=0.3, overspray_m=0.2, index_m=0.15), 'part'
    )


@pytest.fixture(scope='module')
def levelled(panel, even):
    """Their film with the effect, levelled."""
    return pd.improve(panel, even.trajectory, SKEWED, paint_weight=0.0)


def speeds_of(trajectory):
    """Speed and acceleration where the gun sprays, from the poses themselves, and their places."""
    seconds = trajectory.stamps_ns * 1e-9
    steps = np.diff(seconds)
    velocity = np.diff(trajectory.positions_m, axis=0) / steps[:, np.newaxis]
    speed = np.linalg.norm(velocity, axis=1)
    middle = 0.5 * (seconds[1:] + seconds[:-1])
    row = np.searchsorted(trajectory.trigger_stamps_ns * 1e-9, middle) - 1
    on = (row >= 0) & (trajectory.trigger_flow[np.maximum(row, 0)] > 0.0)
    both = on[1:] & on[:-1] & (row[1:] == row[:-1])
    change = np.diff(speed) / np.diff(middle)
    places = 0.5 * (trajectory.positions_m[1:] + trajectory.positions_m[:-1])
    return speed[on], change[both], places[on]


# --- the path and its timing


def test_a_programme_timed_at_its_own_slowness_is_itself(panel, even):
    given = Programme.of(even.trajectory)
    nodes = Nodes.of(given.openings, 0.03)
    again = timed_anew(given, nodes, np.full(len(nodes), 1.0 / 0.3), Limits())
    assert again.duration_s.sum() == pytest.approx(given.duration_s.sum(), rel=1e-5)
    film = [pd.simulate(panel, p.trajectory(), NARROW).film_um for p in (given, again)]
    np.testing.assert_allclose(film[1], film[0], rtol=1e-3)


def test_time_between_nodes_is_the_integral_of_slowness(even):
    given = Programme.of(even.trajectory)
    nodes = Nodes.of(given.openings, 0.05)
    slowness = 3.0 + np.sin(5.0 * nodes.travel_m)
    rows = nodes.rows(0)
    whole = nodes.elapsed_s(0, slowness, nodes.travel_m[rows][-1:])[0]
    assert whole == pytest.approx(np.trapezoid(slowness[rows], nodes.travel_m[rows]), rel=1e-12)
    assert whole == pytest.approx((nodes.weights_m * slowness)[rows].sum(), rel=1e-12)


# --- the film


@pytest.mark.slow
def test_speed_takes_away_what_an_effect_lays_too_much(levelled):
    """The film is linear in dwell: faster to the right as the effect lays more there."""
    assert levelled.before.sigma_n > 0.07
    assert levelled.after.sigma_n < 0.25 * levelled.before.sigma_n
    speed, _, places = speeds_of(levelled.trajectory)
    inside = np.abs(places[:, 0]) < 0.15
    slope, level = np.polyfit(places[inside, 0], speed[inside], 1)
    # 1 + h rises by 0.5 a metre.
    assert slope / level == pytest.approx(0.5, rel=0.2)


@pytest.mark.slow
def test_the_mean_stays_and_the_path_too(levelled):
    assert levelled.after.mean_um == pytest.approx(levelled.before.mean_um, rel=3e-3)
    given, new = levelled.given.positions_m, levelled.trajectory.positions_m
    assert cKDTree(given).query(new)[0].max() < 0.004


@pytest.mark.slow
def test_a_target_is_met(panel, even):
    better = pd.improve(panel, even.trajectory, SKEWED, target_um=1.2 * even.mean_um)
    assert better.after.mean_um == pytest.approx(1.2 * even.mean_um, rel=5e-3)


@pytest.mark.slow
def test_paint_used_is_flow_times_time(panel, even):
    better = pd.improve(
        panel, even.trajectory, SKEWED, flow_min=0.8, flow_max=1.2, speed_max_m_per_s=0.32
    )
    path, _ = spray_path(better.trajectory)
    assert better.after.paint_cm3 == pytest.approx(1.0 * path.spraying_time_s, rel=1e-9)
    opened = better.trajectory.trigger_flow[better.trajectory.trigger_flow > 0.0]
    assert np.all((opened >= 0.8 - 1e-6) & (opened <= 1.2 + 1e-6))
    # The same flows are in the robot program.
    np.testing.assert_allclose(
        np.unique(np.round([m.flow for m in better.moves if m.spraying], 4)),
        np.unique(np.round(opened, 4)),
    )
    assert better.program_difference < 1e-3


@pytest.mark.slow
def test_paint_that_is_dear_is_kept_off_the_air(panel, even):
    free, dear = (
        pd.improve(panel, even.trajectory, NARROW, paint_weight=weight) for weight in (0.0, 0.02)
    )
    assert dear.after.paint_cm3 < 0.93 * free.after.paint_cm3
    assert dear.after.mean_um == pytest.approx(free.after.mean_um, rel=0.01)
    assert any(change.opens_earlier_m < -0.01 for change in dear.changes)
    assert 'later' in dear.changes[0].sentence


@pytest.mark.slow
def test_flow_that_lags_behind_the_trigger_is_followed(panel, even):
    """What is foretold comes true although the flow depends on the time since the opening."""
    lagging = NARROW.with_effect(TriggerLag(rise_s=0.15, fall_s=0.1))
    better = pd.improve(panel, even.trajectory, lagging)
    assert better.after.sigma_n < better.before.sigma_n
    assert better.retiming.sigma_n[1] == pytest.approx(better.after.sigma_n, abs=0.003)


# --- limits


@pytest.mark.slow
def test_the_written_motion_keeps_the_limits(panel, even):
    better = pd.improve(
        panel, even.trajectory, SKEWED,
        speed_min_m_per_s=0.28, speed_max_m_per_s=0.33, acceleration_m_per_s2=0.1,
        trigger_shift_m=0.0,
    )  # fmt: skip
    speed, change, _ = speeds_of(better.trajectory)
    assert speed.min() > 0.28 * (1.0 - 1e-4)
    assert speed.max() < 0.33 * (1.0 + 1e-4)
    assert np.abs(change).max() < 0.1 * 1.02
    lengths = [
        np.linalg.norm(b.position_m - a.position_m)
        for a, b in zip(better.moves, better.moves[1:], strict=False)
        if b.spraying
    ]
    assert min(lengths) > 0.02 * (1.0 - 1e-3)


@pytest.mark.slow
def test_a_wish_out_of_reach_gets_the_closest_and_the_limit_s_name(panel, even, levelled):
    slow = pd.improve(
        panel, even.trajectory, SKEWED, speed_min_m_per_s=0.295, speed_max_m_per_s=0.305,
        tolerance=0.01,
    )  # fmt: skip
    assert levelled.after.sigma_n < slow.after.sigma_n < slow.before.sigma_n
    names = ' '.join(held.name for held in slow.retiming.held_back)
    assert 'speed' in names
    assert any(line.startswith('held back by the') for line in slow.limit_sentences)


@pytest.mark.parametrize(
    ('wanted', 'words'),
    [
        ({'speed_min_m_per_s': 0.5, 'speed_max_m_per_s': 0.4}, 'speed_min_m_per_s is 0.5, above'),
        ({'acceleration_m_per_s2': 0.0}, 'acceleration_m_per_s2 is 0'),
        ({'paint_weight': -1.0}, 'paint_weight is -1'),
        ({'speed': 0.4}, 'speed is no option of improve'),
    ],
)
def test_impossible_limits_are_named(panel, even, wanted, words):
    with pytest.raises(PlanError, match=words):
        pd.improve(panel, even.trajectory, NARROW, **wanted)


# --- files and models


@pytest.mark.slow
def test_bag_and_robot_program_lay_the_same_film(levelled, panel, tmp_path):
    pd.write(levelled, tmp_path)
    films = [
        pd.simulate(panel, pd.read_recording(tmp_path / name), SKEWED).film_um
        for name in ('trajectory', 'passes.mod', 'passes.csv')
    ]
    np.testing.assert_allclose(films[0], levelled.after.film_um, rtol=1e-6)
    for film in films[1:]:
        assert np.abs(film - films[0]).max() < 1e-3 * films[0].max()
    assert levelled.program_difference < 1e-3


def _known(**widths):
    """What is known of the bell: these standard deviations, next to none else."""
    p = SKEWED.planar
    means = {
        'log_K1': np.log(p.K1_cm3_per_s), 'K2': p.K2, 'K3_cos_phi': p.K3 * np.cos(p.phi_rad),
        'K3_sin_phi': p.K3 * np.sin(p.phi_rad), 'r_m': p.r_m,
        'log_sigma1': np.log(p.sigma1_m), 'log_sigma2': np.log(p.sigma2_m),
    }  # fmt: skip
    rows = np.diag([widths.get(name, 1e-6) ** 2 for name in means]).tolist()
    return Posterior(mean=means, covariance=dict(zip(means, rows, strict=True)))


@pytest.mark.slow
def test_an_uncertain_model_has_its_interval(panel, even):
    known = _known(
        log_K1=0.05, K2=0.03, K3_cos_phi=0.03, K3_sin_phi=0.03, r_m=0.004, log_sigma1=0.05,
        log_sigma2=0.05,
    )  # fmt: skip
    better = pd.improve(panel, even.trajectory, SKEWED, posterior=known)
    (low, high), (new_low, new_high) = better.sigma_n_interval
    assert low < better.before.sigma_n < high
    assert new_low < new_high
    assert new_high < high


@pytest.mark.slow
def test_a_level_that_is_not_known_costs_no_evenness(panel, even, levelled):
    known = _known(log_K1=0.2)
    unsure = pd.improve(panel, even.trajectory, SKEWED, posterior=known, paint_weight=0.0)
    assert unsure.after.sigma_n == pytest.approx(levelled.after.sigma_n, rel=0.02)
    assert unsure.after.mean_um == pytest.approx(levelled.after.mean_um, rel=2e-3)


def test_draws_follow_the_band_of_a_learned_curve():
    sd = (0.05, 0.1, 0.2, 0.1, 0.05, 0.02, 0.02, 0.1)
    law = CURVES['spray_pass'](low=0, high=3, learned=(0.1,) * 8, sd=sd)
    plain = CURVES['speed_m_per_s'](learned=(0.1, 0.2))
    model = SKEWED.model_copy(update={'effects': (law, plain)})
    models = drawn(model, _known(), 2000, seed=4)
    values = np.array([one.effects[0].learned for one in models])
    np.testing.assert_allclose(values.mean(axis=0), law.learned, atol=4 * max(sd) / 2000**0.5)
    np.testing.assert_allclose(values.std(axis=0), sd, rtol=0.08)
    assert all(one.effects[1] == plain for one in models)


def test_given_motion_without_a_trigger_or_with_gaps(panel, even):
    always = replace(
        even.trajectory, trigger_stamps_ns=np.empty(0, np.int64), trigger_flow=np.empty(0)
    )
    assert len(Programme.of(always).openings) == 1
    late = even.trajectory.stamps_ns.copy()
    late[len(late) // 2 :] += 400_000_000
    assert len(Programme.of(replace(always, stamps_ns=late)).openings) == 2
