"""The flow as a function of time, however its changes came."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paint_deposition.motion.trigger import FlowSchedule


def schedule(changes):
    flow = FlowSchedule()
    for stamp, value in changes:
        flow.add(stamp, value)
    return flow


def flow_at(flow, stamps):
    cuts, flows, _ = flow.steps()
    return flows[np.searchsorted(cuts, stamps, side='right')]


def test_without_changes_the_gun_always_sprays():
    flow = schedule([])
    assert not flow
    assert flow_at(flow, [-5, 0, 10**18]).tolist() == [1.0, 1.0, 1.0]


def test_before_the_first_change_the_gun_is_off():
    flow = schedule([(10, 1.0), (20, 0.0), (30, 0.5)])
    assert flow_at(flow, [0, 9, 10, 19, 20, 30, 99]).tolist() == [0, 0, 1, 1, 0, 0.5, 0.5]


def test_a_gun_that_is_only_told_to_be_off_stays_off():
    flow = schedule([(10, 0.0)])
    assert flow
    assert flow_at(flow, [0, 20]).tolist() == [0.0, 0.0]


def test_a_state_that_is_repeated_cuts_nothing():
    flow = schedule([(stamp, 1.0 if stamp >= 30 else 0.0) for stamp in range(0, 100, 10)])
    cuts, flows, _ = flow.steps()
    assert cuts.tolist() == [30]
    assert flows.tolist() == [0.0, 1.0]


def test_of_changes_at_one_time_the_last_to_come_counts():
    assert flow_at(schedule([(10, 1.0), (10, 0.0)]), [10]).tolist() == [0.0]
    assert flow_at(schedule([(5, 1.0), (10, 0.0), (10, 1.0)]), [10]).tolist() == [1.0]


@given(
    changes=st.lists(
        st.tuples(st.integers(0, 50), st.sampled_from([0.0, 0.5, 1.0])),
        min_size=1,
        unique_by=lambda change: change[0],
    ),
    order=st.randoms(use_true_random=False),
    forgotten_until=st.integers(-5, 60),
)
def test_neither_order_nor_forgetting_matters_later(changes, order, forgotten_until):
    expected = schedule(sorted(changes))
    shuffled = list(changes)
    order.shuffle(shuffled)
    flow = schedule(shuffled)
    flow.forget(forgotten_until)
    later = np.arange(forgotten_until, 70)
    assert np.array_equal(flow_at(flow, later), flow_at(expected, later))


def test_a_change_that_was_superseded_before_it_came_does_nothing():
    flow = schedule([(10, 1.0), (20, 0.0)])
    flow.forget(25)
    flow.add(15, 1.0)
    assert flow_at(flow, [26]).tolist() == [0.0]


def test_forgetting_keeps_the_memory_small():
    flow = FlowSchedule()
    for stamp in range(10_000):
        flow.add(stamp, float(stamp % 2))
        flow.forget(stamp)
    assert len(flow.steps()[0]) <= 2


def test_beginning_again_keeps_what_came_early_for_it():
    flow = schedule([(1000, 1.0), (2000, 0.0)])
    flow.add(0, 0.0, another_stream=True)
    flow.add(50, 1.0, another_stream=True)
    assert flow.restart() == 2
    assert flow_at(flow, [10, 60, 1500]).tolist() == [0.0, 1.0, 1.0]
    assert flow.restart() == 0


def test_beginning_again_with_all_changes_known_repeats_them():
    flow = schedule([(10, 1.0), (20, 0.0)])
    flow.restart()
    assert flow_at(flow, [5, 15, 25]).tolist() == [0.0, 1.0, 0.0]


def test_beginning_again_after_forgetting_closes_the_gun():
    flow = schedule([(10, 1.0), (20, 0.0), (30, 1.0)])
    flow.forget(35)
    flow.restart()
    assert flow
    assert flow_at(flow, [0, 15, 40]).tolist() == [0.0, 0.0, 0.0]
