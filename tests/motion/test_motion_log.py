"""What is kept of a motion, to be followed again."""

import numpy as np

from paint_deposition.motion.motion_log import MotionLog, PoseBatch, TriggerChange, merged


def _poses(first, count) -> PoseBatch:
    stamps = np.arange(first, first + count)
    return PoseBatch(stamps, np.zeros((count, 3)), np.zeros((count, 4)))


def test_events_are_kept_in_the_order_in_which_they_came():
    log = MotionLog()
    events = [TriggerChange(0, 1.0), _poses(0, 5), TriggerChange(7, 0.0), _poses(5, 5)]
    for event in events:
        log.add(event)
    assert log.events == events
    assert (log.poses, log.complete) == (10, True)


def test_a_full_log_closes_and_forgets():
    log = MotionLog(limit_poses=10)
    for first in range(0, 20, 5):
        log.add(_poses(first, 5))
    log.add(TriggerChange(0, 1.0))
    assert not log.complete
    assert log.events == []
    assert log.first_poses(5) is None


def test_merging_joins_poses_but_not_across_a_trigger_change():
    change = TriggerChange(6, 0.0)
    events = [_poses(0, 2), _poses(2, 2), _poses(4, 2), change, _poses(6, 2), _poses(8, 2)]
    joined = list(merged(events, poses=4))
    assert joined[2] == change
    batches = [event for event in joined if isinstance(event, PoseBatch)]
    assert [len(batch) for batch in batches] == [4, 2, 4]
    assert np.array_equal(np.concatenate([b.stamps_ns for b in batches]), np.arange(10))


def test_the_first_poses_come_in_whole_batches():
    log = MotionLog()
    for first in range(0, 20, 5):
        log.add(_poses(first, 5))
        log.add(TriggerChange(first, 1.0))
    assert np.array_equal(log.first_poses(7).stamps_ns, np.arange(10))
    assert len(log.first_poses(100)) == 20
