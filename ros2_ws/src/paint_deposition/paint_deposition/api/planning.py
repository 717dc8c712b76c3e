"""Where passes should lie: the index on a plane, and passes on a part."""

import math
from collections.abc import Callable
from typing import Any

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.part.sprayable_faces import WIDEST_RAD
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import PointZones, Zones
from paint_deposition.planning.driving import RobotCell
from paint_deposition.planning.faces import PartPlan
from paint_deposition.planning.faces import plan_faces as planned_faces
from paint_deposition.planning.plan import Plan, driven, kept_clear, optimise
from paint_deposition.planning.plan import plan as planned
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.planning.recommendation import recommend as recommended
from paint_deposition.planning.requests import GunEnvelope, IndexRequest, PlanRequest
from paint_deposition.request import takes


@takes(IndexRequest)
def recommend(model: DepositionModel | None = None, **wanted: Any) -> Recommendation:
    """Recommend the index between parallel passes on a plane.

    Args:
        model: what the gun sprays; default: a 50 mm bell.
        wanted: the fields of ``planning.requests.IndexRequest``; ``speed_m_per_s`` or
            ``target_um`` at least.

    Raises:
        PlanError: the request has no answer; says why and what comes closest.
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
    progress: Callable[[str, float], None] = lambda what, share: None,
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
        PlanError: the request has no answer, or the gun touches the part; says why and what comes
            closest.
        PaintError: a zone has no vertex of the part.
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
    progress: Callable[[str, float], None] = lambda what, share: None,
    **wanted: Any,
) -> PartPlan:
    """Lay passes over a part that has several sides, each of them sprayed by itself.

    Args:
        surface, model, frame_id, envelope, robot, zones, progress, wanted: as for ``plan``. With
            ``outward``, faces on the back are left out; ``optimise`` chooses the speeds along the
            passes for an even film on all faces together.
        face_angle_deg: greatest angle between a normal of a face and its mean [deg].

    Raises:
        PlanError: the request has no answer; says why and what comes closest.
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
) -> tuple[PlanRequest, PointZones | None]:
    """The request, and the zones of the vertices: their targets need speeds along the passes."""
    if zones is None:
        return PlanRequest(**wanted), None
    return PlanRequest(**(wanted | {'optimise': True})), zones.on(surface)
