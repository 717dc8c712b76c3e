"""Poses that wait for their transform: in order, for a while, each counted once."""

from collections import deque

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.time import Time

from paint_deposition.motion.frame_tree import NoTransform
from paint_deposition.nodes.painting.frames import TF_TIMEOUT_S, TfQueue, placed_in_order


class Part:
    """Takes poses up to the stamp that transforms are known for."""

    def __init__(self, may_come: bool = True) -> None:
        self.known_until_ns, self.may_come = 0, may_come
        self.placed: list[int] = []
        self.refused: list[int] = []
        self.queue: TfQueue = deque()

    def take(self, stamp_ns: int, now_s: float) -> None:
        pose = PoseStamped()
        pose.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        self.queue.append((now_s, pose))
        self.process(now_s)

    def process(self, now_s: float) -> None:
        for pose, placed in placed_in_order(self.queue, self._place, now_s):
            refused = isinstance(placed, NoTransform)
            (self.refused if refused else self.placed).append(_stamp_ns(pose))

    def _place(self, pose: PoseStamped) -> tuple[np.ndarray, np.ndarray]:
        if _stamp_ns(pose) > self.known_until_ns:
            raise NoTransform('not known', self.may_come)
        return np.zeros(3), np.zeros(4)


def _stamp_ns(pose: PoseStamped) -> int:
    return Time.from_msg(pose.header.stamp).nanoseconds


def test_a_late_transform_lets_the_poses_through_in_order():
    part = Part()
    for stamp_ns in (4, 8, 12):
        part.take(stamp_ns, now_s=stamp_ns * 1e-3)
    assert (part.placed, len(part.queue)) == ([], 3)
    part.known_until_ns = 8
    part.process(now_s=0.020)
    assert (part.placed, len(part.queue)) == ([4, 8], 1)
    part.known_until_ns = 16
    part.take(16, now_s=0.024)
    assert (part.placed, part.refused, len(part.queue)) == ([4, 8, 12, 16], [], 0)


def test_a_pose_is_refused_when_its_time_is_up_or_nothing_can_come():
    part = Part()
    part.take(4, now_s=0.0)
    part.take(8, now_s=0.1)
    part.process(now_s=TF_TIMEOUT_S - 1e-3)
    assert part.refused == []
    part.process(now_s=TF_TIMEOUT_S)
    assert (part.refused, len(part.queue)) == ([4], 1)
    never = Part(may_come=False)
    never.take(4, now_s=0.0)
    assert (never.refused, len(never.queue)) == ([4], 0)
