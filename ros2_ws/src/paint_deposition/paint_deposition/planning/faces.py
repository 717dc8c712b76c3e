"""Passes for a part that one raster does not cover: its faces one by one, and from face to face.

The faces overlap at their seams, because the spray of each reaches beyond it. Two things even
that out on the film of all faces together: how far from its seams each face is sprayed, found by
a search over a margin that they share, and the time that the gun spends on each pass, by bounded
least squares, since the film is linear in it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move, timed
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.planning.passes import PlannedPass, plan_passes, planned_moves, trajectory_of
from paint_deposition.planning.plan import plan
from paint_deposition.planning.planned_film import (
    LaidFilm,
    PlannedFilm,
    WantedFilm,
    contacts,
    evenness,
    simulated,
)
from paint_deposition.planning.requests import GunEnvelope, PlanRequest
from paint_deposition.planning.retiming import timed_evenly
from paint_deposition.planning.sides import WIDEST_RAD, Face, sprayable_faces

# Of one face, in running order.
Passes = tuple[PlannedPass, ...]


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
        faces = '1 face' if len(self.faces) == 1 else f'{len(self.faces)} faces'
        return (
            f'{faces}, {len(self.passes)} {self.request.direction} passes at '
            f'{min(speeds):.3g} to {max(speeds):.3g} m/s: {super().sentence}'
        )

    def to_dict(self) -> dict[str, Any]:
        """Figures of the plan."""
        return super().to_dict() | {
            'faces': [
                {'area_m2': face.surface.area_m2, 'outward': face.surface.outward.tolist()}
                for face in self.faces
            ],
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
    zones: Zones | None = None,
) -> PartPlan:
    """Split a part into faces, plan each, blend them, and order them for least travel.

    What faces away from ``request.outward``, if given, stays bare. To optimise is to choose the
    speeds along all passes, and where the gun opens and closes, for an even film on all faces
    together. Normals of a face turn from its mean by ``widest_rad`` at the
    most, but for 5 % of the area and small patches that go with a neighbour.

    Raises:
        PaintError: a face has no passes, or the film is less even than the tolerance.
    """
    envelope = envelope or GunEnvelope()
    faces = sprayable_faces(surface, widest_rad)
    if request.outward is not None:
        side = np.asarray(request.outward) / np.linalg.norm(request.outward)
        # Faces that turn further from the side of the gun are its back.
        faces = tuple(face for face in faces if face.surface.outward @ side > -0.1)
        if not faces:
            raise PaintError(
                f'no surface faces the gun at {" ".join(f"{one:.2g}" for one in side)} from the '
                'part; give another direction to it (outward)'
            )
    painted = np.zeros(len(surface.vertices_m), dtype=bool)
    painted[np.concatenate([face.vertices for face in faces])] = True
    wanted = WantedFilm.of(surface, painted, request.target_um, zones)
    # One film for all: the zones are left to the speeds along the passes.
    each = request.model_copy(
        update={'outward': None, 'tolerance': None, 'target_um': wanted.target_um}
    )
    margin_m, laid, unblended = _blended(surface, model, each, faces, wanted, progress)
    running = order_faces(laid)
    passes = tuple(planned for face in running for planned in face)
    progress('motion', 0.0)
    trajectory, moves = join_motions(
        running, frame_id, lambda way: not contacts(surface, way, envelope)
    )
    if request.optimise:
        target_um = wanted.target_um
        if target_um is None:
            area_m2, (film_um, _) = surface.vertex_areas_m2, simulated(surface, model, trajectory)
            target_um, _ = evenness(film_um[painted], area_m2[painted])
        wanted_cm3 = target_um * float(surface.vertex_areas_m2[wanted.region].sum())
        trajectory, moves = timed_evenly(
            surface, model, request, wanted, passes, trajectory, request.target_um, wanted_cm3,
            trajectory.duration_s, progress,
        )  # fmt: skip
    film = LaidFilm.of(surface, wanted, trajectory, *simulated(surface, model, trajectory))
    sigma_n = film.sigma_n
    if request.tolerance is not None and sigma_n > request.tolerance:
        raise PaintError(
            f'no passes on {len(faces)} face(s) keep sigma_n within '
            f'{100 * request.tolerance:g} %; the closest is {100 * sigma_n:.2f} %: '
            'allow that much, or narrower faces (--face-angle-deg)'
        )
    return PartPlan(
        **vars(film), surface=surface, model=model, request=request, wanted=wanted,
        passes=passes, moves=moves, faces=faces, margin_m=margin_m, sigma_n_unblended=unblended,
    )  # fmt: skip


def _blended(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    faces: tuple[Face, ...],
    wanted: WantedFilm,
    progress: Callable[[str, float], None],
) -> tuple[float, list[Passes], float]:
    """Lay passes on each face, and choose margin and speeds for an even film of all.

    Even is the film over its own target, where one is wanted. Returned are the margin, by how much
    each face is sprayed less far than its seams [m], the passes of the faces, each at its speed,
    and sigma_n without margin, each face for itself.
    """
    area_m2 = np.where(wanted.region, surface.vertex_areas_m2, 0.0)
    weight = area_m2 / area_m2.sum()
    target = request.target_um if request.speed_m_per_s is None else None
    integrator = FilmIntegrator(surface.points(), model, occluder=surface)
    overspray_m, unblended, tried = 0.0, math.nan, []
    # Margins along the seams, as shares of the overspray.
    shares = (0.0, 0.35, 0.7, 1.0) if len(faces) > 1 else (0.0,)
    for number, share in enumerate(shares):
        progress('faces', number / len(shares))
        margin_m, films = share * overspray_m, []
        plans = [plan(face.without_margin(margin_m).surface, model, request) for face in faces]
        for face in plans:
            for one in face.passes:
                path, _ = spray_path(trajectory_of((one,)), max_step_m=model.max_step_m)
                films.append(integrator.raw_of(path) / wanted.share)
        films_um = np.array(films)
        # The time on each pass, over what it is on its face alone, for an even film of all. It
        # stays within half and twice that, and near it.
        level_um = target or float(weight @ films_um.sum(axis=0))
        rows = np.sqrt(weight)[:, np.newaxis] * films_um.T / level_um
        ridge = 0.02 * np.eye(len(films_um)) / math.sqrt(len(films_um))
        wished = np.concatenate([np.sqrt(weight), ridge.sum(axis=1)])
        dwell = lsq_linear(np.vstack([rows, ridge]), wished, (0.5, 2.0)).x
        tried.append((evenness(dwell @ films_um, area_m2)[1], margin_m, plans, dwell))
        if not number:
            overspray_m = plans[0].style.overspray_m
            _, unblended = evenness(films_um.sum(axis=0), area_m2)
    _, margin_m, plans, dwell = min(tried, key=lambda one: one[0])
    # The passes at their new speeds, with a lead-in to match.
    found, shares = [], iter(dwell.tolist())
    for face in plans:
        lines_m = [planned.across_m for planned in face.passes]
        speeds = [planned.speed_m_per_s / next(shares) for planned in face.passes]
        found.append(plan_passes(face.line_films.surface_map, lines_m, face.style, speeds))
    return margin_m, found, unblended


# --- order, and the way from face to face


def order_faces(faces: Sequence[Passes]) -> tuple[Passes, ...]:
    """The faces in that order, each time the nearest next, which has least travel between them.

    A face may run the other way round, unless its passes all run one way.
    """
    ways: list[tuple[Passes, ...]] = []
    for face in faces:
        turned = tuple(
            replace(
                one, positions_m=one.positions_m[::-1], rotations=one.rotations[::-1],
                along_m=one.along_m[-1] - one.along_m[::-1],
                on_m=float(one.along_m[-1]) - one.off_m, off_m=float(one.along_m[-1]) - one.on_m,
            )
            for one in face[::-1]
        )  # fmt: skip
        ways.append((face,) if face[0].style.one_way else (face, turned))
    tried = []
    for number, first in [(number, way) for number, own in enumerate(ways) for way in own]:
        order, left = [first], dict(enumerate(ways))
        del left[number]
        while left:
            there = [(_travel_m(order[-1], way), k, way) for k, own in left.items() for way in own]
            _, nearest, way = min(there, key=lambda one: one[0])
            order.append(way)
            del left[nearest]
        tried.append(tuple(order))
    # An order and its reverse take the same way: of equal ones the first, whatever the last digit.
    return min(tried, key=lambda order: round(sum(map(_travel_m, order, order[1:])), 6))


def _travel_m(before: Passes, after: Passes) -> float:
    ends = before[-1].positions_m[-1], after[0].positions_m[0]
    return float(np.linalg.norm(ends[1] - ends[0]))


def join_motions(
    faces: Sequence[Passes], frame_id: str, is_clear: Callable[[Trajectory], bool]
) -> tuple[Trajectory, tuple[Move, ...]]:
    """The timed motion that sprays one face after the other, and the moves of a robot program.

    Between the faces the gun retracts along its axis until the way ``is_clear``.
    """
    parts: list[Trajectory] = []
    moves: list[Move] = []
    for number, face in enumerate(faces):
        own = planned_moves(face)
        if number:
            before, after, speed = moves[-1], own[0], face[0].style.transfer_speed_m_per_s
            # Retractions [m]: the first that keeps the gun clear of the part is taken.
            for retreat_m in (0.1, 0.2, 0.4, 0.8):
                between = []
                for move in (before, after):
                    tool_z = Rotation.from_quat(move.quaternion_xyzw).as_matrix()[:, 2]
                    back_m = move.position_m - retreat_m * tool_z
                    between.append(Move(back_m, move.quaternion_xyzw, speed, spraying=False))
                if is_clear(timed([before, *between, replace(after, speed_m_per_s=speed)], False)):
                    break
            parts.append(timed([before, *between, after], gun_known=False))
            moves += between
        parts.append(trajectory_of(face, frame_id))
        moves += own
    # One part after the other; where one ends and the next begins there is one pose.
    clock_ns = 0
    pieces: list[tuple[np.ndarray, ...]] = []
    for part in parts:
        shift_ns, rows = clock_ns - int(part.stamps_ns[0]), slice(1 if pieces else 0, None)
        pieces.append((
            part.stamps_ns[rows] + shift_ns, part.positions_m[rows], part.quaternions_xyzw[rows],
            part.trigger_stamps_ns + shift_ns, part.trigger_flow, part.trigger_brush,
        ))  # fmt: skip
        clock_ns += int(part.stamps_ns[-1] - part.stamps_ns[0])
    stamps, positions, quaternions, switched, flow, brush = map(
        np.concatenate, zip(*pieces, strict=True)
    )
    joined = Trajectory(
        stamps, positions, quaternions, frame_id=frame_id,
        trigger_stamps_ns=switched, trigger_flow=flow, trigger_brush=brush,
    )  # fmt: skip
    return joined, tuple(moves)
