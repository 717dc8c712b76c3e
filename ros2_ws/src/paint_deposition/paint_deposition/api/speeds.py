"""A recorded motion beside its programme."""

from __future__ import annotations

from paint_deposition.motion.driven_speed import DrivenSpeed, driven_speed
from paint_deposition.motion.path_builder import (
    DEFAULT_MAX_POSE_GAP_S,
    require_spraying,
    spray_path,
)
from paint_deposition.motion.trajectory import Trajectory


def compare_speeds(
    recorded: Trajectory,
    programmed: Trajectory,
    *,
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
) -> DrivenSpeed:
    """Compare the speed that the robot drove with the programmed one, where it sprayed.

    Args:
        recorded: the motion as recorded.
        programmed: the same as programmed, a RAPID module or a table of passes, in the same frame.
        max_pose_gap_s: a longer time between two poses counts as gun off [s].

    Raises:
        RecordingError: the gun never sprays, or most of its way is not on the programme's.
    """
    driven, _ = spray_path(recorded, max_pose_gap_s)
    require_spraying(recorded, driven)
    planned, _ = spray_path(programmed)
    return driven_speed(driven, planned)
