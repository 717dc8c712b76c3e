"""A recording says what it lacks; the flow is a function of time, however its changes came."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paint_deposition.errors import RecordingError
from paint_deposition.motion.trajectory import FlowSchedule, Trajectory, relative_flow


def test_shapes_must_match():
    stamps = np.arange(3, dtype=np.int64)
    with pytest.raises(RecordingError, match=r'3 stamps .*positions \(2, 3\)'):
        Trajectory(stamps, np.zeros((2, 3)), np.zeros((3, 4)))
    with pytest.raises(RecordingError, match='2 trigger stamps go with 1 flow'):
        Trajectory(stamps, np.zeros((3, 3)), np.zeros((3, 4)), '', np.arange(2), np.array([1.0]))


def test_relative_flow():
    assert relative_flow(False, 0.9) == 0.0
    assert relative_flow(True) == 1.0
    assert relative_flow(True, 0.9) == 0.9
    for wrong in (-0.1, float('inf')):
        with pytest.raises(RecordingError, match='flow is'):
            relative_flow(True, wrong)


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
