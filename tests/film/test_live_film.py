"""The live film is the offline film, whatever way the motion comes in."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
import scenes
from brushes import two_brushes
from paint_deposition.effects.catalogue import effect_class
from paint_deposition.errors import ModelError
from paint_deposition.film.common_film import LiveFilms
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.motion.pose_stream import PoseBatch, TriggerChange, events_of
from scenes import lying_plane, painted, poses, stamps_ns, straight_pass

MODEL = pd.DepositionModel()
# Its film at a place depends on what lies ahead in the stroke.
LAGGING = MODEL.with_effect(effect_class('corner_slowdown').typical())
TIMES_S = np.arange(0.0, 4.0, 0.004)
CHANGES_NS, FLOW = stamps_ns([0.5013, 1.7502, 2.2]), np.array([1.0, 0.0, 0.8])
TRIGGERS = {'trigger_stamps_ns': CHANGES_NS, 'trigger_flow': FLOW}


def change(time_s: float, flow: float) -> TriggerChange:
    return TriggerChange(int(stamps_ns(time_s)), flow)


def followed(coming, model=MODEL, **options):
    film = LiveFilm(lying_plane(), model, **options)
    film.replay(coming)
    return film


@pytest.mark.slow
@pytest.mark.parametrize(('batch', 'delay_s'), [(1, 0.05), (25, 0.0), (25, 0.0999)])
def test_a_state_that_comes_a_little_late_cuts_where_it_belongs(batch, delay_s):
    motion = straight_pass(TIMES_S, **TRIGGERS)
    # A batch of 25 poses is 0.1 s long and comes at its end.
    latency_s = 0.1 + (0.1 if batch == 25 else 0.0)
    film = followed(scenes.events(motion, batch, delay_s), trigger_latency_s=latency_s)
    assert np.array_equal(film.snapshot().film_um, painted(lying_plane(), motion).film_um)
    assert film.counts.late_triggers == 0


def test_a_reset_before_any_pose_forgets_no_state():
    """A run begins with the states in force, and no other is announced where none has a pose."""
    motion = straight_pass(TIMES_S, **TRIGGERS)
    first, *rest = scenes.changes_of(motion)
    # By a clock that is an hour behind for a moment.
    behind = TriggerChange(first.stamp_ns - 3_600_000_000_000, 0.0)
    found_um = []
    for resets in (1, 2):
        films = LiveFilms((LiveFilm(lying_plane(), MODEL),))
        films.guns[0].replay([first, poses(motion, slice(0, 200))])
        films.reset()
        films.guns[0].add_trigger(behind)
        for _ in range(resets - 1):
            films.reset()
        films.guns[0].replay([*rest, poses(motion, slice(200, None))])
        found_um.append(films.snapshot().film_um)
    assert found_um[0].max() > 1.0
    assert np.array_equal(*found_um)


@pytest.mark.slow
def test_a_state_that_comes_too_late_is_counted_and_counts_from_there_on():
    motion = straight_pass(TIMES_S, **TRIGGERS)
    film = followed(scenes.events(motion, 1, delay_s=0.15))
    assert film.counts.late_triggers >= 2
    # Each change acts 0.05 s late, at 0.3 m/s on a film of some ten um/s.
    difference = np.abs(film.snapshot().film_um - painted(lying_plane(), motion).film_um).max()
    assert 0.05 < difference < 2.0


def test_the_first_state_takes_back_what_was_painted_before_it():
    motion = straight_pass(TIMES_S, **TRIGGERS)
    first, *rest = scenes.changes_of(motion)
    film = LiveFilm(lying_plane(), MODEL)
    film.add_poses(poses(motion, slice(0, 300)))
    assert film.flow is None
    assert film.snapshot().film_um.max() > 1.0
    film.add_trigger(first)
    assert film.flow == 1.0
    film.replay([*rest, poses(motion, slice(300, None))])
    assert np.array_equal(film.snapshot().film_um, painted(lying_plane(), motion).film_um)
    assert film.counts.late_triggers == 0


def test_changes_that_come_out_of_order_leave_the_newest_in_force():
    motion = straight_pass(TIMES_S)
    film = LiveFilm(lying_plane(), MODEL)
    for told in ((0.0, 1.0), (3.0, 0.0), (1.0, 0.8), (2.0, 0.6), (0.5, 0.9)):
        film.add_trigger(change(*told))
    for upto, flow in ((200, 0.9), (300, 0.8), (600, 0.6), (1000, 0.0)):
        film.add_poses(poses(motion, slice(upto - 100, upto)))
        assert film.flow == flow
    film.add_trigger(change(3.5, 0.7))
    # Late: an earlier change than the one in force leaves that one in force.
    film.add_trigger(change(3.2, 0.5))
    assert film.flow == 0.7


def test_states_after_a_clock_was_set_back_count_though_the_film_is_reset_before_their_poses():
    """All of them, also one that comes with poses that may yet be stragglers."""
    motion, back_s = straight_pass(TIMES_S), 3600.0
    again = replace(motion, stamps_ns=motion.stamps_ns - round(1e9 * back_s))
    film = followed([TriggerChange(scenes.START_NS, 1.0), poses(motion, slice(0, 500))])
    states = [(0.0, 1.0), (0.8, 0.0), (1.2, 0.5)]
    first, second, third = (change(at_s - back_s, flow) for at_s, flow in states)
    film.replay([first, second, poses(again, slice(0, 20)), third])
    film.reset()
    film.add_poses(poses(again, slice(20, None)))
    seconds = 0.8 - 0.08 + 0.5 * (TIMES_S[-1] - 1.2)
    emitted_cm3 = MODEL.planar.K1_cm3_per_s * seconds
    assert film.snapshot().used.emitted_cm3 == pytest.approx(emitted_cm3, rel=0.01)


@pytest.mark.parametrize('before', [0, 10])
def test_a_state_that_is_told_ahead_holds_though_the_film_is_reset_before_its_pose(before):
    """As it would without the reset; a pose without a time tells nothing of that."""
    motion = straight_pass(TIMES_S, **TRIGGERS)
    film = followed([poses(motion, slice(0, before))])
    film.replay(TriggerChange(*change) for change in motion.triggers)
    film.reset()
    film.reset()
    nowhen = poses(motion, slice(before, before + 1))
    film.add_poses(replace(nowhen, stamps_ns=np.zeros(1, np.int64)))
    film.add_poses(poses(motion, slice(before, None)))
    rest = painted(lying_plane(), scenes.rows_of(motion, slice(before, None)))
    assert np.array_equal(film.snapshot().film_um, rest.film_um)


def test_the_log_paints_the_motion_again_with_another_model():
    motion = straight_pass(TIMES_S, **TRIGGERS)
    film = followed(scenes.events(motion, 10, delay_s=0.05))
    again = LiveFilm(lying_plane(), LAGGING)
    again.replay(film.log.events())
    offline = painted(lying_plane(), motion, LAGGING)
    assert np.array_equal(again.snapshot().film_um, offline.film_um)
    assert again.counts == film.counts


def test_another_model_from_here_on_leaves_the_film_so_far():
    motion = straight_pass(TIMES_S)
    doubled = MODEL.with_patterns([MODEL.planar.model_copy(update={'K1_cm3_per_s': 3.8})])
    film = LiveFilm(lying_plane(), MODEL, trigger_latency_s=0.0)
    film.add_poses(poses(motion, slice(0, 501)))
    before = film.snapshot().film_um
    film.switch_model(doubled)
    assert np.allclose(film.snapshot().film_um, before, rtol=0, atol=1e-6)
    film.add_poses(poses(motion, slice(501, None)))
    whole = painted(lying_plane(), motion).film_um
    expected = before + 2 * (whole - before)
    assert np.allclose(film.snapshot().film_um, expected, rtol=0, atol=1e-4 * whole.max())


def test_memory_is_bounded_and_says_so():
    motion = straight_pass(TIMES_S)
    film = followed(scenes.events(motion, 100), pose_memory=500)
    assert not film.log.complete
    assert list(film.log.events()) == []
    assert np.array_equal(film.snapshot().film_um, painted(lying_plane(), motion).film_um)
    # Too late to be taken back: the gun is off from the first state on, not before.
    film.add_trigger(TriggerChange(scenes.START_NS + 10_000_000_000, 1.0))
    assert film.snapshot().film_um.max() > 1.0


def test_a_film_that_carries_a_motion_on_keeps_to_models_with_its_brush():
    """Another part, and a model without the brush that sprays: refused before the next pose."""
    model = two_brushes()
    before = followed([TriggerChange(scenes.START_NS, 1.0, 2)], model)
    other_part = LiveFilm(lying_plane(), model)
    other_part.reset(keeping_trigger_of=before)
    with pytest.raises(ModelError, match='brush 2 is not in the model'):
        other_part.switch_model(model.with_brush(1))
    other_part.add_poses(poses(straight_pass(TIMES_S), slice(0, 500)))
    assert (other_part.brush, other_part.flow) == (2, 1.0)


@pytest.mark.parametrize('back_s', [0.0, 0.4, 2.0, 3600.0])
def test_a_film_that_goes_on_begins_with_what_it_says_though_the_clock_is_set_back(back_s):
    motion = straight_pass(TIMES_S)
    half = len(motion) // 2
    stamps = motion.stamps_ns - round(back_s * 1e9) * (np.arange(len(motion)) >= half)
    last = TriggerChange(int(motion.stamps_ns[half - 1]), 1.0)
    states = [
        TriggerChange(scenes.START_NS, 0.0),
        TriggerChange(int(stamps[half // 2]), 0.5),
        last,
    ]
    film = followed([*states, poses(motion, slice(0, half))])
    film.reset()
    assert film.carried_over == [last]
    told = {'trigger_stamps_ns': np.array([last.stamp_ns]), 'trigger_flow': np.ones(1)}
    begun = scenes.rows_of(replace(motion, stamps_ns=stamps), slice(half, None), **told)
    film.add_poses(poses(begun, slice(None)))
    offline = painted(lying_plane(), begun)
    assert np.array_equal(film.snapshot().film_um, offline.film_um)


@pytest.mark.parametrize('back_s', [0.4, 2.0, 3600.0])
def test_a_state_of_a_stream_that_is_about_to_begin_changes_nothing_before_it(back_s):
    motion = straight_pass(TIMES_S)
    stamps = np.array([scenes.START_NS, motion.stamps_ns[-1] - round(back_s * 1e9)])
    told = replace(
        motion, trigger_stamps_ns=stamps, trigger_flow=np.array([1.0, 0.0]),
        trigger_rows=np.array([0, len(motion)]),
    )  # fmt: skip
    on, off = scenes.changes_of(told)
    film = followed([on, poses(motion, slice(None))])
    before_um = film.snapshot().film_um
    film.add_trigger(off)
    assert np.array_equal(film.snapshot().film_um, before_um)
    assert np.array_equal(painted(lying_plane(), told).film_um, before_um)


@pytest.mark.slow
@pytest.mark.parametrize('after', [50, 150])
@pytest.mark.parametrize('batch', [1, 40])
@pytest.mark.parametrize('back_s', [0.4, 1.7, 3600.0])
@pytest.mark.parametrize('switched', [True, False])
def test_a_clock_that_is_set_back_within_a_part_gives_the_offline_film(
    after, batch, back_s, switched
):
    """States of either stream count in their own, though their times lie in one another's."""
    motion = scenes.weaving(TIMES_S)
    half = len(motion) // 2
    stamps = motion.stamps_ns - round(back_s * 1e9) * (np.arange(len(motion)) >= half)
    # (pose before which it comes, flow): the third of them the first of the stream after.
    states = [(0, 0.0), (100, 1.0), *([(half, 0.5)] if switched else []), (half + after, 0.0),
              (half + 220, 1.0)]  # fmt: skip
    rows = np.array([row for row, _ in states])
    recorded = pd.Trajectory(
        stamps, motion.positions_m, motion.quaternions_xyzw, trigger_stamps_ns=stamps[rows],
        trigger_flow=np.array([flow for _, flow in states]), trigger_rows=rows,
    )  # fmt: skip
    live = LiveFilm(lying_plane(), MODEL)
    for event in events_of(recorded):
        poses_of = isinstance(event, PoseBatch)
        for first in range(0, len(event) if poses_of else 1, batch):
            live.replay([event.select(slice(first, first + batch)) if poses_of else event])
            live.snapshot()
    offline = painted(lying_plane(), recorded)
    assert live.counts.restarts == 1
    assert np.array_equal(live.snapshot().film_um, offline.film_um)
    # Without a state after it the gun stays as it was, and is off where a replay may have begun.
    stays = float(back_s < 2.0)
    flown = [1.0] * (half - 100) + ([0.5 if switched else stays] * after) + [0.0] * (220 - after)
    seconds = 0.004 * (sum(flown) + len(motion) - half - 220)
    emitted_cm3 = MODEL.planar.K1_cm3_per_s * seconds
    assert offline.used.emitted_cm3 == pytest.approx(emitted_cm3, rel=0.02)
