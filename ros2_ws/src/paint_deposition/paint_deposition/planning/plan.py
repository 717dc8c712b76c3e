"""Passes for a part: where they lie, how the gun and a robot run along them, and their film."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.planning.driving import RobotCell
from paint_deposition.planning.passes import (
    WAYPOINT_STEP_M,
    WAYPOINTS_PER_MOVE,
    PassStyle,
    plan_passes,
    planned_moves,
    trajectory_of,
)
from paint_deposition.planning.placement import (
    LineFilms,
    Placement,
    best_placement,
    place_passes,
)
from paint_deposition.planning.planned_film import (
    LaidFilm,
    PlannedFilm,
    WantedFilm,
    contacts,
    simulated,
)
from paint_deposition.planning.programme import Programme, moves_of
from paint_deposition.planning.recommendation import Recommendation, recommend
from paint_deposition.planning.requests import (
    FASTEST_M_PER_S,
    SLOWEST_M_PER_S,
    GunEnvelope,
    ImproveRequest,
    IndexRequest,
    PassRequest,
    PlanRequest,
)
from paint_deposition.planning.retiming import timed_evenly
from paint_deposition.planning.sides import SurfaceMap, pass_axes

Planned = TypeVar('Planned', bound=PlannedFilm)


@dataclass(frozen=True, kw_only=True, repr=False)
class Plan(PlannedFilm):
    """Passes over one side of a part, with the film that the model predicts.

    Attributes:
        style: how passes are run.
        placement: number, index and place of the passes, with sigma_n of the search.
        plane: recommendation for a plane of the part's size.
        line_films: films of single passes, for other placings.
        unoptimised: of an optimised plan, the plan that it started from; else None.
    """

    style: PassStyle
    placement: Placement
    plane: Recommendation
    line_films: LineFilms
    unoptimised: 'Plan | None' = None

    @property
    def sentence(self) -> str:
        """The plan in a sentence."""
        speeds = f'{self.style.speed_m_per_s:.3g} m/s'
        if self.unoptimised or (self.drive and self.drive.limits):
            sprayed = self.sprayed_speeds_m_per_s
            speeds = f'{min(sprayed):.3g} to {max(sprayed):.3g} m/s'
        return (
            f'{len(self.passes)} {self.request.direction} passes at '
            f'{self.placement.index_m * 1e3:.0f} mm, {speeds}: {super().sentence}'
        )

    def to_dict(self) -> dict[str, Any]:
        """Figures of the plan."""
        return super().to_dict() | {
            'index_m': self.placement.index_m,
            'lines_m': [planned.across_m for planned in self.passes],
            'travel': 'one_way' if self.request.one_way else 'alternating',
            'gun_turns': False,
            'standoff_m': self.style.standoff_m,
            'overspray_m': self.style.overspray_m,
            'acceleration_m_per_s2': self.style.acceleration_m_per_s2,
            'smoothing_radius_m': self.request.smoothing_radius_m,
            'plain': self.unoptimised
            and {
                'sigma_n': self.unoptimised.sigma_n,
                'zones': self.unoptimised.statistics.to_dict().get('zones', []),
                'mean_um': self.unoptimised.mean_um,
                'paint_cm3': self.unoptimised.statistics.emitted_volume_cm3,
                'cycle_time_s': self.unoptimised.cycle_time_s,
                'passes': self.unoptimised.placement.passes,
                'capture_fraction': self.unoptimised.statistics.capture_fraction,
            },
        }


def plan(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    frame_id: str = '',
    progress: Callable[[str, float], None] = lambda what, share: None,
    zones: Zones | None = None,
) -> Plan:
    """Plan passes and simulate their film; ``progress`` gets the step and its share, 0 to 1.

    With ``zones`` of the vertices the even film of one speed is of their mean target.

    Raises:
        PaintError: the request has no answer; says why and what comes closest.
    """
    axes = pass_axes(surface, request.direction, request.outward)
    surface_map = SurfaceMap(surface, axes, request.smoothing_radius_m)
    wanted = WantedFilm.of(surface, surface_map.painted, request.target_um, zones)
    width, height = np.ptp(surface_map.extent_m, axis=1).tolist()
    # Speeds along the passes may make a film even that is not at one speed.
    tolerance = None if request.optimise else request.tolerance
    even = request.model_copy(update={'target_um': wanted.target_um, 'tolerance': tolerance})
    # On a plane of the part's size, at any speed: a part needs another than its plane.
    on_plane = IndexRequest(
        **{name: getattr(even, name) for name in PassRequest.model_fields},
        width_m=height, length_m=width,
        speed_min_m_per_s=SLOWEST_M_PER_S, speed_max_m_per_s=FASTEST_M_PER_S,
    )  # fmt: skip
    try:
        plane = recommend(model, on_plane)
    except PaintError:  # a part may keep to a tolerance that no plane keeps to
        plane = recommend(model, on_plane.model_copy(update={'tolerance': None}))
    style = _style(model, request, plane)
    films = LineFilms(
        surface, surface_map, model, style, plane.curve.parallel.first.finest_m,
        0.5 * plane.sb50_m, lambda share: progress('single passes', share),
    )  # fmt: skip
    placement = place_passes(films, request.index_range_m(plane.index_m), tolerance)
    target = None if request.speed_m_per_s else wanted.target_um
    rounds = 4
    for round_ in range(rounds):
        passes = plan_passes(surface_map, placement.lines_m(request.direction), style)
        trajectory = trajectory_of(passes, frame_id)
        film = simulated(surface, model, trajectory, lambda share: progress('film', share))
        laid = LaidFilm.of(surface, wanted, trajectory, *film)
        ratio = laid.mean_um / target if target else 1.0
        if abs(ratio - 1.0) <= 2e-3 or round_ == rounds - 1:
            break
        style = replace(style, speed_m_per_s=style.speed_m_per_s * ratio)
    if tolerance is not None and laid.sigma_n > tolerance:
        raise PaintError(
            f'{len(passes)} passes at {placement.index_m:.3f} m lay a film of sigma_n '
            f'{100 * laid.sigma_n:.2f} %, not within {100 * tolerance:g} %: allow that much, '
            'or a smaller index, or choose speeds along the passes (--optimise)'
        )
    return Plan(
        **vars(laid), surface=surface, model=model, request=request, wanted=wanted,
        passes=passes, moves=tuple(planned_moves(passes)), style=style, placement=placement,
        plane=plane, line_films=films,
    )  # fmt: skip


def _style(model: DepositionModel, request: PlanRequest, plane: Recommendation) -> PassStyle:
    overspray = request.overspray_m
    if overspray is None:
        magnification = model.projection.magnification(plane.standoff_m)
        radii = np.linspace(0.0, model.planar.radius_of_flux_m(1e-6), 500)
        enclosed = model.planar.enclosed_fraction(radii)
        # The gun opens where 90 % of the pattern's volume begin to reach the part.
        overspray = magnification * float(np.interp(0.9, enclosed, radii))
    return PassStyle(
        standoff_m=plane.standoff_m,
        speed_m_per_s=plane.speed_m_per_s,
        acceleration_m_per_s2=request.acceleration_m_per_s2,
        overspray_m=overspray,
        band_m=0.25 * plane.sb50_m,
        travel_rad=request.travel_rad,
        one_way=request.one_way,
        brush=model.brush,
    )


def optimise(
    unoptimised: Plan, progress: Callable[[str, float], None] = lambda what, share: None
) -> Plan:
    """The better plan that starts from an unoptimised one, for the same film wanted.

    The cost is sigma_n squared, and the weights of the request times the paint sprayed over the
    paint wanted on the part, and the cycle time over that of the unoptimised plan.

    Raises:
        PaintError: the film of no number of passes keeps to the tolerance; names the closest.
    """
    request, count = unoptimised.request, len(unoptimised.passes)
    target = unoptimised.wanted.target_um or unoptimised.mean_um
    areas_m2 = unoptimised.surface.vertex_areas_m2
    wanted_cm3 = target * float(areas_m2[unoptimised.wanted.region].sum())
    index_range_m = request.index_range_m(unoptimised.plane.index_m)
    placements = [unoptimised.placement]
    # From two passes fewer than in the unoptimised plan to one more.
    for passes in range(max(1, count - 2), count + 2):
        if passes != count:
            placement = best_placement(unoptimised.line_films, index_range_m, passes)
            placements += [placement] if placement else []
    tried = []
    for number, placement in enumerate(sorted(placements, key=lambda one: one.passes)):

        def show(what: str, share: float, number: int = number) -> None:
            progress(what, (number + share) / len(placements))

        tried.append(_timed_plan(unoptimised, placement, target, wanted_cm3, show))
    closest = min(tried, key=lambda one: one.sigma_n)
    most = request.tolerance or closest.sigma_n
    if closest.sigma_n > most:
        raise PaintError(
            f'no speeds along {count} passes, or about as many, keep sigma_n within '
            f'{100 * most:g} %; the closest is {100 * closest.sigma_n:.2f} % with '
            f'{len(closest.passes)} at {closest.placement.index_m:.3f} m: allow that much, a '
            'smaller index, or other speeds (--speed-min, --speed-max)'
        )
    if request.tolerance is not None:
        tried = [one for one in tried if one.sigma_n <= most]
    costs = [
        one.sigma_n**2
        + request.paint_weight * one.paint.emitted_cm3 / wanted_cm3
        + request.time_weight * one.cycle_time_s / unoptimised.cycle_time_s
        for one in tried
    ]
    # A further pass must save 5 % of the cost: neither rounding nor an immeasurable gain
    # decides the number of passes.
    enough = min(costs) / 0.95
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
    # The lead-in is long enough for a speed at the ends of a pass of this many times the mean.
    style = replace(unoptimised.style, speed_m_per_s=1.3 * speed)
    lines = placement.lines_m(request.direction)
    passes = tuple(
        replace(planned, speed_m_per_s=speed)
        for planned in plan_passes(unoptimised.line_films.surface_map, lines, style)
    )
    model = unoptimised.model
    trajectory, moves = timed_evenly(
        surface, model, request, unoptimised.wanted, passes,
        trajectory_of(passes, unoptimised.trajectory.frame_id),
        target_um, wanted_cm3, unoptimised.cycle_time_s, progress,
    )  # fmt: skip
    film = simulated(surface, model, trajectory, lambda share: progress('film', share))
    laid = LaidFilm.of(surface, unoptimised.wanted, trajectory, *film)
    return replace(
        unoptimised, **vars(laid), style=style, passes=passes, moves=moves,
        placement=replace(placement, sigma_n=laid.sigma_n), unoptimised=unoptimised,
    )  # fmt: skip


def driven(planned: Planned, cell: RobotCell) -> Planned:
    """The plan with the joints that drive it, and its film at the speeds that they allow.

    The tool is turned about its own axis where that helps and the pattern is round.

    Raises:
        PaintError: the robot does not reach all passes, or its film exceeds the tolerance.
    """
    request, trajectory = planned.request, planned.trajectory
    quarter = Rotation.from_rotvec([0.0, 0.0, 0.5 * np.pi])
    turned = (Rotation.from_quat(trajectory.quaternions_xyzw) * quarter).as_quat()
    surface, model = planned.surface, planned.model
    film_um, _ = simulated(surface, model, replace(trajectory, quaternions_xyzw=turned))
    # It is round if a quarter turn of the tool changes the film by less than 1e-3 of its peak.
    changed_um = np.abs(film_um - planned.film_um).max()
    drive = cell.drive(trajectory, bool(changed_um < 1e-3 * planned.film_um.max()))
    film = simulated(surface, model, drive.trajectory)
    laid = LaidFilm.of(surface, planned.wanted, drive.trajectory, *film)
    sigma_n, most = laid.sigma_n, request.tolerance
    if most is not None and sigma_n > most:
        raise PaintError(
            f'as the robot drives it sigma_n is {100 * sigma_n:.2f} %, where a tolerance of '
            f'{100 * most:g} % is given: allow that much, or let the part stand elsewhere, paint '
            'place shows where'
        )
    # The robot program has moves as long as one that keeps the planned speeds.
    shortest_m = WAYPOINT_STEP_M * WAYPOINTS_PER_MOVE
    wanted = ImproveRequest(move_min_m=shortest_m)
    moves = tuple(moves_of(Programme.of(drive.trajectory), wanted))
    return replace(planned, **vars(laid), moves=moves, drive=drive)


def kept_clear(planned: Planned, envelope: GunEnvelope) -> Planned:
    """The plan with the places where gun or spray come too close to the part.

    Raises:
        PaintError: the gun touches the part.
    """
    found = contacts(planned.surface, planned.trajectory, envelope)
    touched = [contact for contact in found if contact.by_gun]
    if touched:
        raise PaintError(
            f'{max(touched, key=lambda contact: contact.depth_m)}; give a greater standoff_m or '
            'smoothing_radius_m, another side (outward), a smaller gun (--gun-radius-m, '
            '--gun-length-m), or plan it face by face with `paint plan --faces auto`'
        )
    return replace(planned, contacts=found, envelope=envelope)
