"""What is kept of a motion, to be followed again."""

import numpy as np
import pytest

from paint_deposition.motion.pose_stream import MotionLog, PoseBatch, TriggerChange


def _poses(first, count) -> PoseBatch:
    """No two numbers of these poses are equal."""
    stamps = np.arange(first, first + count)
    of_each = stamps[:, None]
    return PoseBatch(stamps, of_each + np.arange(3) / 3, -of_each - np.arange(4) / 5)


def _log(*events: TriggerChange | PoseBatch, **limits: int) -> MotionLog:
    log = MotionLog(**limits)
    for event in events:
        log.add(event)
    return log


def _in_words(events) -> list:
    """Poses by their stamps, wherever their batches end, and the changes between them."""
    told = []
    for event in events:
        told += [event] if isinstance(event, TriggerChange) else event.stamps_ns.tolist()
    return told


@pytest.mark.parametrize('sizes', [(9000,), (13,) * 692 + (4,), (4096, 1, 4095, 808)])
def test_poses_of_any_batches_come_back_to_the_last_bit(sizes):
    firsts = np.cumsum([0, *sizes])
    log = _log(*(_poses(first, size) for first, size in zip(firsts, sizes, strict=False)))
    batches = list(log.events())
    assert max(map(len, batches)) <= 256
    for name, column in vars(_poses(0, 9000)).items():
        assert np.array_equal(np.concatenate([vars(batch)[name] for batch in batches]), column)


def test_who_has_followed_a_part_gets_the_rest():
    events = [_poses(0, 5), TriggerChange(5, 1.0), _poses(5, 5000), TriggerChange(9000, 0.0)]
    log, follower = _log(*events), MotionLog()
    for event in log.events():
        rest = _in_words(log.events(follower.poses, follower.changes))
        assert rest == _in_words(log.events())[follower.poses + follower.changes :]
        follower.add(event)
    assert not list(log.events(follower.poses, follower.changes))
    log.add(_poses(10_000, 3))
    assert _in_words(log.events(follower.poses, follower.changes)) == [10_000, 10_001, 10_002]


def test_the_first_poses_are_found_between_changes():
    log = MotionLog()
    for first in range(0, 20, 5):
        log.add(_poses(first, 5))
        log.add(TriggerChange(first, 1.0))
    assert np.array_equal(log.first_poses(7).stamps_ns, np.arange(7))
    assert len(log.first_poses(100)) == 20
