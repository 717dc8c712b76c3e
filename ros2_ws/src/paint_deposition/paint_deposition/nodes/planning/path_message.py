"""A planned motion as nav_msgs/Path."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path

from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.nodes.runtime.messages import to_time

SPACING_M = 0.02


def path_message(trajectory: Trajectory, start_ns: int) -> Path:
    """Poses about SPACING_M apart, both ends included; stamps count from the start."""
    step = np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1)
    travelled = np.floor(np.concatenate([[0.0], np.cumsum(step)]) / SPACING_M)
    kept = np.append(True, np.diff(travelled) > 0.0)
    kept[-1] = True
    message = Path()
    message.header.frame_id = trajectory.frame_id
    message.header.stamp = to_time(start_ns)
    first_ns = int(trajectory.stamps_ns[0])
    for row in np.flatnonzero(kept):
        pose = PoseStamped()
        pose.header.frame_id = trajectory.frame_id
        pose.header.stamp = to_time(start_ns + int(trajectory.stamps_ns[row]) - first_ns)
        p, q = pose.pose.position, pose.pose.orientation
        p.x, p.y, p.z = trajectory.positions_m[row].tolist()
        q.x, q.y, q.z, q.w = trajectory.quaternions_xyzw[row].tolist()
        message.poses.append(pose)
    return message
