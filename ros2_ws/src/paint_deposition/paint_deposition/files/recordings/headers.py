"""Where messages become numbers, decoded by rosbags or by rclpy: stamps, poses and states."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.motion.part_frame import is_pose
from paint_deposition.motion.pose_stream import FARTHEST_M, TriggerChange
from paint_deposition.motion.trajectory import ONLY_BRUSH, relative_flow

PLACED = ('translation', 'rotation')


def stamp_ns(header: Any) -> int:
    """A header's stamp in integer nanoseconds; 0 is none, or one that is no time of ROS."""
    return nanoseconds(header.stamp.sec, header.stamp.nanosec)


def nanoseconds(sec: int, nanosec: int) -> int:
    """A time; 0 before 1970, and for a second or more of nanoseconds."""
    valid = sec >= 0 and nanosec < 1_000_000_000
    return sec * 1_000_000_000 + nanosec if valid else 0


def pose_of(message: Any) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) [m] and quaternion (4,) of a Pose or Transform.

    They are NaN where one is infinite or further off than any part.
    """
    kind = ('position', 'orientation') if hasattr(message, 'position') else PLACED
    p, q = (getattr(message, name) for name in kind)
    values = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    if not (np.abs(values) <= FARTHEST_M).all():
        values[:] = np.nan
    return values[:3], values[3:]


def transforms_of(message: Any) -> Iterator[tuple[str, str, int, tuple[float, ...]]]:
    """Child, parent, stamp [ns] and pose x y z qx qy qz qw of each transform of a TFMessage.

    One that is not finite, or whose quaternion is none, is passed over, as by tf2.
    """
    for placed in message.transforms:
        t, q = placed.transform.translation, placed.transform.rotation
        pose = t.x, t.y, t.z, q.x, q.y, q.z, q.w
        parent, child = placed.header.frame_id.lstrip('/'), placed.child_frame_id.lstrip('/')
        if is_pose(pose):
            yield child, parent, stamp_ns(placed.header), pose


def trigger_change(state: Any) -> TriggerChange:
    """What an AtomizerState says of the gun.

    Raises:
        RecordingError: it has no stamp, no possible flow or no possible number of a brush.
    """
    stamp, brush = stamp_ns(state.header), int(getattr(state, 'brush', ONLY_BRUSH))
    if stamp == 0:
        raise RecordingError('atomizer state without a stamp: stamp each state')
    flow = relative_flow(bool(state.spraying), state.flow)
    if flow > 0.0 and brush < ONLY_BRUSH:
        raise RecordingError(f'atomizer state with brush {brush}: give 0 or more')
    return TriggerChange(stamp, flow, brush)
