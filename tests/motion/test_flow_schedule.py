"""The flow as a function of time, however its changes came."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paint_deposition.motion.trajectory import FlowSchedule


def schedule(changes):
    flow = FlowSchedule()
    for stamp, value in changes:
        flow.add(stamp, value)
    return flow


def flow_at(flow, stamps):
    cuts, flows, _ = flow.steps()
    return flows[np.searchsorted(cuts, stamps, side='right')]


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
