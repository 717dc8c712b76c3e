"""Speeds, flows and triggers of a given programme, chosen for an even film."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import paint_deposition as pd
from booth import LOOKING_ALONG_Y
from brushes import switched
from paint_deposition.effects.catalogue import LEARNED
from paint_deposition.effects.library.trigger_lag import TriggerLag
from paint_deposition.errors import PaintError
from paint_deposition.inference.fitting.parameters import Posterior
from paint_deposition.inference.fitting.pattern_vector import PatternVector
from paint_deposition.model.eq1_pattern import PATTERN, PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move, timed
from paint_deposition.part.zones import Zone, Zones
from paint_deposition.planning.plan import plan
from paint_deposition.planning.programme import Programme, moves_of
from paint_deposition.planning.requests import ImproveRequest, PlanRequest
from paint_deposition.report.plan_pictures import write_improvement_picture
from scenes import stamps_ns, straight_pass
from surfaces import sheet

NARROW = pd.DepositionModel(
    planar=PlanarPattern(K1_cm3_per_s=1.0, K3=0.1, r_m=0.1, sigma1_m=0.06, sigma2_m=0.1)
)
# More to the right, by 30 % over the width of the panel.
SKEWED = NARROW.with_effect(LEARNED['across_m'](low=-0.3, high=0.3, learned=(-0.15, 0.15)))


@pytest.fixture(scope='module')
def panel():
    return sheet(lambda x, z: 0.0 * x, half_m=0.25, count=13)


@pytest.fixture(scope='module')
def even(panel):
    """Level passes at one speed, even in the model without effects."""
    request = PlanRequest(speed_m_per_s=0.3, overspray_m=0.2, index_m=0.15)
    return plan(panel, NARROW, request, 'part')


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
    assert levelled.after.mean_um == pytest.approx(levelled.before.mean_um, rel=3e-3)
    original, new = levelled.before.trajectory.positions_m, levelled.trajectory.positions_m
    assert cKDTree(original).query(new)[0].max() < 0.004


@pytest.mark.slow
def test_a_target_is_met_and_paint_used_is_flow_times_time(panel, even):
    wanted_um = 1.1 * even.mean_um
    wanted = {'target_um': wanted_um, 'flow': (0.8, 1.2), 'speed_max_m_per_s': 0.32}
    better = pd.improve(panel, even.trajectory, SKEWED, **wanted)
    assert better.after.mean_um == pytest.approx(wanted_um, rel=5e-3)
    path, _ = spray_path(better.trajectory)
    assert better.after.paint.emitted_cm3 == pytest.approx(1.0 * path.spraying_time_s, rel=1e-9)
    opened = better.trajectory.trigger_flow[better.trajectory.trigger_flow > 0.0]
    assert np.all((opened >= 0.8 - 1e-6) & (opened <= 1.2 + 1e-6))
    in_program = np.unique(np.round([m.flow for m in better.moves if m.spraying], 4))
    np.testing.assert_allclose(in_program, np.unique(np.round(opened, 4)))
    assert better.program_difference < 1e-3
    assert better.warnings == ()


@pytest.mark.slow
def test_paint_that_is_dear_is_kept_off_the_air(panel, even):
    motion = even.trajectory
    free, dear = (pd.improve(panel, motion, NARROW, paint_weight=w) for w in (0.0, 0.02))
    assert dear.after.paint.emitted_cm3 < 0.93 * free.after.paint.emitted_cm3
    assert dear.after.mean_um == pytest.approx(free.after.mean_um, rel=0.01)
    assert any(change.opens_earlier_m < -0.01 for change in dear.changes)
    assert 'later' in dear.changes[0].sentence


@pytest.mark.slow
def test_flow_that_lags_behind_the_trigger_is_followed(panel, even):
    """The predicted film is laid although the flow depends on the time since the opening."""
    lagging = NARROW.with_effect(TriggerLag(rise_s=0.15, fall_s=0.1))
    better = pd.improve(panel, even.trajectory, lagging)
    assert better.after.sigma_n < better.before.sigma_n
    assert better.after.sigma_n < 1.1 * better.sigma_n_of_path + 0.003


@pytest.mark.slow
def test_the_written_motion_keeps_the_limits_and_names_those_that_cost(panel, even, levelled):
    held = pd.improve(
        panel, even.trajectory, SKEWED, tolerance=0.01, trigger_shift_m=0.0,
        speed_min_m_per_s=0.29, speed_max_m_per_s=0.32, acceleration_m_per_s2=0.1,
    )  # fmt: skip
    speed, change, _ = speeds_of(held.trajectory)
    assert speed.min() > 0.29 * (1.0 - 1e-4)
    assert speed.max() < 0.32 * (1.0 + 1e-4)
    assert np.abs(change).max() < 0.1 * 1.02
    legs_m = [b.position_m - a.position_m for a, b in pairwise(held.moves) if b.spraying]
    assert np.linalg.norm(legs_m, axis=1).min() > 0.02 * (1.0 - 1e-3)
    assert levelled.after.sigma_n < held.after.sigma_n < held.before.sigma_n
    assert 'speed' in ' '.join(held.binding_limits)
    assert any(line.startswith('limited by the') for line in held.limit_sentences)


@pytest.mark.slow
def test_a_mean_that_the_limits_do_not_allow_is_warned_of(panel, even):
    """The programme runs at 0.3 m/s: slower than 0.24 it lays a quarter more."""
    slow = pd.improve(panel, even.trajectory, NARROW, speed_max_m_per_s=0.24)
    assert slow.after.mean_um > 1.1 * slow.target_um
    (warning,) = slow.warnings
    assert 'the greatest speed' in warning
    assert 'allow a greater speed (--speed-max) or a lower flow (--flow)' in warning


@pytest.mark.slow
def test_no_weights_reach_below_the_most_even_film_of_the_path(panel, even, levelled):
    wanted = {'paint_weight': 0.0, 'smoothness': 0.0, 'speed_max_m_per_s': 3.0}
    free = pd.improve(panel, even.trajectory, SKEWED, **wanted)
    assert free.after.sigma_n < 1.001 * levelled.after.sigma_n
    assert levelled.sigma_n_of_path < 1.02 * free.after.sigma_n
    assert levelled.sigma_n_of_path <= levelled.after.sigma_n


@pytest.mark.parametrize(
    ('wanted', 'words'),
    [
        ({'speed_min_m_per_s': 0.5, 'speed_max_m_per_s': 0.4}, 'speed_min_m_per_s is 0.5, above'),
        ({'speed': 0.4}, "unknown key 'speed'"),
        ({'flow': (0.0, 1.0)}, 'flow.0 is 0'),
        ({'flow': (1.2, 0.8)}, 'swap the two'),
    ],
)
def test_impossible_limits_are_named(panel, even, wanted, words):
    with pytest.raises(PaintError, match=words):
        pd.improve(panel, even.trajectory, NARROW, **wanted)


@pytest.mark.slow
def test_a_level_that_is_not_known_costs_no_evenness(panel, even, levelled):
    of = [coordinate.name for coordinate in PATTERN]
    mean = PatternVector().encode([SKEWED.planar])
    rows = np.diag([0.04 if name == 'log_K1' else 1e-12 for name in of]).tolist()
    known = Posterior(
        mean=dict(zip(of, mean, strict=True)), covariance=dict(zip(of, rows, strict=True))
    )
    unsure = pd.improve(panel, even.trajectory, SKEWED, posterior=known, paint_weight=0.0)
    assert unsure.after.sigma_n == pytest.approx(levelled.after.sigma_n, rel=0.02)
    assert unsure.after.mean_um == pytest.approx(levelled.after.mean_um, rel=2e-3)


# 0.3 m/s along x from -0.6 m: brush 1, then 2 without closing, off, and 2 at another flow.
CHANGES = switched(stamps_ns([0.5, 1.5, 2.0, 3.0, 3.5]), (1, 1), (1, 2), (0, 0), (0.5, 2), (0, 0))
SWITCHED = replace(straight_pass(np.arange(0.0, 4.001, 0.02)), **CHANGES)


def test_openings_end_where_the_brush_changes_also_between_poses_and_moves_keep_it():
    programme = Programme.of(SWITCHED)
    found = np.column_stack([programme.ends_m, programme.flow, programme.brush])
    expected = [(0.15, 0.45, 1.0, 1), (0.45, 0.6, 1.0, 2), (0.9, 1.05, 0.5, 2)]
    np.testing.assert_allclose(found, expected, atol=1e-6)
    opened = [(flow, brush) for _, flow, brush in programme.trajectory().triggers if flow]
    assert opened == [(1.0, 1), (1.0, 2), (0.5, 2)]
    moves = [(m.flow, m.brush) for m in moves_of(programme, ImproveRequest()) if m.spraying]
    assert list(dict.fromkeys(moves)) == [(1.0, 1), (1.0, 2), (0.5, 2)]
    # The first pose, left from standstill, is come to as fast as the gun is opened.
    from_rest = replace(programme, duration_s=np.append(4.0, programme.duration_s[1:]))
    assert moves_of(from_rest, ImproveRequest())[0].speed_m_per_s == pytest.approx(0.3)
    # Two openings meet where no pose is: none takes no time.
    flows = switched(stamps_ns([0.503, 1.507, 2.0]), (1, 1), (1, 2), (0, 0))
    programme = Programme.of(replace(SWITCHED, **flows))
    assert (np.diff(programme.trajectory().stamps_ns) > 0).all()
    spraying = [m for m in moves_of(programme, ImproveRequest()) if m.spraying]
    assert list(dict.fromkeys(m.brush for m in spraying)) == [1, 2]
    assert max(m.speed_m_per_s for m in spraying) < 0.301


@pytest.mark.slow
def test_a_short_pass_is_a_change_and_a_gun_that_looks_along_the_part_is_refused(tmp_path):
    small = sheet(lambda x, z: 0.0 * x, half_m=0.05)

    def over(quaternion, y_m):
        places = [np.array([x, y_m, 0.0]) for x in (-0.1, -0.02, 0.02, 0.1)]
        moves = [Move(at, quaternion, 0.1, spraying=k == 2) for k, at in enumerate(places)]
        return timed(moves, gun_known=True)

    found = pd.improve(small, over(LOOKING_ALONG_Y, -0.25), NARROW, trigger_shift_m=0.0)
    assert [change.number for change in found.changes] == [1]
    assert write_improvement_picture(tmp_path / 'improvement.png', found).exists()
    aside = Rotation.from_euler('z', -80.0, degrees=True) * Rotation.from_quat(LOOKING_ALONG_Y)
    with pytest.raises(PaintError, match='nowhere does the gun face what it paints'):
        pd.improve(small, over(aside.as_quat(), -0.04), NARROW)


@pytest.mark.slow
def test_the_gun_is_closed_in_turns_beside_the_part(panel):
    """Four moves at one speed with the gun open throughout: two passes, and the turns between."""
    corners = [(-0.5, 0.1), (0.5, 0.1), (0.5, -0.1), (-0.5, -0.1), (-0.5, -0.4)]
    places = (np.array([x, -0.25, z]) for x, z in corners)
    moves = [Move(at, LOOKING_ALONG_Y, 0.3, spraying=True) for at in places]
    moves.insert(1, replace(moves[0], wait_s=0.5))
    through = timed(moves, gun_known=True)
    closed, kept = (pd.improve(panel, through, NARROW, spray_turns=k) for k in (False, True))
    path, _ = spray_path(closed.trajectory)
    sprayed = path.position_m[path.flow > 0.0]
    assert np.abs(sprayed[:, 2]).max() < 0.11
    assert np.abs(np.abs(sprayed[:, 2]) - 0.1).max() < 0.01
    assert closed.after.paint.emitted_cm3 < 0.9 * kept.after.paint.emitted_cm3
    assert closed.target_um == pytest.approx(closed.before.mean_um, rel=1e-3)
    assert [change.number for change in closed.changes] == [1, 2]
    assert np.unique(path.spray_pass[path.flow > 0.0]).tolist() == [0, 1]
    assert 'earlier' not in ''.join(change.sentence for change in closed.changes)
    assert closed.program_difference < 2e-3
    assert any('--spray-turns' in note for note in closed.notes)
    assert kept.notes == ()
    # In turns that are sprayed through no trigger is earlier or later.
    one, other = kept.changes
    assert one.closes_later_m == other.opens_earlier_m == 0.0


def test_gaps_between_poses_close_the_gun_and_flows_are_averaged():
    always = replace(
        SWITCHED, trigger_stamps_ns=np.empty(0, np.int64), trigger_flow=np.empty(0),
        trigger_brush=np.empty(0, np.int64),
    )  # fmt: skip
    late = always.stamps_ns.copy()
    late[len(late) // 2 :] += 400_000_000
    both = always, replace(always, stamps_ns=late)
    assert [len(Programme.of(motion).ends_m) for motion in both] == [1, 2]
    flows = switched(stamps_ns([0.5, 1.5, 2.0]), (1.0, 1), (0.4, 1), (0, 0))
    assert Programme.of(replace(SWITCHED, **flows)).flow == pytest.approx([0.8])


def zone(name, target_um, tolerance_um, low_x=-1.0, high_x=1.0):
    box = np.array([[low_x, -1.0, -1.0], [high_x, 1.0, 1.0]])
    return Zone(name, target_um, tolerance_um, box)


@pytest.mark.slow
def test_each_zone_comes_to_its_target(panel, even):
    """The gun is slower over the half that is to be thicker; between them the spray blends."""
    thin, thick = 0.9 * even.mean_um, 1.25 * even.mean_um
    # Between the halves is a strip as wide as the spray, in which any film will do.
    zones = Zones((
        zone('left', thin, 0.1 * thin, high_x=-0.06), zone('right', thick, 0.1 * thick, 0.06),
    ))  # fmt: skip
    found = pd.improve(panel, even.trajectory, NARROW, zones=zones, paint_weight=0.0)
    left, right = found.after.statistics.zones.values()
    assert (left.mean_um, right.mean_um) == pytest.approx((thin, thick), rel=0.04)
    before, after = (one.statistics.zones for one in (found.before, found.after))
    for name in ('left', 'right'):
        assert after[name].within_target > before[name].within_target + 0.2
    assert found.after.sigma_n < 0.4 * found.before.sigma_n
    written = {one['name']: one['after']['mean_um'] for one in found.to_dict()['zones']}
    assert written == {'left': left.mean_um, 'right': right.mean_um}
    x = panel.vertices_m[:, 0]
    assert not found.wanted.region[np.abs(x) < 0.059].any()


@pytest.mark.slow
def test_one_zone_over_all_is_the_target_of_the_part(panel, even):
    target = 1.1 * even.mean_um
    whole = Zones((zone('all', target, 0.1 * target),))
    of_zone = pd.improve(panel, even.trajectory, NARROW, zones=whole)
    of_part = pd.improve(panel, even.trajectory, NARROW, target_um=target, tolerance=0.1)
    np.testing.assert_allclose(of_zone.after.film_um, of_part.after.film_um, rtol=1e-9)
    assert of_zone.after.sigma_n == pytest.approx(of_part.after.sigma_n, rel=1e-9)
    assert of_zone.after.within == pytest.approx(of_part.after.within)


@pytest.mark.slow
def test_a_plan_for_zones_needs_no_other_target(panel):
    zones = Zones((zone('left', 15.0, 2.0, high_x=0.0), zone('right', 20.0, 2.0)))
    found = pd.plan(panel, NARROW, zones=zones, overspray_m=0.2)
    left, right = found.statistics.zones.values()
    assert (left.mean_um, right.mean_um) == pytest.approx((15.0, 20.0), abs=1.0)
    assert found.unoptimised.sigma_n > 1.5 * found.sigma_n
    with pytest.raises(PaintError, match="zone 'far' holds no vertex"):
        pd.plan(panel, NARROW, zones=Zones((zone('far', 9.0, 1.0, low_x=3.0, high_x=4.0),)))
