"""The robot that is to drive a motion, where the part may stand for it, and where it stands."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from paint_deposition.errors import PlanError, RecordingError
from paint_deposition.files.gauge_readings import read_points
from paint_deposition.files.recordings.joint_states import Robot
from paint_deposition.motion.part_frame import (
    POSE_FORMAT,
    PartPlace,
    Rigid,
    at_part,
    is_frame,
    is_pose,
    locate,
)
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.planning.driving import PartPlaces, RobotCell, part_places


def read_robot(
    urdf: str | Path,
    part_pose: Sequence[float],
    tip_link: str | None = None,
    base_link: str | None = None,
    joint_acceleration: float | None = None,
) -> RobotCell:
    """Read the robot that is to drive a plan.

    Args:
        urdf: its description; every joint has a greatest speed.
        part_pose: where the part stands in its base: x y z [m] and a quaternion qx qy qz qw.
        tip_link, base_link: of the TCP and of the poses; default: tool0 or the last link, and the
            root.
        joint_acceleration: of every joint [rad/s2 or m/s2]; default: each reaches its full speed
            in a quarter of a second.

    Raises:
        PaintError: the file cannot be read, or a joint has no greatest speed.
    """
    if not is_pose(part_pose):
        raise PlanError(f'part_pose is {list(part_pose)}; give {POSE_FORMAT}')
    robot = Robot.read(Path(urdf), tip_link, base_link)
    return RobotCell(robot.arm, Rigid.of(part_pose), joint_acceleration)


def place(
    trajectory: Trajectory,
    cell: RobotCell,
    x_m: Sequence[float] | np.ndarray,
    y_m: Sequence[float] | np.ndarray,
    free_roll: bool = False,
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> PartPlaces:
    """Look where a part may stand so that the robot drives a motion over it.

    Args:
        trajectory: the motion, in the frame of the part, ``part`` or without a name, or in that of
            the robot's base with the part at ``cell.part``.
        cell: the robot, with height and turn of the part.
        x_m, y_m: places of the part to try in the robot's base [m].
        free_roll: the tool may be turned about its own axis, as where the pattern is round.
        progress: called with what is being done and the share of it that is done, 0 to 1.
    """
    if not is_frame(trajectory.frame_id, 'part'):
        trajectory = at_part(trajectory, cell.part.values, 'part')
    return part_places(trajectory, cell, np.array(x_m), np.array(y_m), free_roll, progress)


def locate_by_points(
    touched: str | Path, points: str | Path, unit: str | None = None
) -> PartPlace:
    """The pose of a part from points that the robot touched.

    Args:
        touched: table of named points in the robot's frame.
        points: table of the same points in the part's frame.
        unit: 'm', 'mm' or 'cm' where headings tell none.

    Raises:
        PaintError: the tables cannot be read, or determine no pose.
    """
    given = read_points(Path(touched), unit), read_points(Path(points), unit)
    try:
        return locate(*given)
    except RecordingError as error:
        raise RecordingError(f'{touched} and {points}: {error}') from None
