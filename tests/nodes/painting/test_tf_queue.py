"""Poses that wait for their transform: in order, for a while, each counted once."""

from geometry_msgs.msg import PoseStamped
from rclpy.time import Time

from paint_deposition.motion.frame_tree import NoTransform
from paint_deposition.nodes.painting.frames import TF_TIMEOUT_S, TfQueue


class Part:
    """Takes poses up to the stamp that transforms are known for."""

    def __init__(self, may_come: bool = True) -> None:
        self.known_until_ns, self.may_come = 0, may_come
        self.placed: list[int] = []
        self.refused: list[int] = []
        self.queue = TfQueue(self._transform, lambda pose, _: self.refused.append(_stamp_ns(pose)))

    def take(self, stamp_ns: int, now_s: float) -> None:
        pose = PoseStamped()
        pose.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        self.queue.add(pose, now_s)

    def _transform(self, pose: PoseStamped) -> None:
        if _stamp_ns(pose) > self.known_until_ns:
            raise NoTransform('not known', self.may_come)
        self.placed.append(_stamp_ns(pose))


def _stamp_ns(pose: PoseStamped) -> int:
    return Time.from_msg(pose.header.stamp).nanoseconds


def test_a_late_transform_lets_the_poses_through_in_order():
    part = Part()
    for stamp_ns in (4, 8, 12):
        part.take(stamp_ns, now_s=stamp_ns * 1e-3)
    assert (part.placed, len(part.queue)) == ([], 3)
    part.known_until_ns = 8
    part.queue.process(now_s=0.020)
    assert (part.placed, len(part.queue)) == ([4, 8], 1)
    part.known_until_ns = 16
    part.take(16, now_s=0.024)
    assert (part.placed, part.refused, len(part.queue)) == ([4, 8, 12, 16], [], 0)


def test_a_pose_is_refused_when_its_time_is_up_or_nothing_can_come():
    part = Part()
    part.take(4, now_s=0.0)
    part.take(8, now_s=0.1)
    part.queue.process(now_s=TF_TIMEOUT_S - 1e-3)
    assert part.refused == []
    part.queue.process(now_s=TF_TIMEOUT_S)
    assert (part.refused, len(part.queue)) == ([4], 1)
    never = Part(may_come=False)
    never.take(4, now_s=0.0)
    assert (never.refused, len(never.queue)) == ([4], 0)
