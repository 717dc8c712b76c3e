"""Passes for a part that one raster does not cover: face by face, in order, and checked."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PlanError
from paint_deposition.film.paint_used import NO_PAINT, PaintUsed, paint_figures
from paint_deposition.film.statistics import FilmStatistics, film_statistics
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.sprayable_faces import WIDEST_RAD, Face, sprayable_faces
from paint_deposition.part.surface import Surface
from paint_deposition.planning.clearance import Contact, contacts
from paint_deposition.planning.faces import blend, in_order, motion_over
from paint_deposition.planning.films import evenness, simulated
from paint_deposition.planning.improvement.programme import Programme, moves_of
from paint_deposition.planning.improvement.retiming import retime_for_evenness
from paint_deposition.planning.passes import PlannedPass
from paint_deposition.planning.plan import plan, planned_statistics
from paint_deposition.planning.requests import GunEnvelope, PlanRequest

# Faces that turn further from the side of the gun are its back.
BACK_COSINE = -0.1


@dataclass(frozen=True)
class PartPlan:
    """Passes on all faces of a part with the film that the model predicts.

    Attributes:
        surface: the part. request: what was asked for. faces: sprayed, the largest first.
        margin_m: by how much each face is sprayed less far than its seams.
        passes: in running order. moves: the same as a robot program. trajectory: timed.
        film_um: (V,) film on the refined part. painted: (V,) bool, the faces.
        statistics: of the film on the faces. sigma_n: standard deviation over mean there.
        sigma_n_unblended: the same without margins, each face for itself.
        sigma_n_one_raster, coverage_one_raster: of the passes of one raster over the whole part,
            nan where it has no one side.
        contacts: where gun or spray come too near to the part. envelope: of the gun.
        model: what the gun sprays. paint: that is sprayed.
    """

    surface: Surface
    request: PlanRequest
    faces: tuple[Face, ...]
    margin_m: float
    passes: tuple[PlannedPass, ...]
    moves: tuple[Move, ...]
    trajectory: Trajectory
    film_um: np.ndarray
    painted: np.ndarray
    statistics: FilmStatistics
    sigma_n: float
    sigma_n_unblended: float
    sigma_n_one_raster: float
    coverage_one_raster: float
    contacts: tuple[Contact, ...]
    envelope: GunEnvelope
    model: DepositionModel
    paint: PaintUsed = NO_PAINT

    @property
    def cycle_time_s(self) -> float:
        """From the first pose to the last [s]."""
        return self.trajectory.duration_s

    @cached_property
    def path(self) -> SprayPath:
        """The motion cut into sub-steps."""
        return spray_path(self.trajectory)[0]

    @property
    def sentence(self) -> str:
        """The plan in a sentence."""
        speeds = [move.speed_m_per_s for move in self.moves if move.spraying]
        return (
            f'{self._faces}, {len(self.passes)} {self.request.direction} passes at '
            f'{min(speeds):.3g} to {max(speeds):.3g} m/s: mean film '
            f'{self.statistics.mean_um:.1f} µm, sigma_n {100 * self.sigma_n:.1f} %, '
            f'{self.cycle_time_s:.1f} s'
        )

    @property
    def _faces(self) -> str:
        return '1 face' if len(self.faces) == 1 else f'{len(self.faces)} faces'

    @property
    def comparison(self) -> str:
        """What faces and blending are worth, in a sentence."""
        raster = 'one raster has no side to lie on'
        if math.isfinite(self.sigma_n_one_raster):
            raster = (
                f'one raster covers {100 * self.coverage_one_raster:.0f} % with sigma_n '
                f'{100 * self.sigma_n_one_raster:.1f} %'
            )
        return (
            f'{raster}; {self._faces} without blending {100 * self.sigma_n_unblended:.1f} %, '
            f'sprayed {1e3 * self.margin_m:.0f} mm less far at the seams and with '
            f'{"speeds along" if self.request.optimise else "a time for"} each pass '
            f'{100 * self.sigma_n:.1f} %'
        )

    def __repr__(self) -> str:
        return f'PartPlan({self.sentence})'

    def to_dict(self) -> dict[str, Any]:
        """Figures of the plan."""
        return {
            'direction': self.request.direction,
            'faces': [
                {
                    'area_m2': face.surface.area_m2,
                    'outward': face.surface.outward.tolist(),
                }
                for face in self.faces
            ],
            'passes': len(self.passes),
            'speeds_m_per_s': [planned.speed_m_per_s for planned in self.passes],
            'margin_m': self.margin_m,
            'cycle_time_s': self.cycle_time_s,
            'sprayed_m': sum(planned.sprayed_m for planned in self.passes),
            'sigma_n': self.sigma_n,
            'sigma_n_unblended': self.sigma_n_unblended,
            'one_raster': {
                'sigma_n': self.sigma_n_one_raster, 'coverage': self.coverage_one_raster,
            },
            'film': self.statistics.to_dict(),
            'paint': paint_figures(self),
            'gun': self.envelope.model_dump(),
            'contacts': [contact.to_dict() for contact in self.contacts],
        }  # fmt: skip


def plan_faces(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    frame_id: str = '',
    widest_rad: float = WIDEST_RAD,
    envelope: GunEnvelope | None = None,
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> PartPlan:
    """Split a part into faces, plan each, blend them, and order them for least travel.

    Args:
        surface: the part; what faces away from ``request.outward``, if given, stays bare.
        model: what the gun sprays.
        request: for each face; to optimise is to choose the speeds along all passes, and where
            the gun opens and closes, for an even film on all faces together.
        frame_id: of the poses.
        widest_rad: greatest angle between a normal of a face and its mean.
        envelope: of the gun, for the check that it keeps clear of the part.
        progress: called with what is done and its share, 0 to 1.

    Raises:
        PlanError: a face has no passes, or the film is less even than the tolerance.
    """
    envelope = envelope or GunEnvelope()
    faces = _of_the_gun(sprayable_faces(surface, widest_rad), request)
    painted = np.zeros(len(surface.vertices_m), dtype=bool)
    painted[np.concatenate([face.vertices for face in faces])] = True
    area = np.where(painted, surface.vertex_areas_m2, 0.0)
    each = request.model_copy(update={'outward': None, 'tolerance': None})
    blended = blend(surface, model, each, faces, area, progress)
    running = in_order(blended.faces)
    progress('motion', 0.0)
    trajectory, moves = motion_over(
        running, frame_id, lambda way: not contacts(surface, way, envelope)
    )
    if request.optimise:
        wanted = request.improvement(running[0].style.overspray_m, request.target_um)
        retimed = retime_for_evenness(
            surface, painted, Programme.of(trajectory), [model], wanted, progress, explained=False
        ).programme
        trajectory, moves = retimed.trajectory(), tuple(moves_of(retimed, wanted))
    film, paint = simulated(surface, model, trajectory)
    _, sigma_n = evenness(film, area)
    if request.tolerance is not None and sigma_n > request.tolerance:
        raise PlanError(
            f'no passes on {len(faces)} face(s) keep sigma_n within {request.tolerance:g}; the '
            f'closest is {sigma_n:.4f}: allow that much, or narrower faces (--face-angle-deg)'
        )
    progress('one raster', 0.0)
    anyhow = request.model_copy(update={'tolerance': None})
    raster = _one_raster(surface, model, anyhow, painted, area)
    statistics = planned_statistics(film[painted], area[painted], paint.emitted_cm3, request)
    passes = tuple(planned for face in running for planned in face.passes)
    return PartPlan(
        surface, request, faces, blended.margin_m, passes, moves, trajectory,
        film, painted, statistics, sigma_n, blended.sigma_n_before,
        *raster, contacts(surface, trajectory, envelope), envelope, model, paint,
    )  # fmt: skip


def _of_the_gun(faces: tuple[Face, ...], request: PlanRequest) -> tuple[Face, ...]:
    """Without those on the back, if it is said where the gun stands."""
    if request.outward is None:
        return faces
    side = np.asarray(request.outward) / np.linalg.norm(request.outward)
    kept = tuple(face for face in faces if face.surface.outward @ side > BACK_COSINE)
    if not kept:
        raise PlanError('no surface faces the gun; give the direction to the gun (outward)')
    return kept


def _one_raster(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    painted: np.ndarray,
    area: np.ndarray,
) -> tuple[float, float]:
    """sigma_n and coverage of the plan for the whole part at once, on the same surface."""
    try:
        film_um = plan(surface, model, request).film_um
    except PlanError:
        return math.nan, math.nan
    statistics = film_statistics(film_um[painted], area[painted], 1.0)
    return evenness(film_um, area)[1], statistics.coverage
