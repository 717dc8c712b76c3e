"""The faces of a part: blending at their seams, their order, and the motion from face to face.

The faces overlap at their seams, because the spray of each reaches beyond it. Two things even
that out on the film of all faces together: how far from its seams each face is sprayed, found by
a search over a margin that they share, and the time that the gun spends on each pass, by bounded
least squares, since the film is linear in it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move, timed
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.sprayable_faces import Face
from paint_deposition.part.surface import Surface
from paint_deposition.planning.passes import (
    PassStyle,
    PlannedPass,
    plan_pass,
    planned_moves,
    trajectory_of,
)
from paint_deposition.planning.plan import plan
from paint_deposition.planning.planned_film import WantedFilm, evenness
from paint_deposition.planning.requests import PlanRequest
from paint_deposition.planning.surface_map import SurfaceMap

# Margins along the seams that are tried, as shares of the overspray.
MARGINS = (0.0, 0.35, 0.7, 1.0)


@dataclass(frozen=True)
class FacePasses:
    """The passes of one face in running order, and how they are run."""

    passes: tuple[PlannedPass, ...]
    style: PassStyle

    def reversed(self) -> 'FacePasses':
        """Passes of the face run the other way round, the last one first."""
        return replace(self, passes=tuple(map(_reversed, self.passes[::-1])))


@dataclass(frozen=True)
class _FaceFilms:
    """Passes on every face for one margin, and the film of each pass on the whole part."""

    margin_m: float
    faces: tuple[FacePasses, ...]
    maps: tuple[SurfaceMap, ...]
    films_um: np.ndarray


def blend(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    faces: tuple[Face, ...],
    wanted: WantedFilm,
    progress: Callable[[str, float], None],
) -> tuple[float, tuple[FacePasses, ...], float]:
    """Lay passes on each face, and choose margin and speeds for an even film of all.

    Even is the film over its own target, where one is wanted. Returned are the margin, by how much
    each face is sprayed less far than its seams [m], the passes of the faces, each at its speed,
    and sigma_n without margin, each face for itself.
    """
    overspray_m, tried = 0.0, []
    for number, share in enumerate(MARGINS if len(faces) > 1 else MARGINS[:1]):
        progress('faces', number / len(MARGINS))
        tried.append(_lay_faces(surface, model, request, faces, share * overspray_m, wanted))
        overspray_m = tried[0].faces[0].style.overspray_m
    area_m2 = np.where(wanted.region, surface.vertex_areas_m2, 0.0)
    target = request.target_um if request.speed_m_per_s is None else None
    dwells = [_dwell(trial, area_m2, target) for trial in tried]
    sigmas = [
        evenness(dwell @ trial.films_um, area_m2)[1]
        for dwell, trial in zip(dwells, tried, strict=True)
    ]
    best = int(np.argmin(sigmas))
    _, before = evenness(tried[0].films_um.sum(axis=0), area_m2)
    return tried[best].margin_m, _with_dwell(tried[best], dwells[best], request), before


def _lay_faces(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    faces: tuple[Face, ...],
    margin_m: float,
    wanted: WantedFilm,
) -> _FaceFilms:
    passes, maps, films = [], [], []
    integrator = FilmIntegrator(surface.points(), model, occluder=surface.occluder)
    for face in faces:
        planned = plan(face.without_margin(margin_m).surface, model, request)
        passes.append(FacePasses(planned.passes, planned.style))
        maps.append(planned.line_films.surface_map)
        for one in planned.passes:
            path, _ = spray_path(trajectory_of((one,), planned.style), max_step_m=model.max_step_m)
            integrator.reset()
            integrator.add(path)
            films.append(integrator.raw_um / wanted.share)
    return _FaceFilms(margin_m, tuple(passes), tuple(maps), np.array(films))


def _dwell(trial: _FaceFilms, area: np.ndarray, target_um: float | None) -> np.ndarray:
    """(n,) time on each pass, over what it is on its face alone, for an even film of all."""
    weight = area / area.sum()
    films = trial.films_um
    wanted = target_um or float(weight @ films.sum(axis=0))
    rows = np.sqrt(weight)[:, np.newaxis] * films.T / wanted
    # The times stay within half and twice those for evenness on each face alone, and near them.
    ridge = 0.02 * np.eye(len(films)) / math.sqrt(len(films))
    return lsq_linear(
        np.vstack([rows, ridge]), np.concatenate([np.sqrt(weight), ridge.sum(axis=1)]), (0.5, 2.0)
    ).x


def _with_dwell(
    trial: _FaceFilms, dwell: np.ndarray, request: PlanRequest
) -> tuple[FacePasses, ...]:
    """The passes at their new speeds, with a lead-in to match."""
    found, first = [], 0
    for face, surface_map in zip(trial.faces, trial.maps, strict=True):
        passes = []
        for number, planned in enumerate(face.passes):
            style = replace(
                face.style, speed_m_per_s=planned.speed_m_per_s / float(dwell[first + number])
            )
            backwards = bool(number % 2) and not request.one_way
            passes.append(plan_pass(surface_map, planned.across_m, style, backwards))
        first += len(passes)
        found.append(FacePasses(tuple(passes), face.style))
    return tuple(found)


# --- order, and the way from face to face


def order_faces(faces: Sequence[FacePasses]) -> tuple[FacePasses, ...]:
    """The faces in that order, each time the nearest next, which has least travel between them.

    A face may run the other way round, unless its passes all run one way.
    """
    ways = [(f,) if f.style.one_way else (f, f.reversed()) for f in faces]
    tried = [_nearest_next(k, first, ways) for k, own in enumerate(ways) for first in own]
    # An order and its reverse take the same way: of equal ones the first, whatever the last digit.
    return min(tried, key=lambda order: round(sum(map(_travel_m, order, order[1:])), 6))


def _nearest_next(
    number: int, first: FacePasses, ways: Sequence[Sequence[FacePasses]]
) -> tuple[FacePasses, ...]:
    order, left = [first], dict(enumerate(ways))
    del left[number]
    while left:
        there = [(_travel_m(order[-1], way), k, way) for k, own in left.items() for way in own]
        _, nearest, way = min(there, key=lambda one: one[0])
        order.append(way)
        del left[nearest]
    return tuple(order)


def _travel_m(before: FacePasses, after: FacePasses) -> float:
    ends = before.passes[-1].positions_m[-1], after.passes[0].positions_m[0]
    return float(np.linalg.norm(ends[1] - ends[0]))


def join_motions(
    faces: Sequence[FacePasses], frame_id: str, is_clear: Callable[[Trajectory], bool]
) -> tuple[Trajectory, tuple[Move, ...]]:
    """The timed motion that sprays one face after the other, and the moves of a robot program.

    Between the faces the gun retracts along its axis until the way ``is_clear``.
    """
    parts: list[Trajectory] = []
    moves: list[Move] = []
    for number, face in enumerate(faces):
        own = planned_moves(face.passes, face.style)
        if number:
            between = _between(moves[-1], own[0], face.style, is_clear)
            parts.append(timed([moves[-1], *between, own[0]], gun_known=False))
            moves += between
        parts.append(trajectory_of(face.passes, face.style, frame_id))
        moves += own
    return _joined(parts, frame_id), tuple(moves)


def _between(
    before: Move, after: Move, style: PassStyle, is_clear: Callable[[Trajectory], bool]
) -> list[Move]:
    """Moves from the end of a face to the start of the next, without both."""
    speed = style.transfer_speed_m_per_s
    # Retractions between faces [m]: the first that keeps the gun clear of the part is taken.
    for retreat_m in (0.1, 0.2, 0.4, 0.8):
        between = []
        for move in (before, after):
            tool_z = Rotation.from_quat(move.quaternion_xyzw).as_matrix()[:, 2]
            back_m = move.position_m - retreat_m * tool_z
            between.append(Move(back_m, move.quaternion_xyzw, speed, spraying=False))
        if is_clear(timed([before, *between, replace(after, speed_m_per_s=speed)], False)):
            break
    return between


def _joined(parts: Sequence[Trajectory], frame_id: str) -> Trajectory:
    """One motion after the other; each begins where the one before ends."""
    clock, shifts = 0, []
    for part in parts:
        shifts.append(clock - int(part.stamps_ns[0]))
        clock += int(part.stamps_ns[-1] - part.stamps_ns[0])

    def rows(name: str, number: int) -> np.ndarray:
        # Where one ends and the next begins there is one pose.
        return getattr(parts[number], name)[1 if number else 0 :]

    numbers = range(len(parts))
    return Trajectory(
        np.concatenate([rows('stamps_ns', k) + shifts[k] for k in numbers]),
        np.concatenate([rows('positions_m', k) for k in numbers]),
        np.concatenate([rows('quaternions_xyzw', k) for k in numbers]),
        frame_id=frame_id,
        trigger_stamps_ns=np.concatenate(
            [parts[k].trigger_stamps_ns + shifts[k] for k in numbers]
        ),
        trigger_flow=np.concatenate([part.trigger_flow for part in parts]),
        trigger_brush=np.concatenate([part.trigger_brush for part in parts]),
    )


def _reversed(planned: PlannedPass) -> PlannedPass:
    length = float(planned.along_m[-1])
    return replace(
        planned,
        positions_m=planned.positions_m[::-1],
        rotations=planned.rotations[::-1],
        along_m=length - planned.along_m[::-1],
        on_m=length - planned.off_m,
        off_m=length - planned.on_m,
    )
