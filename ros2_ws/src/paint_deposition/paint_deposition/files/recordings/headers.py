"""Stamps and set-points of messages, decoded by rosbags or by rclpy."""

import math
from collections.abc import Iterator
from typing import Any

# Fields of AtomizerState with set-points, in the order of a trajectory's set-points.
SET_POINTS = ('flow_cm3_per_min', 'shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv')


def stamp_ns(header: Any) -> int:
    """A header's stamp in integer nanoseconds, which a float could not hold."""
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def transforms_of(message: Any) -> Iterator[tuple[str, str, int, tuple[float, ...]]]:
    """Child, parent, stamp [ns] and pose x y z qx qy qz qw of each transform of a TFMessage."""
    for placed in message.transforms:
        t, q = placed.transform.translation, placed.transform.rotation
        pose = t.x, t.y, t.z, q.x, q.y, q.z, q.w
        parent, child = placed.header.frame_id.lstrip('/'), placed.child_frame_id.lstrip('/')
        yield child, parent, stamp_ns(placed.header), pose


def set_points_of(state: Any) -> tuple[float, ...]:
    """The set-points of a state in the order of a trajectory's; 0 for missing ones."""
    known = (abs(float(getattr(state, name, 0.0))) for name in SET_POINTS)
    return tuple(value if math.isfinite(value) else 0.0 for value in known)
