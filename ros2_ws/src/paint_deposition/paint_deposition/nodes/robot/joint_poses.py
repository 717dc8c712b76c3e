"""The pose of a robot's tip from its joint states."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from sensor_msgs.msg import JointState

from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.files.recordings.joint_states import Robot
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.nodes.runtime.diagnostics import ERROR, OK, WARN, Status

if TYPE_CHECKING:  # older distributions have no such name
    from rclpy.subscription import MessageInfo

# (stamp [ns], pose of the tip, when it was sent [ns] or 0)
TakePose = Callable[[int, Rigid, int], None]
SILENT_S = 2.0


class JointPoses:
    """Computes a pose from each joint state, which must tell of all joints.

    Args:
        robot: the chain of joints.
        topic: of the joint states, for messages.
        take_pose: gets each pose.

    Attributes:
        base, tip: frame of the poses, and whose they are.
    """

    def __init__(self, robot: Robot, topic: str, take_pose: TakePose) -> None:
        self.base, self.tip = robot.base, robot.tip
        self._robot = robot
        self._topic = topic
        self._take_pose = take_pose
        self._poses = self._incomplete = 0
        self._heard_s = time.monotonic()

    def take(self, _topic: str, message: JointState, info: MessageInfo) -> None:
        """Take a joint state."""
        told = dict(zip(message.name, message.position, strict=False))
        if any(name not in told for name in self._robot.moving):
            self._incomplete += 1
            return
        self._heard_s = time.monotonic()
        values = np.array([[told[name] for name in self._robot.moving]])
        positions, quaternions = self._robot.poses(values)
        tip = Rigid.of([*positions[0], *quaternions[0]])
        self._poses += 1
        self._take_pose(stamp_ns(message.header), tip, info['source_timestamp'])

    def status(self) -> Status:
        """Whether joint states come, and tell of all joints."""
        values = {
            'robot': self._robot.path,
            'joint states without all joints': self._incomplete,
        }
        if self._incomplete and not self._poses:
            joints = ' '.join(self._robot.moving)
            return Status(ERROR, f'no joint state tells of all of {joints}', values)
        if time.monotonic() - self._heard_s > SILENT_S:
            return Status(WARN, f'no joint states on {self._topic}', values)
        return Status(OK, 'following the robot', values)
