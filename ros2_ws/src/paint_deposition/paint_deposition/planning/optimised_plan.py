"""A plan with an optimised number of passes, speeds along them, and at the pace of a robot."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import PlanError
from paint_deposition.planning.clearance import contacts
from paint_deposition.planning.driving import RobotCell
from paint_deposition.planning.films import PlannedFilm, predicted, simulated
from paint_deposition.planning.improvement.programme import Programme, moves_of
from paint_deposition.planning.improvement.retiming import retime_for_evenness
from paint_deposition.planning.passes import (
    WAYPOINT_STEP_M,
    WAYPOINTS_PER_MOVE,
    plan_passes,
    trajectory_of,
)
from paint_deposition.planning.placement import Placement, best_placement
from paint_deposition.planning.plan import INDEX_SHARES, Plan
from paint_deposition.planning.requests import GunEnvelope

# A further pass must save this share of the cost: neither rounding nor an immeasurable gain
# decides the number of passes.
WORTH_A_PASS = 0.05
# Numbers of passes tried: so many fewer, and so many more, than in the unoptimised plan.
FEWER, MORE = 2, 1
# The lead-in is long enough for a speed at the ends of a pass of this many times the mean.
FASTER_ENDS = 1.3
Planned = TypeVar('Planned', bound=PlannedFilm)
# The pattern counts as round if a quarter turn of the tool changes the film by less of its peak.
ROUND = 1e-3
# Of the robot program, as of one that keeps the planned speeds.
SHORTEST_MOVE_M = WAYPOINT_STEP_M * WAYPOINTS_PER_MOVE
QUARTER = Rotation.from_rotvec([0.0, 0.0, 0.5 * np.pi])


def optimise(
    unoptimised: Plan, progress: Callable[[str, float], None] = lambda what, share: None
) -> Plan:
    """The better plan that starts from an unoptimised one, for the same film wanted.

    The cost is sigma_n squared, and the weights of the request times the paint sprayed over the
    paint wanted on the part, and the cycle time over that of the unoptimised plan.
    """
    request, count = unoptimised.request, len(unoptimised.passes)
    target = unoptimised.wanted.target_um or unoptimised.mean_um
    wanted_cm3 = target * float(unoptimised.surface.vertex_areas_m2[unoptimised.painted].sum())
    low, high = unoptimised.line_films.surface_map.extent_m[1].tolist()
    least, most = (share * unoptimised.plane.index_m for share in INDEX_SHARES)
    placements = [unoptimised.placement]
    for passes in range(max(1, count - FEWER), count + MORE + 1):
        if passes != count:
            placement = best_placement(unoptimised.line_films, (low, high), (least, most), passes)
            placements += [placement] if placement else []
    tried = []
    for number, placement in enumerate(sorted(placements, key=lambda one: one.passes)):

        def show(what: str, share: float, number: int = number) -> None:
            progress(what, (number + share) / len(placements))

        tried.append(_timed_plan(unoptimised, placement, target, wanted_cm3, show))
    costs = [
        one.sigma_n**2
        + request.paint_weight * one.paint.emitted_cm3 / wanted_cm3
        + request.time_weight * one.cycle_time_s / unoptimised.cycle_time_s
        for one in tried
    ]
    enough = min(costs) / (1.0 - WORTH_A_PASS)
    return next(one for one, cost in zip(tried, costs, strict=True) if cost <= enough)


def _timed_plan(
    unoptimised: Plan,
    placement: Placement,
    target_um: float,
    wanted_cm3: float,
    progress: Callable[[str, float], None],
) -> Plan:
    """The plan along these lines, timed for evenness."""
    request, surface = unoptimised.request, unoptimised.surface
    even = unoptimised.style.speed_m_per_s * placement.passes / len(unoptimised.passes)
    speed = float(np.clip(even, request.speed_min_m_per_s, request.speed_max_m_per_s))
    # The run-up is that of the fastest.
    style = replace(unoptimised.style, speed_m_per_s=FASTER_ENDS * speed)
    lines = placement.lines_m if request.direction == 'horizontal' else placement.lines_m[::-1]
    passes = tuple(
        replace(planned, style=replace(style, speed_m_per_s=speed))
        for planned in plan_passes(unoptimised.line_films.surface_map, lines, [style] * len(lines))
    )
    programme = Programme.of(trajectory_of(passes, style, unoptimised.trajectory.frame_id))
    start_cm3 = unoptimised.model.planar.K1_cm3_per_s * sum(p.sprayed_m / speed for p in passes)
    zones = unoptimised.wanted.zones
    wanted = request.improvement(
        unoptimised.style.overspray_m, request.target_um if zones else target_um,
        paint_weight=request.paint_weight * start_cm3 / wanted_cm3,
    )  # fmt: skip
    models = [unoptimised.model]
    retimed = retime_for_evenness(
        surface, unoptimised.wanted, programme, models, wanted, progress, explain=False
    ).programme
    found = predicted(
        surface, unoptimised.model, request, unoptimised.wanted, retimed.trajectory(),
        lambda share: progress('film', share),
    )  # fmt: skip
    return replace(
        unoptimised, **found, style=style, passes=passes, moves=tuple(moves_of(retimed, wanted)),
        placement=replace(placement, sigma_n=found['sigma_n']), unoptimised=unoptimised,
    )  # fmt: skip


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


def kept_clear(planned: Planned, envelope: GunEnvelope) -> Planned:
    """The plan with the places where gun or spray come too close to the part.

    Raises:
        PlanError: the gun touches the part, and the request does not allow it.
    """
    found = contacts(planned.surface, planned.trajectory, envelope)
    touched = [contact for contact in found if contact.by_gun]
    if touched and not planned.request.allow_contact:
        raise PlanError(
            f'{max(touched, key=lambda contact: contact.depth_m)}; give a greater standoff_m or '
            'smoothing_radius_m, another side (outward), or plan it face by face (--faces auto); '
            'allow_contact keeps it'
        )
    return replace(planned, contacts=found, envelope=envelope)


def _is_round(planned: PlannedFilm) -> bool:
    turned = Rotation.from_quat(planned.trajectory.quaternions_xyzw) * QUARTER
    trajectory = replace(planned.trajectory, quaternions_xyzw=turned.as_quat())
    film_um, _ = simulated(planned.surface, planned.model, trajectory)
    return bool(np.abs(film_um - planned.film_um).max() < ROUND * planned.film_um.max())
