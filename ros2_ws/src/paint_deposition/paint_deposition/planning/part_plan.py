"""Passes for a part that one raster does not cover: face by face, in order, and checked."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PlanError
from paint_deposition.part.sprayable_faces import WIDEST_RAD, Face, sprayable_faces
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import PointZones
from paint_deposition.planning.clearance import contacts
from paint_deposition.planning.faces import blend, join_motions, order_faces
from paint_deposition.planning.planned_film import PlannedFilm, WantedFilm, predicted
from paint_deposition.planning.programme import Programme, moves_of
from paint_deposition.planning.requests import GunEnvelope, PlanRequest
from paint_deposition.planning.retiming import retime_for_evenness


@dataclass(frozen=True, kw_only=True, repr=False)
class PartPlan(PlannedFilm):
    """Passes on all faces of a part, with the film that the model predicts.

    Attributes:
        faces: sprayed, the largest first.
        margin_m: by how much each face is sprayed less far than its seams.
        sigma_n_unblended: sigma_n without margins, each face for itself.
    """

    faces: tuple[Face, ...]
    margin_m: float
    sigma_n_unblended: float

    @property
    def sentence(self) -> str:
        """The plan in a sentence."""
        speeds = self.sprayed_speeds_m_per_s
        return (
            f'{self._faces}, {len(self.passes)} {self.request.direction} passes at '
            f'{min(speeds):.3g} to {max(speeds):.3g} m/s: {super().sentence}'
        )

    @property
    def _faces(self) -> str:
        return '1 face' if len(self.faces) == 1 else f'{len(self.faces)} faces'

    @property
    def comparison(self) -> str:
        """What blending is worth, in a sentence."""
        return (
            f'{self._faces} without blending {100 * self.sigma_n_unblended:.1f} %, '
            f'sprayed {1e3 * self.margin_m:.0f} mm less far at the seams and with '
            f'{"speeds along" if self.request.optimise else "a time for"} each pass '
            f'{100 * self.sigma_n:.1f} %'
        )

    def to_dict(self) -> dict[str, Any]:
        """Figures of the plan."""
        return super().to_dict() | {
            'faces': [
                {'area_m2': face.surface.area_m2, 'outward': face.surface.outward.tolist()}
                for face in self.faces
            ],
            'speeds_m_per_s': [planned.speed_m_per_s for planned in self.passes],
            'margin_m': self.margin_m,
            'sigma_n_unblended': self.sigma_n_unblended,
        }  # fmt: skip


def plan_faces(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    frame_id: str = '',
    widest_rad: float = WIDEST_RAD,
    envelope: GunEnvelope | None = None,
    progress: Callable[[str, float], None] = lambda what, share: None,
    zones: PointZones | None = None,
) -> PartPlan:
    """Split a part into faces, plan each, blend them, and order them for least travel.

    What faces away from ``request.outward``, if given, stays bare. To optimise is to choose the
    speeds along all passes, and where the gun opens and closes, for an even film on all faces
    together. Normals of a face turn from its mean by ``widest_rad`` at the most.

    Raises:
        PlanError: a face has no passes, or the film is less even than the tolerance.
    """
    envelope = envelope or GunEnvelope()
    faces = _facing_gun(sprayable_faces(surface, widest_rad), request)
    painted = np.zeros(len(surface.vertices_m), dtype=bool)
    painted[np.concatenate([face.vertices for face in faces])] = True
    wanted = WantedFilm.of(surface, painted, request.target_um, zones)
    # One film for all: the zones are left to the speeds along the passes.
    each = request.model_copy(
        update={'outward': None, 'tolerance': None, 'target_um': wanted.target_um}
    )
    margin_m, laid, unblended = blend(surface, model, each, faces, wanted, progress)
    running = order_faces(laid)
    progress('motion', 0.0)
    trajectory, moves = join_motions(
        running, frame_id, lambda way: not contacts(surface, way, envelope)
    )
    if request.optimise:
        asked = request.improvement(running[0].style.overspray_m, request.target_um)
        retimed = retime_for_evenness(
            surface, wanted, Programme.of(trajectory), [model], asked, progress, explain=False
        ).programme
        trajectory, moves = retimed.trajectory(), tuple(moves_of(retimed, asked))
    found = predicted(surface, model, request, wanted, trajectory)
    sigma_n = found['sigma_n']
    if request.tolerance is not None and sigma_n > request.tolerance:
        raise PlanError(
            f'no passes on {len(faces)} face(s) keep sigma_n within '
            f'{100 * request.tolerance:g} %; the closest is {100 * sigma_n:.2f} %: '
            'allow that much, or narrower faces (--face-angle-deg)'
        )
    return PartPlan(
        **found, passes=tuple(planned for face in running for planned in face.passes),
        moves=moves, faces=faces, margin_m=margin_m,
        sigma_n_unblended=unblended,
    )  # fmt: skip


def _facing_gun(faces: tuple[Face, ...], request: PlanRequest) -> tuple[Face, ...]:
    """Without those on the back, if the direction to the gun is given."""
    if request.outward is None:
        return faces
    side = np.asarray(request.outward) / np.linalg.norm(request.outward)
    # Faces that turn further from the side of the gun are its back.
    kept = tuple(face for face in faces if face.surface.outward @ side > -0.1)
    if not kept:
        raise PlanError('no surface faces the gun; give the direction to the gun (outward)')
    return kept
