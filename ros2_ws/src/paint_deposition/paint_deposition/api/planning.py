"""Where passes should lie, how fast they are driven, and where part and robot stand for it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.api.simulation import look_at
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError, RecordingError
from paint_deposition.files.recordings.joint_states import Robot
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.inference.fitting.parameters import Posterior
from paint_deposition.inference.fitting.posterior import draw_models
from paint_deposition.motion.programmed import timed
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.motion.transforms import Rigid
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.planning.driving import RobotCell
from paint_deposition.planning.faces import PartPlan
from paint_deposition.planning.faces import plan_faces as planned_faces
from paint_deposition.planning.improvement import Improvement
from paint_deposition.planning.plan import Plan, driven, kept_clear, optimise
from paint_deposition.planning.plan import plan as planned
from paint_deposition.planning.planned_film import (
    DEFAULT_TOLERANCE,
    LaidFilm,
    WantedFilm,
    evenness,
    simulated,
)
from paint_deposition.planning.programme import Programme, closed_beside, moves_of
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.planning.recommendation import recommend as recommended
from paint_deposition.planning.requests import (
    GunEnvelope,
    ImproveRequest,
    IndexRequest,
    PlanRequest,
)
from paint_deposition.planning.retiming import retime_for_evenness
from paint_deposition.planning.sides import WIDEST_RAD, painted_side
from paint_deposition.request import POSE_FORMAT, is_pose, takes

Progress = Callable[[str, float], None]


@takes(IndexRequest)
def recommend(model: DepositionModel | None = None, **wanted: Any) -> Recommendation:
    """Recommend the index between parallel passes on a plane.

    Args:
        model: what the gun sprays; default: a 50 mm bell.
        wanted: the fields of ``planning.requests.IndexRequest``; ``speed_m_per_s`` or
            ``target_um`` at least.

    Raises:
        PaintError: the request has no answer; says why and what comes closest.
    """
    return recommended(model or DepositionModel(), IndexRequest(**wanted))


@takes(PlanRequest)
def plan(
    surface: Surface,
    model: DepositionModel | None = None,
    *,
    frame_id: str = 'part',
    envelope: GunEnvelope | None = None,
    robot: RobotCell | None = None,
    zones: Zones | None = None,
    progress: Progress = lambda what, share: None,
    **wanted: Any,
) -> Plan:
    """Lay passes over a part and compute the film to expect.

    Args:
        surface: the part.
        model: what the gun sprays; default: a 50 mm bell.
        frame_id: of the planned poses.
        envelope: of the gun, which must keep clear of the part.
        robot: that is to drive it, from ``read_robot``: passes that its joints cannot keep up
            with are slower, and the plan has the joints; default: any robot does.
        zones: regions with targets of their own, from ``read_zones``: the speeds along the passes
            are chosen for the film over its own target, as by ``optimise``.
        progress: called with what is being done and the share of it that is done, 0 to 1.
        wanted: the fields of ``planning.requests.PlanRequest``; ``speed_m_per_s`` or
            ``target_um`` at least, or zones.

    Raises:
        PaintError: the request has no answer, the gun touches the part, or a zone has no vertex of
            it; says why and what comes closest.
    """
    request, on_part = _with_zones(surface, zones, wanted)
    unoptimised = planned(
        surface, model or DepositionModel(), request, frame_id, progress, on_part
    )
    found = optimise(unoptimised, progress) if request.optimise else unoptimised
    return kept_clear(driven(found, robot) if robot else found, envelope or GunEnvelope())


@takes(PlanRequest)
def plan_faces(
    surface: Surface,
    model: DepositionModel | None = None,
    *,
    frame_id: str = 'part',
    face_angle_deg: float = math.degrees(WIDEST_RAD),
    envelope: GunEnvelope | None = None,
    robot: RobotCell | None = None,
    zones: Zones | None = None,
    progress: Progress = lambda what, share: None,
    **wanted: Any,
) -> PartPlan:
    """Lay passes over a part that has several sides, each of them sprayed by itself.

    Args:
        surface, model, frame_id, envelope, robot, zones, progress, wanted: as for ``plan``. With
            ``outward``, faces on the back are left out; ``optimise`` chooses the speeds along the
            passes for an even film on all faces together.
        face_angle_deg: greatest angle between a normal of a face and its mean [deg].

    Raises:
        PaintError: the request has no answer; says why and what comes closest.
    """
    request, on_part = _with_zones(surface, zones, wanted)
    envelope = envelope or GunEnvelope()
    found = planned_faces(
        surface, model or DepositionModel(), request, frame_id, math.radians(face_angle_deg),
        envelope, progress, on_part,
    )  # fmt: skip
    return kept_clear(driven(found, robot) if robot else found, envelope)


def _with_zones(
    surface: Surface, zones: Zones | None, wanted: dict[str, Any]
) -> tuple[PlanRequest, Zones | None]:
    """The request, and the zones of the vertices: their targets need speeds along the passes."""
    if zones is None:
        return PlanRequest(**wanted), None
    return PlanRequest(**(wanted | {'optimise': True})), zones.on(surface)


@takes(ImproveRequest)
def improve(
    surface: Surface,
    trajectory: Trajectory,
    model: DepositionModel | None = None,
    *,
    posterior: Posterior | None = None,
    target_region: np.ndarray | None = None,
    zones: Zones | None = None,
    robot: RobotCell | None = None,
    seed: int = 0,
    progress: Progress = lambda what, share: None,
    **wanted: Any,
) -> Improvement:
    """Keep the path of a programme and change its speeds, flows and triggers.

    Args:
        surface: the part; it is turned round, with a note, if the gun looks at its back.
        trajectory: the programme, in the frame of the mesh.
        model: what the gun sprays; default: a 50 mm bell.
        posterior: what is known of the model; the film is made even over draws from it.
        target_region: (V,) bool, vertices whose film counts; default: the side that the gun
            faces, where the programme lays more than a tenth of its greatest film.
        zones: regions with targets of their own, from ``read_zones``: the film over its own target
            is made even. Elsewhere it counts only where ``target_um`` is given.
        robot: that is to drive it, from ``read_robot``: its joints limit the speeds.
        seed: of the draws.
        progress: called with what is being done and the share of it that is done, 0 to 1.
        wanted: the fields of ``planning.requests.ImproveRequest``.

    Raises:
        RecordingError: the motion cannot be used.
        PaintError: the limits leave no motion, or a zone has no vertex of the part.
    """
    model = model or DepositionModel()
    request = ImproveRequest(**wanted)
    seen = look_at(surface, trajectory, model)
    surface, original = seen.surface, Programme.of(trajectory)
    if not request.spray_turns:
        original = closed_beside(original, surface)
    begin = None
    point_zones = zones.on(surface) if zones else None
    if robot:
        allowed, begin = robot.allowed_speeds(trajectory)
        original = replace(original, allowed=allowed)
    progress('the film as it is', 0.0)
    film_um, paint = simulated(surface, model, trajectory)
    if film_um.max() < NO_PAINT_UM:
        raise RecordingError(f'{trajectory.source}: no paint lands on the part')
    if target_region is None:
        target_region = film_um > 0.1 * film_um.max()
        towards = -seen.path.rotation[seen.path.flow > 0.0][:, :, 2].mean(axis=0)
        # A gun whose mean direction is shorter paints more sides than one.
        if (length := np.linalg.norm(towards)) >= 0.9:
            target_region &= painted_side(surface, towards / length)
    if not target_region.any():
        raise PaintError(
            f'{trajectory.source}: nowhere does the gun face what it paints; check its axis '
            '(--tool-axis) and where the part stands (--part-pose), paint inspect draws both'
        )
    sought = WantedFilm.of(surface, target_region, request.target_um, point_zones)
    target_um = sought.target_um
    if target_um is None:
        target_um, _ = evenness(film_um[target_region], surface.vertex_areas_m2[target_region])
        sought = replace(sought, target_um=target_um, elsewhere_um=target_um)
    models = [model]
    if posterior is not None:
        models += draw_models(model, posterior, 8, seed)
    programme, binding, limits, of_path = retime_for_evenness(
        surface, sought, original, models, request, progress
    )
    drive = None
    if robot:
        drive = robot.drive(programme.trajectory(), free_roll=False, begin=begin)
        programme = Programme.of(drive.trajectory)
    moves = moves_of(programme, request)
    progress('the film as it will be', 0.0)
    improved = programme.trajectory()
    new_um, new_paint = simulated(surface, model, improved)
    program_um, _ = simulated(surface, model, timed(moves, gun_known=True))
    tolerance = request.tolerance or DEFAULT_TOLERANCE
    before = LaidFilm.of(surface, sought, trajectory, film_um, paint, tolerance)
    after = LaidFilm.of(surface, sought, improved, new_um, new_paint, tolerance)
    return Improvement(
        surface, sought, model, request, improved, moves, original, programme, target_um,
        binding=binding, binding_limits=limits, sigma_n_of_path=min(of_path, after.sigma_n),
        before=before, after=after,
        program_difference=float(np.abs(program_um - new_um).max() / new_um.max()),
        geometry_warnings=(*seen.trajectory.warnings, *seen.geometry.warnings), drive=drive,
    )  # fmt: skip


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
        raise PaintError(f'part_pose is {list(part_pose)}; give {POSE_FORMAT}')
    arm = Robot.read(Path(urdf), tip_link, base_link).arm
    unknown = np.array(arm.joints)[np.isinf(arm.fastest)]
    if len(unknown):
        raise PaintError(
            f'the URDF has no greatest speed of {" ".join(unknown)}; give each a limit, as '
            '<limit lower="-3" upper="3" effort="0" velocity="2"/>'
        )
    return RobotCell(arm, Rigid.of(part_pose), joint_acceleration)
