"""Poses that wait for their transform: in order, for a while, each counted once."""

import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import PoseStamped
from rclpy.time import Time

from paint_deposition.nodes.painting.frames import TIMEOUT_S, NoTransform, TfQueue


class Part:
    """Takes poses up to the stamp that transforms are known for."""

    def __init__(self) -> None:
        self.known_until_ns = 0
        self.may_come = True
        self.queue = TfQueue()
        self.placed: list[int] = []
        self.refused: list[int] = []

    def take(self, stamp_ns: int, now_s: float) -> None:
        pose = PoseStamped()
        pose.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        self.queue.add(pose, now_s)
        self.release(now_s)

    def release(self, now_s: float) -> None:
        self.queue.release(now_s, self._place, self._refuse)

    def _place(self, pose: PoseStamped) -> None:
        stamp_ns = Time.from_msg(pose.header.stamp).nanoseconds
        if stamp_ns > self.known_until_ns:
            raise NoTransform('not known', self.may_come)
        self.placed.append(stamp_ns)

    def _refuse(self, pose: PoseStamped, missing: NoTransform) -> None:
        assert str(missing) == 'not known'
        self.refused.append(Time.from_msg(pose.header.stamp).nanoseconds)


@pytest.fixture
def part() -> Part:
    return Part()


def test_a_late_transform_lets_the_poses_through_in_order(part):
    for stamp_ns in (4, 8, 12):
        part.take(stamp_ns, now_s=stamp_ns * 1e-3)
    assert (part.placed, len(part.queue)) == ([], 3)
    part.known_until_ns = 8
    part.release(now_s=0.020)
    assert (part.placed, len(part.queue)) == ([4, 8], 1)
    part.known_until_ns = 16
    part.take(16, now_s=0.024)
    assert (part.placed, part.refused, len(part.queue)) == ([4, 8, 12, 16], [], 0)


def test_a_pose_is_refused_when_its_time_is_up(part):
    part.take(4, now_s=0.0)
    part.take(8, now_s=0.1)
    part.release(now_s=TIMEOUT_S - 1e-3)
    assert part.refused == []
    part.release(now_s=TIMEOUT_S)
    assert (part.refused, len(part.queue)) == ([4], 1)
    part.release(now_s=TIMEOUT_S + 0.1)
    assert (part.refused, part.placed, len(part.queue)) == ([4, 8], [], 0)


def test_nothing_waits_for_what_cannot_come(part):
    part.may_come = False
    part.take(4, now_s=0.0)
    assert (part.refused, len(part.queue)) == ([4], 0)
