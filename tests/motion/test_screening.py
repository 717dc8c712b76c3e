"""Poses that cannot be followed are counted and dropped; streams that begin again are not."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paint_deposition.motion.pose_stream import PoseBatch, PoseScreen

GAP_NS = 250
UNIT = (0.0, 0.0, 0.0, 1.0)


def batch(stamps, quaternions=None, positions=None):
    count = len(stamps)
    return PoseBatch(
        np.array(stamps, dtype=np.int64),
        np.zeros((count, 3)) if positions is None else np.array(positions, dtype=float),
        np.tile(UNIT, (count, 1)) if quaternions is None else np.array(quaternions, dtype=float),
    )


def followed(stamps, batches=1):
    """Stamps followed, one list a stream, and the counts."""
    screen = PoseScreen(GAP_NS)
    streams = [[]]
    for rows in np.array_split(np.array(stamps, dtype=np.int64), batches):
        first, *others = screen.take(batch(rows))
        streams[-1] += first.stamps_ns.tolist()
        streams += [stream.stamps_ns.tolist() for stream in others]
    screen.finish()
    return streams, screen.counts


def test_repeated_and_backward_stamps_are_dropped():
    streams, counts = followed([0, 10, 10, 20, 15, 30, 30, 30, 40, 5, 50])
    assert streams == [[0, 10, 20, 30, 40, 50]]
    assert (counts.received, counts.repeated_stamps, counts.backward_stamps) == (11, 3, 2)
    assert counts.rejected == 5
    assert counts.restarts == 0


def test_a_few_stragglers_in_order_are_no_restart():
    """Poses that came by a slower way must not be painted twice."""
    streams, counts = followed([0, 20, 40, 60, 10, 30, 50, 80, 100])
    assert streams == [[0, 20, 40, 60, 80, 100]]
    assert (counts.backward_stamps, counts.restarts) == (3, 0)


def test_a_lasting_run_from_an_earlier_time_is_a_restart_of_which_nothing_is_lost():
    again = list(range(0, 500, 20))
    streams, counts = followed([*range(1000, 1100, 20), *again])
    assert streams == [list(range(1000, 1100, 20)), again]
    assert (counts.restarts, counts.rejected) == (1, 0)


def test_what_is_no_pose_is_dropped_and_quaternions_are_brought_to_unit_length():
    good = [UNIT, (0, 0, 0, 1.009), (0, 0, 0, 0.991)]
    quaternions = [*good, (0, 0, 0, 1.02), (0, 0, 0, 0), (0, 0, np.inf, 1), UNIT, UNIT]
    positions = np.zeros((8, 3))
    positions[6, 2], positions[7, 1] = np.nan, -1e30
    screen = PoseScreen(GAP_NS)
    (kept,) = screen.take(batch(np.arange(8), quaternions, positions))
    assert kept.stamps_ns.tolist() == [0, 1, 2]
    assert np.array_equal(np.linalg.norm(kept.quaternions_xyzw, axis=1), np.ones(3))
    assert (screen.counts.not_finite, screen.counts.not_unit_quaternions) == (3, 2)


@given(
    steps=st.lists(st.sampled_from([20, 20, 20, 20, 0, -20, -50, 300, -5000]), max_size=80),
    batches=st.integers(1, 20),
)
def test_batches_do_not_matter(steps, batches):
    stamps = 10_000 + np.cumsum(np.array([0, *steps]))
    streams, counts = followed(stamps, batches)
    assert (streams, counts) == followed(stamps)
    assert all(np.all(np.diff(stream) > 0) for stream in streams)
    assert len(streams) == counts.restarts + 1
    assert sum(map(len, streams)) + counts.rejected == counts.received == len(stamps)
