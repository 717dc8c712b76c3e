"""A plan as a robot drives it."""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.planning.driving import RobotCell
from paint_deposition.planning.films import PlannedFilm, predicted, simulated
from paint_deposition.planning.improvement.programme import Programme, moves_of
from paint_deposition.planning.passes import WAYPOINT_STEP_M, WAYPOINTS_PER_MOVE

Planned = TypeVar('Planned', bound=PlannedFilm)
# The pattern counts as round if a quarter turn of the tool changes the film by less of its peak.
ROUND = 1e-3
# Of the robot program, as of one that keeps the planned speeds.
SHORTEST_MOVE_M = WAYPOINT_STEP_M * WAYPOINTS_PER_MOVE
QUARTER = Rotation.from_rotvec([0.0, 0.0, 0.5 * np.pi])


def driven(planned: Planned, cell: RobotCell) -> Planned:
    """The plan with the joints that drive it, and its film at the speeds that they allow.

    The tool is turned about its own axis where that helps and the pattern is round.

    Raises:
        PlanError: the robot does not reach all passes.
    """
    request = planned.request
    drive = cell.drive(planned.trajectory, _is_round(planned))
    found = predicted(planned.surface, planned.model, request, planned.wanted, drive.trajectory)
    wanted = request.improvement(0.0, request.target_um, move_min_m=SHORTEST_MOVE_M)
    moves = tuple(moves_of(Programme.of(drive.trajectory), wanted))
    return replace(planned, **found, moves=moves, drive=drive)


def _is_round(planned: PlannedFilm) -> bool:
    turned = Rotation.from_quat(planned.trajectory.quaternions_xyzw) * QUARTER
    trajectory = replace(planned.trajectory, quaternions_xyzw=turned.as_quat())
    film_um, _ = simulated(planned.surface, planned.model, trajectory)
    return bool(np.abs(film_um - planned.film_um).max() < ROUND * planned.film_um.max())
