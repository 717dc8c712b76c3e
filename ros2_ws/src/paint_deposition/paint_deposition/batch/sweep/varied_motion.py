"""A recorded motion run faster, further off or with another flow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.motion.trajectory import Trajectory


def varied_motion(
    trajectory: Trajectory,
    speed_factor: float = 1.0,
    standoff_change_m: float = 0.0,
    flow_factor: float = 1.0,
) -> Trajectory:
    """The same motion, changed; as it is where nothing is asked for.

    Args:
        trajectory: as recorded.
        speed_factor: all times from the first pose on are divided by it, those of the trigger too.
        standoff_change_m: the TCP moves back along the tool's axis by it; negative is nearer [m].
        flow_factor: on the flow of the trigger. Without a trigger the gun sprays all the time.
    """
    if speed_factor != 1.0 and len(trajectory):
        first = trajectory.stamps_ns[0]
        stamps, triggers = (
            first + np.round((stamps - first) / speed_factor).astype(np.int64)
            for stamps in (trajectory.stamps_ns, trajectory.trigger_stamps_ns)
        )
        trajectory = replace(trajectory, stamps_ns=stamps, trigger_stamps_ns=triggers)
    if standoff_change_m != 0.0:
        tool_z = Rotation.from_quat(trajectory.quaternions_xyzw).apply([0.0, 0.0, 1.0])
        moved = trajectory.positions_m - standoff_change_m * tool_z
        trajectory = replace(trajectory, positions_m=moved)
    if flow_factor != 1.0:
        stamps, flow = trajectory.trigger_stamps_ns, trajectory.trigger_flow
        if not len(stamps):
            stamps, flow = trajectory.stamps_ns[:1], np.ones(1)
        trajectory = replace(trajectory, trigger_stamps_ns=stamps, trigger_flow=flow_factor * flow)
    return trajectory
